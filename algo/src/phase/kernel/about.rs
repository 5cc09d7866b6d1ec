//! Levels about a known map: one, two or three of them, from frames or from what has arrived.

use super::quality::{Doubts, none, trust};
use super::temporal::{doubled_where, four};
use super::{STRETCH, next_block, of_stretch, stretches};
use crate::phase::about::{About, AboutLanes, Around};
use crate::phase::angle::AngleLanes;
use crate::phase::arrived::{WrappedRow, WrappedRowMut};
use crate::phase::fold::BlockSample;
use crate::phase::level::{Demodulated, Level, LevelLanes};
use crate::phase::narrow::FewWrapped;
use crate::phase::source::{Frames, Source};
use crate::phase::unwrap_step::Turns;
use crate::simd::{Backend, Four, Lanes, Results, back_end_entry, plain};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// Decodes columns of a row about a row of the known map: the rows of each level's frames, coarse to fine, in the order of
/// their shifts.
pub(crate) fn around_row<T: BlockSample>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    rows: &[&[&[T]]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: Results<'_>,
) {
    let fours: heapless::Vec<Four<'_, T>, 3> = (levels.iter().zip(rows))
        .map_while(|(level, rows)| four(level, rows, &columns))
        .take(3)
        .collect();
    match (rows, &fours[..]) {
        (&[_], &[a]) => single(backend, plan, levels, a, map, columns, out),
        (&[a], _) => single(backend, plan, levels, a, map, columns, out),
        (&[_, _, _], &[a, b, c]) => dense(backend, plan, levels, [a, b], c, map, columns, out),
        _ => in_turn(backend, plan, levels, rows, map, columns, out),
    }
}

/// One level after the other, stretch by stretch.
fn in_turn<T: BlockSample>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    rows: &[&[&[T]]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let Some((last, others)) = rows.split_last() else {
        return;
    };
    // Dense levels are three at most.
    let mut room = [FewWrapped::<STRETCH>::new(); 2];
    for stretch in stretches(columns) {
        let columns = 0..stretch.len();
        let mut before: heapless::Vec<WrappedRow<'_>, 2> = heapless::Vec::new();
        for ((level, rows), room) in levels.iter().zip(others).zip(&mut room) {
            let rows = of_stretch(rows, &stretch);
            let coarsest = before.first().copied();
            wrap_row(
                backend,
                level,
                &rows,
                coarsest,
                columns.clone(),
                room.row_mut(),
            );
            before.extend([room.row()]);
        }
        let (rows, map, out) = (
            of_stretch(last, &stretch),
            &map[stretch.clone()],
            out.part(&stretch),
        );
        last_row(backend, plan, levels, &before, &rows, map, columns, out);
    }
}

