//! Levels about a known map, dense ones or a single one → absolute phase.
//!
//! **Idea and equation**: [`crate::phase::about`]. Dense levels are demodulated when their frames
//! have arrived, while those of the next are being exposed ([`WrappedRow`]); when the finest has
//! arrived, all are combined. Per block:
//!
//! ```text
//! load Φ₀; if none of it is known: store "unexpected", next block
//! if all of the coarsest level is dark: store "dark", next block
//! demodulate the finest level, in fine quality as the others, because all carry the result's accuracy
//! unwrap about Φ₀; store Φ, B of the finest level, and the first reason against each pixel
//! ```
//!
//! **Shapes and units.** `rows[shift][u]` in counts, in the order of the level's shifts; `map` is
//! Φ₀ of the row in 1/65536 turn; results as in [`super::geometric`].
//!
//! **Departures from the plain form.** A single level is compiled for 3 and for 4 shifts of 8 bits,
//! the finest of three for 4; any others branch to the form of their number in every block.
//!
//! **Accuracy.** As [`crate::phase::about`]; the same bits on every back-end
//! (`every_back_end_gives_the_same_bits`).

use super::{Frames, Mended, next_block, next_clipped, of_bytes};
use crate::phase::about::{About, BlockLevels, DenseLanes, SingleLanes, Unwrapped};
use crate::phase::arrived::{WrappedRow, WrappedRowMut};
use crate::phase::fold::AngleLanes;
use crate::phase::level::{LevelLanes, LevelPlan};
use crate::phase::quality::{Quality, doubled, doubled_where, resolved_mask, trust};
use crate::phase::samples::BlockSample;
use crate::phase::unwrap_step::Turns;
use crate::simd::{Backend, Lanes, Results, Rows, back_end_entry, phase_bits};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// Decodes columns of a row of the finest level about a row of the known map, after all others,
/// `before`, have arrived.
#[allow(clippy::too_many_arguments)]
pub(crate) fn finest_row<T: BlockSample>(
    backend: Backend,
    plan: &About,
    level: &LevelPlan,
    before: &[WrappedRow<'_>],
    rows: &[&[T]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let (all, out) = (Rows::new(rows, columns.end), &mut out);
    let (three, four) = (of_bytes::<T, 3>(level, rows), of_bytes::<T, 4>(level, rows));
    let again = columns.clone();
    match (before, three, four) {
        ([], Some(&frames), _) => single(backend, plan, level, frames, map, columns, out),
        ([], _, Some(&frames)) => single(backend, plan, level, frames, map, columns, out),
        ([], ..) => single(backend, plan, level, all, map, columns, out),
        (&[a], ..) => dense(backend, plan, level, [a], all, map, columns, out),
        (&[a, b], _, Some(&frames)) => {
            dense(backend, plan, level, [a, b], frames, map, columns, out);
        }
        (&[a, b], ..) => dense(backend, plan, level, [a, b], all, map, columns, out),
        // There are at most three dense levels.
        _ => {}
    }
    let mut from = again.start;
    while let Some(block) = next_clipped(level, &mut from, &again, |block| out.has_saturated(block))
    {
        let all = Mended(all);
        match before {
            [] => single(backend, plan, level, all, map, block, out),
            &[a] => dense(backend, plan, level, [a], all, map, block, out),
            &[a, b] => dense(backend, plan, level, [a, b], all, map, block, out),
            _ => {}
        }
    }
}

back_end_entry! {
    /// A single level.
    fn single [S: Frames] = single_columns(
        plan: &About,
        level: &LevelPlan,
        frames: S,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    /// Two or three dense levels: one or two others beside the finest.
    fn dense [S: Frames, const OTHERS: usize] = dense_columns(
        plan: &About,
        level: &LevelPlan,
        others: [WrappedRow<'_>; OTHERS],
        finest: S,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

/// Demodulates columns of a row of one level, except blocks that are all weak at the coarsest
/// level.
pub(crate) fn demodulate_row<T: BlockSample>(
    backend: Backend,
    level: &LevelPlan,
    rows: &[&[T]],
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    out: WrappedRowMut<'_>,
) {
    let (rows, mut out) = (Rows::new(rows, columns.end), out);
    let again = columns.clone();
    let mut saturated = false;
    demodulate(
        backend,
        level,
        rows,
        coarsest,
        columns,
        out.again(),
        &mut saturated,
    );
    let mut from = if saturated { again.start } else { again.end };
    while let Some(block) = next_clipped(level, &mut from, &again, |block| out.has_saturated(block))
    {
        demodulate(
            backend,
            level,
            Mended(rows),
            coarsest,
            block,
            out.again(),
            &mut saturated,
        );
    }
}

back_end_entry! {
    fn demodulate [S: Frames] = demodulate_columns(
        level: &LevelPlan,
        frames: S,
        coarsest: Option<WrappedRow<'_>>,
        columns: Range<usize>,
        out: WrappedRowMut<'_>,
        saturated: &mut bool,
    )
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &About,
    level: &LevelPlan,
    frames: S,
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let about = SingleLanes::new(v, plan);
    let level = LevelLanes::new(v, level);
    let angle = AngleLanes::new(v);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let map = &phase_bits(map)[..columns.end];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = KnownBlock::new(v, map, at);
        if v.all8(known.unknown) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let folded = frames.fold(v, &level, at);
        let lit = folded.strong;
        let mut quality = Quality::new(v, known.where_known(v, lit));
        if v.none8(quality.strong) {
            out.store_unknown(v, at, known.first_reason(v, lit, quality.strong));
            continue;
        }
        quality.brightest = folded.brightest;
        let (finest, modulation) = level.fine(v, &angle, &folded, S::DOUBLED);
        let unwrapped = [
            about.unwrap(v, known.phase[0], known.turns[0], finest.phase[0]),
            about.unwrap(v, known.phase[1], known.turns[1], finest.phase[1]),
        ];
        store(v, &known, unwrapped, lit, quality, modulation, at, &mut out);
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn dense_columns<V: Lanes, S: Frames, const OTHERS: usize>(
    v: V,
    plan: &About,
    level: &LevelPlan,
    others: [WrappedRow<'_>; OTHERS],
    finest: S,
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let three = OTHERS == 2;
    let about = DenseLanes::new(v, plan, three);
    // With two levels there is no middle one; `middle` is then a copy that is not used.
    let (Some(coarse), Some(middle), Some(about)) = (others.first(), others.last(), about) else {
        return;
    };
    let (coarse, middle) = (coarse.part(0..columns.end), middle.part(0..columns.end));
    let (level, finest) = (LevelLanes::new(v, level), finest.first(columns.end));
    let mut out = out.first(columns.end);
    let angle = AngleLanes::new(v);
    let map = &phase_bits(map)[..columns.end];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = KnownBlock::new(v, map, at);
        if v.all8(known.unknown) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let coarse = coarse.block(v, at);
        let lit = coarse.strong;
        let mut quality = Quality::new(v, known.where_known(v, lit));
        if v.none8(quality.strong) {
            out.store_unknown(v, at, known.first_reason(v, lit, quality.strong));
            continue;
        }
        quality.add(v, coarse.strong, coarse.brightest);
        let mut block = BlockLevels {
            coarse,
            middle: coarse,
            finest: coarse,
        };
        if three {
            block.middle = middle.block(v, at);
            quality.add(v, block.middle.strong, block.middle.brightest);
        }
        let folded = finest.fold(v, &level, at);
        let modulation;
        (block.finest, modulation) = level.fine(v, &angle, &folded, S::DOUBLED);
        quality.add(v, block.finest.strong, block.finest.brightest);
        let unwrapped = [
            about.unwrap(v, known.phase[0], known.turns[0], &block, 0),
            about.unwrap(v, known.phase[1], known.turns[1], &block, 1),
        ];
        store(v, &known, unwrapped, lit, quality, modulation, at, &mut out);
    }
}

#[inline(always)]
fn demodulate_columns<V: Lanes, S: Frames>(
    v: V,
    level: &LevelPlan,
    frames: S,
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    mut out: WrappedRowMut<'_>,
    saturated: &mut bool,
) {
    let level = LevelLanes::new(v, level);
    let angle = AngleLanes::new(v);
    let mut brightest = v.splat8(0);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        if let Some(coarsest) = &coarsest
            && v.none8(coarsest.strong(v, at))
        {
            out.store_weak(v, at);
            continue;
        }
        let folded = frames.fold(v, &level, at);
        let (block, _) = level.fine(v, &angle, &folded, S::DOUBLED);
        brightest = v.max8(brightest, block.brightest);
        out.store(v, at, &block);
    }
    *saturated = !v.none8(v.eq8(brightest, v.splat8(u8::MAX)));
}

/// A block of the known map.
struct KnownBlock<V: Lanes> {
    /// Φ₀, 1/65536 turn.
    phase: [[V::D; 2]; 2],
    /// Φ₀ as fringe orders and fractions.
    turns: [Turns<V>; 2],
    /// Mask: Φ₀ is not known.
    unknown: V::B,
}

impl<V: Lanes> KnownBlock<V> {
    #[inline(always)]
    fn new(v: V, map: &[i32], at: usize) -> Self {
        v.fetch(map, at, V::AHEAD);
        let phase = v.load32(map, at);
        // No known phase has this fringe order.
        let order = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let (low, high) = (Turns::split(v, phase[0]), Turns::split(v, phase[1]));
        let unknown = v.narrow_mask([v.eq(low.order, order), v.eq(high.order, order)]);
        Self {
            phase,
            turns: [low, high],
            unknown,
        }
    }

    /// `mask` where Φ₀ is known, 0 elsewhere.
    #[inline(always)]
    fn where_known(&self, v: V, mask: V::B) -> V::B {
        v.pick8(self.unknown, v.splat8(0), mask)
    }

    /// The first reasons of a block: [`Trust::Unexpected`], then [`Trust::Dark`], then `reason`.
    #[inline(always)]
    fn first_reason(&self, v: V, lit: V::B, reason: V::B) -> V::B {
        let reason = v.pick8(lit, reason, v.splat8(Trust::Dark as u8));
        v.pick8(self.unknown, v.splat8(Trust::Unexpected as u8), reason)
    }
}

/// Stores a block that was unwrapped about the map. `lit` is the mask of the coarsest level's
/// modulation, `modulation` is the finest level's.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn store<V: Lanes>(
    v: V,
    known: &KnownBlock<V>,
    [low, high]: [Unwrapped<V>; 2],
    lit: V::B,
    mut quality: Quality<V>,
    modulation: [V::W; 2],
    at: usize,
    out: &mut Results<'_>,
) {
    quality.residual = [low.residual, high.residual];
    if quality.all_resolved(v, quality.strong) {
        let resolved = v.splat8(Trust::Resolved as u8);
        let phase = [low.phase, high.phase];
        out.store(v, at, phase, doubled(v, modulation), resolved);
        return;
    }
    let reason = known.first_reason(v, lit, quality.first_reason(v));
    let resolved = resolved_mask(v, reason);
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    let (masks_low, masks_high) = (
        v.join(resolved[0], resolved[0]),
        v.join(resolved[1], resolved[1]),
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
    let modulation = doubled_where(v, resolved, modulation);
    let trust = trust(v, reason);
    out.note_saturated(v, trust);
    out.store(v, at, phase, modulation, trust);
}
