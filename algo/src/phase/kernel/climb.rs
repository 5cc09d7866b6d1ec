//! Geometric levels: from the coarsest to the finest in one pass, or level by level as they arrive.

use super::doubt::{Doubts, none, trust, unless_dark};
use super::next_block;
use crate::phase::angle::AngleLanes;
use crate::phase::arrived::{Arrived, ArrivingRow, ClimbedRow, ClimbedRowMut};
use crate::phase::fold::{BlockSample, Folded};
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes, Samples};
use crate::phase::source::Frames;
use crate::phase::step::{Ahead, Step, StepLanes, Turns};
use crate::simd::{Backend, Four, Lanes, Results, back_end_entry};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// Decodes columns of a row: the rows of each level's frames, coarse to fine, in the order of their shifts.
pub(crate) fn climb_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let part = columns.clone();
    let fours: heapless::Vec<Four<'_, T>, 3> = (levels.iter().zip(rows))
        .map_while(|(level, rows)| four(level, rows, &columns))
        .take(3)
        .collect();
    let out = &mut out;
    match (rows, &fours[..]) {
        (&[a], _) => single(backend, plan, levels, a, columns, out),
        (&[_, _], &[a, b]) => fused(backend, plan, levels, (a, [], b), columns, out),
        (&[_, _, _], &[a, b, c]) => fused(backend, plan, levels, (a, [b], c), columns, out),
        _ => in_turn(backend, plan, levels, rows, columns, out),
    }
    plan.finish(&mut out.phase[part]);
}

/// One level after the other, as if they arrived one after the other.
fn in_turn<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let mut arrived = Arrived::climbing(columns.end, 1);
    let (Some((finest, coarser)), Some((last, rows))) = (levels.split_last(), rows.split_last())
    else {
        return;
    };
    for (at, (level, rows)) in coarser.iter().zip(rows).enumerate() {
        for row in arrived.rows() {
            if let ArrivingRow::Climbing(row) = row {
                arrive_row(backend, plan, at, level, rows, columns.clone(), row);
            }
        }
    }
    if let Some(before) = arrived.climbed_row(0) {
        top_row(backend, plan, finest, last, before, columns, out);
    }
}

/// Climbs columns of a row to level `at`, which has arrived.
pub(crate) fn arrive_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    at: usize,
    level: &Level,
    rows: &[&[T]],
    columns: Range<usize>,
    out: ClimbedRowMut<'_>,
) {
    match (&plan.steps[..at], &plan.steps[at..]) {
        ([], [next, ..]) => start(backend, plan, next, level, rows, columns, out),
        ([.., step], [next, ..]) => up(backend, plan, [step, next], level, rows, columns, out),
        // Nobody has room for the finest level.
        _ => {}
    }
}

/// Decodes columns of a row of the finest level, of which all others have arrived.
pub(crate) fn last_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    level: &Level,
    rows: &[&[T]],
    before: ClimbedRow<'_>,
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let part = columns.clone();
    top_row(backend, plan, level, rows, before, columns, &mut out);
    plan.finish(&mut out.phase[part]);
}

fn top_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    level: &Level,
    rows: &[&[T]],
    before: ClimbedRow<'_>,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    match four(level, rows, &columns) {
        Some(frames) => top(backend, plan, level, frames, before, columns, out),
        None => top(backend, plan, level, rows, before, columns, out),
    }
}

back_end_entry! {
    fn single [S: Frames] = single_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: S,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    fn fused [S: Frames, const BETWEEN: usize] = fused_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: (S, [S; BETWEEN], S),
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    fn start [S: Frames] = start_columns(
        plan: &Geometric,
        next: &Step,
        level: &Level,
        frames: S,
        columns: Range<usize>,
        out: ClimbedRowMut<'_>,
    )
}

back_end_entry! {
    fn up [S: Frames] = up_columns(
        plan: &Geometric,
        steps: [&Step; 2],
        level: &Level,
        frames: S,
        columns: Range<usize>,
        out: ClimbedRowMut<'_>,
    )
}

