//! Geometric levels one by one, as they arrive.

use super::next_block;
use super::quality::{Doubts, unless_dark};
use super::temporal::{Below, Ground, Rung, four};
use crate::phase::arrived::{ClimbedRow, ClimbedRowMut};
use crate::phase::fold::BlockSample;
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes};
use crate::phase::source::Frames;
use crate::phase::unwrap_step::{Ahead, Step, StepLanes};
use crate::simd::{Backend, Lanes, Results, back_end_entry};
use crate::trust::Trust;
use core::ops::Range;

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

/// Decodes columns of a row of the finest level as far as [`Geometric::finish`].
pub(super) fn top_row<T: BlockSample>(
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
        let folded = frames.fold(v, &level, at, V::AHEAD);
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
        let climb = rung.rough(v, &ground, &below, at, V::AHEAD);
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
        let (climb, modulation) = finest.fine(v, &ground, &before.below(v, at), at, V::AHEAD);
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
