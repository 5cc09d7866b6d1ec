//! Geometric levels, all at once: frames of every level → absolute phase.
//!
//! **Idea.** The coarsest level spans at most one turn of the pattern, so it is absolute; each
//! finer level takes its fringe order from the one before (temporal unwrapping, Huntley & Saldner
//! 1993).
//!
//! **Equation**, for levels i = 1 (coarsest) to K with ratios r_i and n_i = r_i / r_{i−1}; Peng &
//! Gupta 2008 use n_i = n, N = 4:
//!
//! ```text
//! Φ_1 = φ_1                                        about the middle of its turn
//! Φ_i = φ_i + round(n_i Φ_{i−1} − φ_i)             crate::phase::unwrap_step
//! Φ   = Φ_K / r_K
//!
//! for each block of the row:
//!     fold level 1; if all of it is dark: store "dark", next block
//!     for i = 1 to K − 1: φ_i in rough quality, unwrap
//!     φ_K in fine quality, unwrap; store Φ, B of level K, and the first reason against each pixel
//! ```
//!
//! **Shapes and units.** `rows[level][shift][u]` in counts; results in 1/65536 turn, full scale /
//! 65535 and [`Trust`], of the same columns.
//!
//! **Departures from the plain form.** Up to three levels are decoded in one pass over their frames
//! ([`one_pass`]), so that only the result is written to memory. Level by level costs 1.4 times as
//! many instructions on NEON and on AVX2 (three levels of four shifts, 8 bits), so that is for
//! longer sequences only. The kernel is compiled for 3 to 9 shifts of 8 bits; for any others it
//! branches to the form of their number, which costs 2 of 20 instructions per pixel. Coarser levels
//! have rough angles: they only choose a fringe order, and 3.2e-4 turn more in a residual that may
//! be 0.40 changes none. Rows of bytes are read a whole cache line at a time
//! ([`Frames::fold_in_line`]), because a camera's frames begin at pages: then 0.21 instead of 0.39
//! lines per pixel come into the first-level cache of a Cortex-A76 (12 frames, blocks of 32
//! pixels). That costs instructions on NEON, because the blocks that are decoded later are kept in
//! memory meanwhile.
//!
//! **Accuracy.** ε / r_K turn of the textbook in f64, with ε from the arctangent and the rounding
//! of samples (algo/README.md):
//! `any_shifts_depth_ratios_size_and_stride_decode_as_the_textbook_says`; no wrong fringe order:
//! `no_fringe_order_slips_at_any_wrap_of_a_hundred_fringes`; the same bits on every back-end and on
//! arrival: `every_back_end_and_levels_on_arrival_give_the_same_bits`.

use super::on_arrival::{finest_row_unscaled, level_row};
use super::quality::dark_unless;
use super::temporal::{FinerLevel, GeometricLanes, rows_of_bytes};
use super::{STRETCH, next_block, of_stretch, stretches};
use crate::phase::arrived::{Expected, NO_REASON};
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes};
use crate::phase::samples::BlockSample;
use crate::phase::source::{Frames, Place};
use crate::simd::{Backend, LINE, Lanes, Results, Rows, back_end_entry};
use crate::trust::Trust;
use core::hint::black_box;
use core::ops::Range;

/// Decodes columns of a row from the rows of each level's frames, coarse to fine, in the order of
/// their shifts.
pub(crate) fn decode_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let (part, out) = (columns.clone(), &mut out);
    let kernel = match rows[0].len() {
        3 => of_shifts::<T, 3>,
        4 => of_shifts::<T, 4>,
        5 => of_shifts::<T, 5>,
        6 => of_shifts::<T, 6>,
        7 => of_shifts::<T, 7>,
        8 => of_shifts::<T, 8>,
        _ => of_shifts::<T, 9>,
    };
    if !kernel(backend, plan, levels, rows, &columns, out) {
        let all = |rows| Rows::new(rows, part.end);
        let width = width(rows);
        match *rows {
            [a] => single(backend, plan, levels, all(a), columns, out),
            [a, b] => {
                let frames = (&all(a), [], &all(b));
                one_pass(backend, plan, levels, frames, width, columns, out);
            }
            [a, b, c] => {
                let frames = (&all(a), [&all(b)], &all(c));
                one_pass(backend, plan, levels, frames, width, columns, out);
            }
            _ => level_by_level(backend, plan, levels, rows, columns, out),
        }
    }
    plan.finish(&mut out.phase[part]);
}