back_end_entry! {
    fn top [S: Frames] = top_columns(
        plan: &Geometric,
        level: &Level,
        frames: S,
        before: ClimbedRow<'_>,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

/// What all blocks of a row need.
struct Ground<V: Lanes> {
    angle: AngleLanes<V>,
    /// The middle of the turn that the coarsest level can have.
    middle: V::W,
    /// Whole turns that the finest level's phase counts from.
    origin: V::W,
}

impl<V: Lanes> Ground<V> {
    #[inline(always)]
    fn new(v: V, plan: &Geometric) -> Self {
        Self {
            angle: AngleLanes::new(v),
            middle: v.splat16(plan.middle as i16),
            origin: v.splat16((plan.origin >> 16) as i16),
        }
    }

    /// At the coarsest level, of which these are the phases.
    #[inline(always)]
    fn start(&self, v: V, phase: [V::W; 2], folded: &Folded<V>) -> Climb<V> {
        let zero = v.splat16(0);
        Climb {
            here: [
                Turns::within_half(v, v.sub(phase[0], self.middle)),
                Turns::within_half(v, v.sub(phase[1], self.middle)),
            ],
            doubts: Doubts {
                strong: folded.strong,
                brightest: folded.brightest,
                left: [zero; 2],
            },
        }
    }

    /// The phases of a level that only gives the order of the next.
    #[inline(always)]
    fn rough(&self, v: V, folded: &Folded<V>) -> [V::W; 2] {
        [
            self.angle.rough(v, folded, 0),
            self.angle.rough(v, folded, 1),
        ]
    }

    /// Stores a block: phases from their origin on and modulations of the pixels that nothing speaks against. `before` are the
    /// first doubts of the levels below.
    #[inline(always)]
    fn store(
        &self,
        v: V,
        climb: &Climb<V>,
        before: V::B,
        modulation: [V::W; 2],
        at: usize,
        out: &mut Results<'_>,
    ) {
        let [low, high] = climb.here;
        if climb.doubts.none(v, before) {
            // Nearly always: nothing speaks against any of them.
            let phases = [
                v.join(low.phase, v.add(low.order, self.origin)),
                v.join(high.phase, v.add(high.order, self.origin)),
            ];
            let modulation = [
                v.add(modulation[0], modulation[0]),
                v.add(modulation[1], modulation[1]),
            ];
            out.store(v, at, phases, modulation, v.splat8(Trust::Resolved as u8));
            return;
        }
        let first_doubt = v.min8(before, climb.doubts.first(v));
        let trusted = none(v, first_doubt);
        let phases = [
            self.known(v, low, trusted[0]),
            self.known(v, high, trusted[1]),
        ];
        let modulation = doubled_where(v, trusted, modulation);
        out.store(v, at, phases, modulation, trust(v, first_doubt));
    }

    /// The phase where it is trusted, [`AbsolutePhase::UNKNOWN`] elsewhere.
    #[inline(always)]
    fn known(&self, v: V, here: Turns<V>, trusted: V::W) -> [V::D; 2] {
        let unknown = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let order = v.pick(trusted, v.add(here.order, self.origin), unknown);
        v.join(v.and(here.phase, trusted), order)
    }
}

/// Where a block stands at a level.
#[derive(Clone, Copy)]
struct Climb<V: Lanes> {
    here: [Turns<V>; 2],
    doubts: Doubts<V>,
}

impl<V: Lanes> Climb<V> {
    /// What it says of the next level.
    #[inline(always)]
    fn ahead(&self, v: V, step: &StepLanes<V>) -> Below<V> {
        Below {
            ahead: step.ahead(v, self.here),
            doubts: self.doubts,
        }
    }

    /// The same at the coarsest level.
    #[inline(always)]
    fn ahead_of_start(&self, v: V, step: &StepLanes<V>) -> Below<V> {
        let [low, high] = self.here;
        Below {
            ahead: step.ahead_of_start(v, [low.phase, high.phase]),
            doubts: self.doubts,
        }
    }
}

/// What a block says of the level above.
#[derive(Clone, Copy)]
struct Below<V: Lanes> {
    ahead: [Ahead<V>; 2],
    doubts: Doubts<V>,
}

/// A level and the step that leads to it.
#[derive(Clone, Copy)]
struct Rung<'a, V: Lanes, S> {
    level: LevelLanes<'a, V>,
    frames: S,
    step: StepLanes<V>,
}

impl<'a, V: Lanes, S: Frames> Rung<'a, V, S> {
    #[inline(always)]
    fn new(v: V, step: &Step, level: &'a Level, frames: S) -> Self {
        Self {
            level: LevelLanes::new(v, level),
            frames,
            step: StepLanes::new(v, step),
        }
    }

    /// Up to this level, roughly.
    #[inline(always)]
    fn rough(&self, v: V, ground: &Ground<V>, below: &Below<V>, at: usize) -> Climb<V> {
        let folded = self.frames.fold(v, &self.level, at);
        self.land(v, below, ground.rough(v, &folded), &folded)
    }

    /// Up to this level, and the modulation there.
    #[inline(always)]
    fn fine(&self, v: V, ground: &Ground<V>, below: &Below<V>, at: usize) -> (Climb<V>, [V::W; 2]) {
        let folded = self.frames.fold(v, &self.level, at);
        let block = (self.level).fine(v, &ground.angle, &folded, S::DOUBLED);
        let climb = self.land(v, below, block.phase, &folded);
        (climb, block.modulation)
    }

    #[inline(always)]
    fn land(&self, v: V, below: &Below<V>, phase: [V::W; 2], folded: &Folded<V>) -> Climb<V> {
        let (low, left_low) = self.step.land(v, below.ahead[0], phase[0]);
        let (high, left_high) = self.step.land(v, below.ahead[1], phase[1]);
        let before = &below.doubts;
        Climb {
            here: [low, high],
            doubts: Doubts {
                strong: v.and8(before.strong, folded.strong),
                brightest: v.max8(before.brightest, folded.brightest),
                left: [
                    v.max_unsigned(before.left[0], left_low),
                    v.max_unsigned(before.left[1], left_high),
                ],
            },
        }
    }
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    frames: S,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let [level] = levels else { return };
    let ground = Ground::new(v, plan);
    let level = LevelLanes::new(v, level);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at);
        let block = level.fine(v, &ground.angle, &folded, S::DOUBLED);
        let climb = ground.start(v, block.phase, &folded);
        let before = unless_dark(v, folded.strong);
        ground.store(v, &climb, before, block.modulation, at, &mut out);
    }
}