/// As [`around_row`], from the levels that have arrived and the frames of the finest.
#[allow(clippy::too_many_arguments)]
pub(crate) fn last_row<T: BlockSample>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    before: &[WrappedRow<'_>],
    rows: &[&[T]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: Results<'_>,
) {
    match *before {
        [] => around_row(backend, plan, levels, &[rows], map, columns, out),
        [a] => dense(backend, plan, levels, [a], rows, map, columns, out),
        [a, b] => match levels.last().and_then(|level| four(level, rows, &columns)) {
            Some(frames) => dense(backend, plan, levels, [a, b], frames, map, columns, out),
            None => dense(backend, plan, levels, [a, b], rows, map, columns, out),
        },
        _ => {}
    }
}

back_end_entry! {
    fn single [S: Frames] = single_columns(
        plan: &About,
        levels: &[Level],
        frames: S,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: Results<'_>,
    )
}

back_end_entry! {
    fn dense [S: Source, F: Frames, const OTHERS: usize] = dense_columns(
        plan: &About,
        levels: &[Level],
        others: [S; OTHERS],
        finest: F,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: Results<'_>,
    )
}

/// Demodulates columns of a row of one level; not where `coarsest` says that all of a block is weak.
pub(crate) fn wrap_row<T: BlockSample>(
    backend: Backend,
    level: &Level,
    rows: &[&[T]],
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    out: WrappedRowMut<'_>,
) {
    wrap(backend, level, rows, coarsest, columns, out);
}

back_end_entry! {
    fn wrap [S: Frames] = wrap_columns(
        level: &Level,
        frames: S,
        coarsest: Option<WrappedRow<'_>>,
        columns: Range<usize>,
        out: WrappedRowMut<'_>,
    )
}

/// How bright the levels of a block are.
struct Light<V: Lanes> {
    /// Mask: the coarsest is strong.
    lit: V::B,
    /// Mask: all are, and something is known.
    strong: V::B,
    /// 255 where a sample is at full scale.
    brightest: V::B,
}

impl<V: Lanes> Light<V> {
    #[inline(always)]
    fn add(&mut self, v: V, level: &Demodulated<V>) {
        self.strong = v.and8(self.strong, level.strong);
        self.brightest = v.max8(self.brightest, level.brightest);
    }
}

/// A block of a row of the known map.
struct Known<V: Lanes> {
    /// Φ₀, 1/65536 turn.
    phase: [[V::D; 2]; 2],
    turns: [Turns<V>; 2],
    /// Mask: nothing is known.
    unexpected: V::B,
}

impl<V: Lanes> Known<V> {
    #[inline(always)]
    fn new(v: V, map: &[i32], at: usize) -> Self {
        v.fetch(map, at, V::AHEAD);
        let phase = v.load32(map, at);
        // No other phase has as many turns.
        let unknown = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let (low, high) = (Turns::of(v, phase[0]), Turns::of(v, phase[1]));
        let unexpected = v.narrow_mask([v.eq(low.order, unknown), v.eq(high.order, unknown)]);
        Self {
            phase,
            turns: [low, high],
            unexpected,
        }
    }

    /// The first doubts of a block, where it has been looked at at all.
    #[inline(always)]
    fn first(&self, v: V, lit: V::B, first: V::B) -> V::B {
        let first = v.pick8(lit, first, v.splat8(Trust::Dark as u8));
        v.pick8(self.unexpected, v.splat8(Trust::Unexpected as u8), first)
    }
}

/// Stores a block unwrapped about the map; the modulation is the finest level's.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn store<V: Lanes>(
    v: V,
    about: &AboutLanes<V>,
    known: &Known<V>,
    levels: &Around<V>,
    light: &Light<V>,
    modulation: [V::W; 2],
    at: usize,
    out: &mut Results<'_>,
) {
    let low = about.unwrap(v, known.phase[0], known.turns[0], levels, 0);
    let high = about.unwrap(v, known.phase[1], known.turns[1], levels, 1);
    let doubts: Doubts<V> = Doubts {
        strong: light.strong,
        brightest: light.brightest,
        left: [low.left, high.left],
    };
    if doubts.none(v, light.strong) {
        let modulation = [
            v.add(modulation[0], modulation[0]),
            v.add(modulation[1], modulation[1]),
        ];
        let resolved = v.splat8(Trust::Resolved as u8);
        out.store(v, at, [low.phase, high.phase], modulation, resolved);
        return;
    }
    let first = known.first(v, light.lit, doubts.first(v));
    let trusted = none(v, first);
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    let (masks_low, masks_high) = (
        v.join(trusted[0], trusted[0]),
        v.join(trusted[1], trusted[1]),
    );
    let phase = [
        [
            v.pick32(masks_low[0], low.phase[0], unknown),
            v.pick32(masks_low[1], low.phase[1], unknown),
        ],
        [
            v.pick32(masks_high[0], high.phase[0], unknown),
            v.pick32(masks_high[1], high.phase[1], unknown),
        ],
    ];
    let modulation = doubled_where(v, trusted, modulation);
    out.store(v, at, phase, modulation, trust(v, first));
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &About,
    levels: &[Level],
    frames: S,
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let ([level], Some(about)) = (levels, AboutLanes::new::<1>(v, plan)) else {
        return;
    };
    let level = LevelLanes::new(v, level);
    let angle = AngleLanes::new(v);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let map = &plain::phase_bits(map)[..columns.end];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = Known::new(v, map, at);
        if v.all8(known.unexpected) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let folded = frames.fold(v, &level, at, V::AHEAD);
        let light = Light {
            lit: folded.strong,
            strong: v.pick8(known.unexpected, v.splat8(0), folded.strong),
            brightest: folded.brightest,
        };
        if v.none8(light.strong) {
            out.store_unknown(v, at, known.first(v, light.lit, light.strong));
            continue;
        }
        let (finest, modulation) = level.fine(v, &angle, &folded, S::DOUBLED);
        let around = Around {
            first: finest,
            second: finest,
            finest,
        };
        store(v, &about, &known, &around, &light, modulation, at, &mut out);
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn dense_columns<V: Lanes, S: Source, F: Frames, const OTHERS: usize>(
    v: V,
    plan: &About,
    levels: &[Level],
    others: [S; OTHERS],
    finest: F,
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let three = OTHERS == 2;
    let about = if three {
        AboutLanes::new::<3>(v, plan)
    } else {
        AboutLanes::new::<2>(v, plan)
    };
    let ([one, .., last], Some(about)) = (levels, about) else {
        return;
    };
    let (Some(&source), Some(&other), Some(two)) = (others.first(), others.last(), levels.get(1))
    else {
        return;
    };
    let first = Part::new(v, one, source.first(columns.end));
    let second = Part::new(v, two, other.first(columns.end));
    let (level, finest) = (LevelLanes::new(v, last), Frames::first(finest, columns.end));
    let mut out = out.first(columns.end);
    let angle = AngleLanes::new(v);
    let map = &plain::phase_bits(map)[..columns.end];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = Known::new(v, map, at);
        if v.all8(known.unexpected) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let block = first.source.block(v, &first.level, at);
        let lit = block.strong();
        let mut light = Light {
            lit,
            strong: v.pick8(known.unexpected, v.splat8(0), lit),
            brightest: v.splat8(0),
        };
        if v.none8(light.strong) {
            out.store_unknown(v, at, known.first(v, lit, light.strong));
            continue;
        }
        let one = block.fine(v, &first.level, &angle, S::DOUBLED);
        let mut two = one;
        light.add(v, &one);
        if three {
            two = second.fine(v, &angle, at);
            light.add(v, &two);
        }
        let folded = finest.fold(v, &level, at, V::AHEAD);
        let (last, modulation) = level.fine(v, &angle, &folded, F::DOUBLED);
        light.add(v, &last);
        let around = Around {
            first: one,
            second: two,
            finest: last,
        };
        store(v, &about, &known, &around, &light, modulation, at, &mut out);
    }
}

#[inline(always)]
fn wrap_columns<V: Lanes, S: Frames>(
    v: V,
    level: &Level,
    frames: S,
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    mut out: WrappedRowMut<'_>,
) {
    let part = Part::new(v, level, frames);
    let angle = AngleLanes::new(v);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        if let Some(coarsest) = &coarsest
            && v.none8(coarsest.strong(v, at))
        {
            out.store_weak(v, at);
            continue;
        }
        out.store(v, at, &part.fine(v, &angle, at));
    }
}

/// A level and where its blocks come from.
#[derive(Clone, Copy)]
struct Part<'a, V: Lanes, S> {
    level: LevelLanes<'a, V>,
    source: S,
}

impl<'a, V: Lanes, S: Source> Part<'a, V, S> {
    #[inline(always)]
    fn new(v: V, level: &'a Level, source: S) -> Self {
        Self {
            level: LevelLanes::new(v, level),
            source,
        }
    }

    #[inline(always)]
    fn fine(&self, v: V, angle: &AngleLanes<V>, at: usize) -> Demodulated<V> {
        let block = self.source.block(v, &self.level, at);
        block.fine(v, &self.level, angle, S::DOUBLED)
    }
}
