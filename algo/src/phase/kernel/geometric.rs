//! Geometric levels, one after the other: frames of every level → absolute phase.
//!
//! **Idea.** The coarsest level spans at most one turn of the pattern, so it is absolute; each
//! finer level takes its fringe order from the one before (temporal unwrapping, Huntley & Saldner
//! 1993). A level is decoded when its frames have arrived, while those of the next are being
//! exposed. Only the phase that it predicts for the next one is kept: its fraction and turns, and
//! the first reason against the pixel, 5 bytes. When the last frame arrives only the
//! finest level is left to decode.
//!
//! **Equation**, for levels i = 1 (coarsest) to K with ratios r_i and n_i = r_i / r_{i−1}; Peng &
//! Gupta 2008 use n_i = n, N = 4:
//!
//! ```text
//! Φ_1 = φ_1                                        about the middle of its turn
//! Φ_i = φ_i + round(n_i Φ_{i−1} − φ_i)             crate::phase::unwrap_step
//! Φ   = Φ_K / r_K
//!
//! level 1, when it has arrived:     φ_1 in rough quality; store n_2 Φ_1 and the reasons
//! level i = 2 … K − 1:              φ_i in rough quality; store n_{i+1} Φ_i and the reasons
//! level K:                          φ_K in fine quality; store Φ, B and trust
//! ```
//!
//! **Shapes and units.** `rows[shift][u]` in counts, in the order of the level's shifts;
//! [`PredictedRow`], a row of the frame; results in 1/65536 turn, full scale / 65535 and [`Trust`],
//! of the same columns.
//!
//! **Departures from the plain form.** Coarser levels have rough angles: they only choose a fringe
//! order, and 3.2e-4 turn more in a residual that may be 0.40 changes none. Blocks that are dark at
//! the coarsest level are skipped later; their stored prediction is never read. The last block of a
//! row may overlap the one before, whose prediction is for the next level by then, so what it needs
//! is read before the row begins. The finest level is compiled for 4 shifts of 8 bits; for any
//! others, and at coarser levels, it branches to the form of their number in every block.
//!
//! **Accuracy.** ε / r_K turn of the textbook in f64, with ε from the arctangent and the rounding
//! of samples (`tests/suite/stress/bounds.rs`):
//! `any_shifts_depth_ratios_size_and_stride_decode_as_the_textbook_says`; no wrong fringe order:
//! `no_fringe_order_slips_at_any_wrap_of_a_hundred_fringes`; the same bits on every back-end:
//! `every_back_end_gives_the_same_bits`.

use super::{Frames, Mended, next_block, next_clipped, of_bytes};
use crate::phase::arrived::{NO_REASON, PredictedRow, PredictedRowMut};
use crate::phase::geometric::{Geometric, GeometricLanes};
use crate::phase::level::{LevelLanes, LevelPlan};
use crate::phase::quality::dark_unless;
use crate::phase::samples::BlockSample;
use crate::phase::unwrap_step::{PredictedPhase, UnwrapStep, UnwrapStepLanes};
use crate::simd::{Backend, Lanes, Results, Rows, back_end_entry};
use crate::trust::Trust;
use core::ops::Range;

/// Decodes columns of a row of level `at`, which has arrived and is not the finest.
pub(crate) fn level_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    at: usize,
    level: &LevelPlan,
    rows: &[&[T]],
    columns: Range<usize>,
    out: PredictedRowMut<'_>,
) {
    let rows = Mended(Rows::new(rows, columns.end));
    match (&plan.steps[..at], &plan.steps[at..]) {
        ([], [next, ..]) => coarsest(backend, plan, next, level, rows, columns, out),
        ([.., step], [next, ..]) => between(backend, plan, [step, next], level, rows, columns, out),
        // The finest level is decoded by `finest_row`.
        _ => {}
    }
}

/// Decodes columns of a row of the finest level, after all others have arrived.
pub(crate) fn finest_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    level: &LevelPlan,
    rows: &[&[T]],
    before: PredictedRow<'_>,
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let (part, all, out) = (columns.clone(), Rows::new(rows, columns.end), &mut out);
    match of_bytes::<T, 4>(level, rows) {
        Some(&frames) => finest(backend, plan, level, frames, before, columns, out),
        None => finest(backend, plan, level, all, before, columns, out),
    }
    let mut from = part.start;
    while let Some(block) = next_clipped(level, &mut from, &part, |block| out.has_saturated(block))
    {
        finest(backend, plan, level, Mended(all), before, block, out);
    }
    plan.finish(&mut out.phase[part]);
}

/// Decodes columns of a row of a level without coarser ones: its phase is absolute.
pub(crate) fn single_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    level: &LevelPlan,
    rows: &[&[T]],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let part = columns.clone();
    let all = Rows::new(rows, columns.end);
    single(backend, plan, level, all, columns, &mut out);
    let mut from = part.start;
    while let Some(block) = next_clipped(level, &mut from, &part, |block| out.has_saturated(block))
    {
        single(backend, plan, level, Mended(all), block, &mut out);
    }
    plan.finish(&mut out.phase[part]);
}

back_end_entry! {
    /// The coarsest level.
    fn coarsest [S: Frames] = coarsest_columns(
        plan: &Geometric,
        next: &UnwrapStep,
        level: &LevelPlan,
        frames: S,
        columns: Range<usize>,
        out: PredictedRowMut<'_>,
    )
}