#[inline(always)]
fn fused_columns<V: Lanes, S: Frames, const BETWEEN: usize>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    (coarsest, between, finest): (S, [S; BETWEEN], S),
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let ([first, middle @ .., last], [steps @ .., step]) = (levels, &plan.steps[..]) else {
        return;
    };
    let ground = Ground::new(v, plan);
    let mut out = out.first(columns.end);
    let (coarsest, finest) = (coarsest.first(columns.end), finest.first(columns.end));
    let level = LevelLanes::new(v, first);
    let finest = Rung::new(v, step, last, finest);
    let mut rungs = [finest; BETWEEN];
    for (rung, ((step, level), frames)) in
        rungs.iter_mut().zip(steps.iter().zip(middle).zip(between))
    {
        *rung = Rung::new(v, step, level, frames.first(columns.end));
    }
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = coarsest.fold(v, &level, at);
        let lit = folded.strong;
        if v.none8(lit) {
            out.store_unknown(v, at, v.splat8(Trust::Dark as u8));
            continue;
        }
        let climb = ground.start(v, ground.rough(v, &folded), &folded);
        // At most one level is between.
        let below = match rungs.first() {
            None => climb.ahead_of_start(v, &finest.step),
            Some(rung) => {
                let below = climb.ahead_of_start(v, &rung.step);
                let climb = rung.rough(v, &ground, &below, at);
                climb.ahead(v, &finest.step)
            }
        };
        let (climb, modulation) = finest.fine(v, &ground, &below, at);
        ground.store(v, &climb, unless_dark(v, lit), modulation, at, &mut out);
    }
}

/// Four rows up to the end of the columns, of a level whose samples are subtracted in pairs.
pub(super) fn four<'a, T>(
    level: &Level,
    rows: &[&'a [T]],
    columns: &Range<usize>,
) -> Option<Four<'a, T>> {
    match (level.samples, rows) {
        (Samples::Four, &[a, b, c, d]) => Some(Four::new([a, b, c, d], columns.end)),
        _ => None,
    }
}