/// Up to three levels of N shifts of 8 bits each, by the kernel for N; false for other levels.
fn of_shifts<T: BlockSample, const N: usize>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: &Range<usize>,
    out: &mut Results<'_>,
) -> bool {
    let (columns, width) = (columns.clone(), width(rows));
    match rows_of_bytes::<T, N>(levels, rows)[..] {
        [&a] => single(backend, plan, levels, a, columns, out),
        [a, b] => one_pass(backend, plan, levels, (a, [], b), width, columns, out),
        [a, b, c] => one_pass(backend, plan, levels, (a, [b], c), width, columns, out),
        _ => return false,
    }
    true
}

/// Pixels of a row of the frames.
fn width<T>(rows: &[&[&[T]]]) -> usize {
    rows[0].first().map_or(0, |row| row.len())
}

/// Any number of levels, one after the other, in stretches of columns whose predictions fit on the
/// stack.
fn level_by_level<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let (Some((finest, coarser)), Some((last, rows))) = (levels.split_last(), rows.split_last())
    else {
        return;
    };
    let mut expected = Expected {
        fraction: [0; STRETCH],
        turns: [0; STRETCH],
        reason: [NO_REASON; STRETCH],
    };
    for stretch in stretches(columns) {
        let (columns, mut out) = (0..stretch.len(), out.part(&stretch));
        for (at, (level, rows)) in coarser.iter().zip(rows).enumerate() {
            let (rows, row) = (of_stretch(rows, &stretch), expected.row_mut());
            level_row(backend, plan, at, level, &rows, columns.clone(), row);
        }
        let (rows, before) = (of_stretch(last, &stretch), expected.row());
        finest_row_unscaled(backend, plan, finest, &rows, before, columns, &mut out);
    }
}

back_end_entry! {
    /// One level: its phase is absolute.
    fn single [S: Frames] = single_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: S,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    /// Two or three levels in one pass over the frames of all. The rows are not copied on the way:
    /// a copy in vectors of a list that has just been written in words would wait for the writes.
    fn one_pass [S: Frames, const BETWEEN: usize] = one_pass_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: (&S, [&S; BETWEEN], &S),
        width: usize,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
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
    let lanes = GeometricLanes::new(v, plan);
    let level = LevelLanes::new(v, level);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at, V::AHEAD);
        let (block, modulation) = level.fine(v, &lanes.angle, &folded, S::DOUBLED);
        let unwrapped = lanes.coarsest(v, block.phase, &folded);
        let (clear, before) = (folded.strong, dark_unless(v, folded.strong));
        lanes.store(v, &unwrapped, clear, before, modulation, at, &mut out);
    }
}