back_end_entry! {
    /// A level between coarsest and finest.
    fn between [S: Frames] = between_columns(
        plan: &Geometric,
        steps: [&UnwrapStep; 2],
        level: &LevelPlan,
        frames: S,
        columns: Range<usize>,
        out: PredictedRowMut<'_>,
    )
}

back_end_entry! {
    /// The finest level.
    fn finest [S: Frames] = finest_columns(
        plan: &Geometric,
        level: &LevelPlan,
        frames: S,
        before: PredictedRow<'_>,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    /// A level by itself.
    fn single [S: Frames] = single_columns(
        plan: &Geometric,
        level: &LevelPlan,
        frames: S,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

#[inline(always)]
fn coarsest_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    next: &UnwrapStep,
    level: &LevelPlan,
    frames: S,
    columns: Range<usize>,
    mut out: PredictedRowMut<'_>,
) {
    let lanes = GeometricLanes::new(v, plan);
    let next = UnwrapStepLanes::new(v, next);
    let level = LevelLanes::new(v, level);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at);
        if folded.dark {
            // Later levels skip this block and do not read its prediction.
            v.store8(out.reason, at, v.splat8(Trust::Dark as u8));
            continue;
        }
        let unwrapped = lanes.coarsest(v, lanes.rough(v, &folded), &folded);
        let reason = v.min8(
            dark_unless(v, folded.strong),
            unwrapped.quality.first_reason(v),
        );
        out.store(v, at, unwrapped.predicted(v, &next), reason);
    }
}

#[inline(always)]
fn between_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    [step, next]: [&UnwrapStep; 2],
    level: &LevelPlan,
    frames: S,
    columns: Range<usize>,
    mut out: PredictedRowMut<'_>,
) {
    let lanes = GeometricLanes::new(v, plan);
    let (step, next) = (UnwrapStepLanes::new(v, step), UnwrapStepLanes::new(v, next));
    let level = LevelLanes::new(v, level);
    // The last block may overlap the one before, whose prediction is for the next level by then.
    let last = columns.end - V::PIXELS;
    let before = out.row();
    let end = (v.load8(before.reason, last), before.phases(v, last));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let before = out.row();
        let (mut reason, mut predicted) = (v.load8(before.reason, at), before.phases(v, at));
        if at == last {
            (reason, predicted) = end;
        }
        if all_dark(v, reason) {
            continue;
        }
        let folded = frames.fold(v, &level, at);
        let unwrapped = lanes.finer(v, &step, predicted, lanes.rough(v, &folded), &folded);
        let reason = v.min8(reason, unwrapped.quality.first_reason(v));
        out.store(v, at, unwrapped.predicted(v, &next), reason);
    }
}

#[inline(always)]
fn finest_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    level: &LevelPlan,
    frames: S,
    before: PredictedRow<'_>,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let Some(step) = plan.steps.last() else {
        return;
    };
    let lanes = GeometricLanes::new(v, plan);
    let step = UnwrapStepLanes::new(v, step);
    let (level, frames) = (LevelLanes::new(v, level), frames.first(columns.end));
    let (before, mut out) = (before.part(0..columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let reason = v.load8(before.reason, at);
        if all_dark(v, reason) {
            out.store_unknown(v, at, reason);
            continue;
        }
        let folded = frames.fold(v, &level, at);
        let (block, modulation) = level.fine(v, &lanes.angle, &folded, S::DOUBLED);
        let unwrapped = lanes.finer(v, &step, before.phases(v, at), block.phase, &folded);
        let clear = v.eq8(reason, v.splat8(NO_REASON));
        lanes.store(v, &unwrapped, clear, reason, modulation, at, &mut out);
    }
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    level: &LevelPlan,
    frames: S,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let lanes = GeometricLanes::new(v, plan);
    let level = LevelLanes::new(v, level);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at);
        let (block, modulation) = level.fine(v, &lanes.angle, &folded, S::DOUBLED);
        let unwrapped = lanes.coarsest(v, block.phase, &folded);
        let (clear, before) = (folded.strong, dark_unless(v, folded.strong));
        lanes.store(v, &unwrapped, clear, before, modulation, at, &mut out);
    }
}

#[inline(always)]
fn all_dark<V: Lanes>(v: V, reason: V::B) -> bool {
    v.none8(v.xor8(reason, v.splat8(Trust::Dark as u8)))
}

impl PredictedRow<'_> {
    /// The predicted phases of the block at `at`.
    #[inline(always)]
    fn phases<V: Lanes>(&self, v: V, at: usize) -> [PredictedPhase<V>; 2] {
        let (fraction, turns) = (v.load16(self.fraction, at), v.load16(self.turns, at));
        [
            PredictedPhase {
                fraction: fraction[0],
                turns: turns[0],
            },
            PredictedPhase {
                fraction: fraction[1],
                turns: turns[1],
            },
        ]
    }
}

impl PredictedRowMut<'_> {
    /// Writes the block at `at`.
    #[inline(always)]
    fn store<V: Lanes>(&mut self, v: V, at: usize, phases: [PredictedPhase<V>; 2], reason: V::B) {
        let [low, high] = phases;
        v.store16(self.fraction, at, [low.fraction, high.fraction]);
        v.store16(self.turns, at, [low.turns, high.turns]);
        v.store8(self.reason, at, reason);
    }
}