/// Twice the words where a mask is set, 0 elsewhere.
#[inline(always)]
pub(super) fn doubled_where<V: Lanes>(v: V, mask: [V::W; 2], x: [V::W; 2]) -> [V::W; 2] {
    [
        v.and(mask[0], v.add(x[0], x[0])),
        v.and(mask[1], v.add(x[1], x[1])),
    ]
}

/// The coarsest level.
#[inline(always)]
fn start_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    next: &Step,
    level: &Level,
    frames: S,
    columns: Range<usize>,
    mut out: ClimbedRowMut<'_>,
) {
    let ground = Ground::new(v, plan);
    let next = StepLanes::new(v, next);
    let level = LevelLanes::new(v, level);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at);
        if v.none8(folded.strong) {
            // Where it stands nobody asks any more.
            v.store8(out.doubt, at, v.splat8(Trust::Dark as u8));
            continue;
        }
        let climb = ground.start(v, ground.rough(v, &folded), &folded);
        let doubt = v.min8(unless_dark(v, folded.strong), climb.doubts.first(v));
        out.store(v, at, &climb.ahead(v, &next), doubt);
    }
}

/// A level between.
#[inline(always)]
fn up_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    [step, next]: [&Step; 2],
    level: &Level,
    frames: S,
    columns: Range<usize>,
    mut out: ClimbedRowMut<'_>,
) {
    let ground = Ground::new(v, plan);
    let rung = Rung::new(v, step, level, frames);
    let next = StepLanes::new(v, next);
    // The last block may overlap the one before, which by then stands a level higher.
    let last = columns.end - V::PIXELS;
    let before = out.as_row();
    let end = (v.load8(before.doubt, last), before.below(v, last));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let before = out.as_row();
        let (mut doubt, mut below) = (v.load8(before.doubt, at), before.below(v, at));
        if at == last {
            (doubt, below) = end;
        }
        if all_dark(v, doubt) {
            continue;
        }
        let climb = rung.rough(v, &ground, &below, at);
        let doubt = v.min8(doubt, climb.doubts.first(v));
        out.store(v, at, &climb.ahead(v, &next), doubt);
    }
}

/// The finest level.
#[inline(always)]
fn top_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    level: &Level,
    frames: S,
    before: ClimbedRow<'_>,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let Some(step) = plan.steps.last() else {
        return;
    };
    let finest = Rung::new(v, step, level, frames.first(columns.end));
    let ground = Ground::new(v, plan);
    let (before, mut out) = (before.first(columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let doubt = v.load8(before.doubt, at);
        if all_dark(v, doubt) {
            out.store_unknown(v, at, doubt);
            continue;
        }
        let (climb, modulation) = finest.fine(v, &ground, &before.below(v, at), at);
        ground.store(v, &climb, doubt, modulation, at, &mut out);
    }
}

#[inline(always)]
fn all_dark<V: Lanes>(v: V, doubt: V::B) -> bool {
    v.none8(v.xor8(doubt, v.splat8(Trust::Dark as u8)))
}

impl<'a> ClimbedRow<'a> {
    /// The first columns.
    #[inline(always)]
    fn first(self, length: usize) -> Self {
        Self {
            fraction: &self.fraction[..length],
            turns: &self.turns[..length],
            doubt: &self.doubt[..length],
        }
    }

    /// What the block says of the next level, without its doubts.
    #[inline(always)]
    fn below<V: Lanes>(&self, v: V, at: usize) -> Below<V> {
        let (fraction, turns) = (v.load16(self.fraction, at), v.load16(self.turns, at));
        Below {
            ahead: [
                Ahead {
                    fraction: fraction[0],
                    turns: turns[0],
                },
                Ahead {
                    fraction: fraction[1],
                    turns: turns[1],
                },
            ],
            doubts: Doubts {
                strong: v.splat8(u8::MAX),
                brightest: v.splat8(0),
                left: [v.splat16(0); 2],
            },
        }
    }
}

impl ClimbedRowMut<'_> {
    #[inline(always)]
    fn store<V: Lanes>(&mut self, v: V, at: usize, below: &Below<V>, doubt: V::B) {
        let [low, high] = below.ahead;
        v.store16(self.fraction, at, [low.fraction, high.fraction]);
        v.store16(self.turns, at, [low.turns, high.turns]);
        v.store8(self.doubt, at, doubt);
    }
}