#[inline(always)]
fn one_pass_columns<V: Lanes, S: Frames, const BETWEEN: usize>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    (coarsest, between, finest): (&S, [&S; BETWEEN], &S),
    width: usize,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let ([first, middle @ .., last], [steps @ .., step]) = (levels, &plan.steps[..]) else {
        return;
    };
    let lanes = GeometricLanes::new(v, plan);
    let mut out = out.first(columns.end);
    let (coarsest, finest) = (coarsest.first(columns.end), finest.first(columns.end));
    let level = LevelLanes::new(v, first);
    let finest = FinerLevel::new(v, step, last, finest);
    let mut between_levels = [finest; BETWEEN];
    for (finer, ((step, level), frames)) in between_levels
        .iter_mut()
        .zip(steps.iter().zip(middle).zip(between))
    {
        *finer = FinerLevel::new(v, step, level, frames.first(columns.end));
    }
    let pass = OnePass {
        lanes,
        level,
        coarsest,
        between: between_levels,
        finest,
    };
    let mut kept = [S::nothing_kept(v); 3];
    let mut kept = &mut kept;
    if !V::FEW_REGISTERS {
        // Behind a pointer of its own: a pair of registers cannot be stored far from the stack
        // pointer.
        kept = black_box(kept);
    }
    let mut after = V::AHEAD_OF_MANY;
    let mut start = columns.start;
    // Where the next line begins.
    let mut line = start + coarsest.to_line(start);
    let mut ahead = line + after;
    while let Some(at) = next_block::<V>(start, &columns) {
        if S::LINES && start >= line && line + LINE <= columns.end {
            let (mut at, place) = (line, Place::First);
            (line, start) = (line + LINE, line + LINE);
            if pass.block(v, at, ahead, place, kept, &mut out) {
                let mut block = 1;
                while block < LINE / V::PIXELS {
                    at += V::PIXELS;
                    pass.block(v, at, at, Place::Other(block), kept, &mut out);
                    block += 1;
                }
            } else {
                // The other blocks of the line are decoded one by one. The part does not fill the
                // row, and the next row has about the same lit columns: prefetch those from now on.
                start = at + V::PIXELS;
                after = width;
                ahead = at + after;
            }
            ahead += LINE;
            continue;
        }
        start += V::PIXELS;
        if !pass.block(v, at, at + after, Place::Alone, kept, &mut out) {
            after = width;
            ahead = line + after;
        }
    }
}

/// Two or three levels of a row.
struct OnePass<'a, V: Lanes, S: Frames, const BETWEEN: usize> {
    lanes: GeometricLanes<V>,
    /// The coarsest level.
    level: LevelLanes<'a, V>,
    coarsest: S,
    between: [FinerLevel<'a, V, S>; BETWEEN],
    finest: FinerLevel<'a, V, S>,
}

impl<V: Lanes, S: Frames, const BETWEEN: usize> OnePass<'_, V, S, BETWEEN> {
    /// Decodes a block. False if it is dark: then only the coarsest level was read. Where there are
    /// registers enough, the later blocks of a line are not checked for this. The line of the
    /// sample `ahead` is prefetched at finer levels.
    #[inline(always)]
    fn block(
        &self,
        v: V,
        at: usize,
        ahead: usize,
        place: Place,
        [kept_coarsest, kept_between, kept_finest]: &mut [S::Kept<V>; 3],
        out: &mut Results<'_>,
    ) -> bool {
        let (lanes, finest) = (&self.lanes, &self.finest);
        let folded = (self.coarsest).fold_in_line(
            v,
            &self.level,
            at,
            at + V::AHEAD_OF_MANY,
            place,
            kept_coarsest,
        );
        let lit = folded.strong;
        // The line of a lit block is lit nearly everywhere. With few registers the check costs less
        // than a longer stretch without a branch, whose instructions the compiler mixes.
        let asked = V::FEW_REGISTERS || !matches!(place, Place::Other(_));
        if asked && folded.dark {
            out.store_unknown(v, at, v.splat8(Trust::Dark as u8));
            return false;
        }
        let mut unwrapped = lanes.coarsest(v, lanes.rough(v, &folded), &folded);
        // At most one level is between.
        if let Some(finer) = self.between.first() {
            let (before, frames) = (unwrapped.before(v, &finer.step), &finer.frames);
            let folded = frames.fold_in_line(v, &finer.level, at, ahead, place, kept_between);
            unwrapped = finer.rough(v, lanes, &before, &folded);
        }
        let before = unwrapped.before(v, &finest.step);
        let folded = (finest.frames).fold_in_line(v, &finest.level, at, ahead, place, kept_finest);
        let (unwrapped, modulation) = finest.fine(v, lanes, &before, &folded);
        // What is strong at every level is lit.
        let (clear, before) = (unwrapped.quality.strong, dark_unless(v, lit));
        lanes.store(v, &unwrapped, clear, before, modulation, at, out);
        true
    }
}
