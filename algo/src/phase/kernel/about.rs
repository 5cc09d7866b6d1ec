//! Levels about a known map: dense ones or a single one, at once or on arrival → absolute phase.
//!
//! **Idea and equation**: [`crate::phase::about`]. Per block:
//!
//! ```text
//! load Φ₀; if none of it is known: store "unexpected", next block
//! demodulate the coarsest level; if all of it is dark: store "dark", next block
//! demodulate the others, all in fine quality, because all carry the result's accuracy
//! unwrap about Φ₀; store Φ, B of the finest level, and the first reason against each pixel
//! ```
//!
//! **Shapes and units.** `rows[level][shift][u]` in counts, coarse to fine; `map` is Φ₀ of the row
//! in 1/65536 turn; results as in [`super::geometric`]. A level that was demodulated on arrival is
//! a [`WrappedRow`].
//!
//! **Departures from the plain form.** One body, [`dense_columns`], serves levels from frames and
//! levels from maps ([`Source`]). It is compiled for 3 and for 4 shifts of 8 bits, and for two
//! levels of 7 and 5; any others branch to the form of their number in every block.
//!
//! **Accuracy.** As [`crate::phase::about`]; on arrival the same bits
//! (`every_back_end_and_levels_on_arrival_give_the_same_bits`).

use super::known::{KnownBlock, store};
use super::next_block;
use super::quality::Quality;
use super::temporal::{of_bytes, rows_of_bytes};
use crate::phase::about::{About, AboutLanes, BlockLevels};
use crate::phase::angle::AngleLanes;
use crate::phase::arrived::{WrappedRow, WrappedRowMut};
use crate::phase::level::{Demodulated, Level, LevelLanes};
use crate::phase::samples::BlockSample;
use crate::phase::source::{Frames, Source};
use crate::simd::{Backend, Lanes, Results, Rows, back_end_entry, plain};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// Decodes columns of a row about a row of the known map, from the rows of each level's frames,
/// coarse to fine, in the order of their shifts.
pub(crate) fn decode_row<T: BlockSample>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    rows: &[&[&[T]]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let kernels = [of_shifts::<T, 4>, of_shifts::<T, 3>];
    let mut kernels = kernels.iter();
    if kernels.any(|kernel| kernel(backend, plan, levels, rows, map, &columns, &mut out)) {
        return;
    }
    if let ([coarse, fine], [a, b]) = (levels, rows)
        && let (Some(&a), Some(&b)) = (of_bytes::<T, 7>(coarse, a), of_bytes::<T, 5>(fine, b))
    {
        return dense(backend, plan, levels, [a], b, map, columns, &mut out);
    }
    let end = columns.end;
    let all = |rows| Rows::new(rows, end);
    match *rows {
        [a] => single(backend, plan, levels, all(a), map, columns, &mut out),
        [a, b] => dense(
            backend,
            plan,
            levels,
            [all(a)],
            all(b),
            map,
            columns,
            &mut out,
        ),
        [a, b, c] => {
            let others = [all(a), all(b)];
            dense(
                backend,
                plan,
                levels,
                others,
                all(c),
                map,
                columns,
                &mut out,
            );
        }
        // There are at most three dense levels.
        _ => {}
    }
}

/// Levels of N shifts of 8 bits each, by the kernel for N; false for other levels.
fn of_shifts<T: BlockSample, const N: usize>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    rows: &[&[&[T]]],
    map: &[AbsolutePhase],
    columns: &Range<usize>,
    out: &mut Results<'_>,
) -> bool {
    let columns = columns.clone();
    match rows_of_bytes::<T, N>(levels, rows)[..] {
        [&a] => single(backend, plan, levels, a, map, columns, out),
        [&a, &b] => dense(backend, plan, levels, [a], b, map, columns, out),
        [&a, &b, &c] => dense(backend, plan, levels, [a, b], c, map, columns, out),
        _ => return false,
    }
    true
}

/// As [`decode_row`], from the levels that have arrived and the frames of the finest.
#[allow(clippy::too_many_arguments)]
pub(crate) fn finest_row<T: BlockSample>(
    backend: Backend,
    plan: &About,
    levels: &[Level],
    before: &[WrappedRow<'_>],
    rows: &[&[T]],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let all = Rows::new(rows, columns.end);
    match *before {
        [] => decode_row(backend, plan, levels, &[rows], map, columns, out),
        [a] => dense(backend, plan, levels, [a], all, map, columns, &mut out),
        [a, b] => match levels
            .last()
            .and_then(|level| of_bytes::<T, 4>(level, rows))
        {
            Some(&frames) => dense(
                backend,
                plan,
                levels,
                [a, b],
                frames,
                map,
                columns,
                &mut out,
            ),
            None => dense(backend, plan, levels, [a, b], all, map, columns, &mut out),
        },
        _ => {}
    }
}

back_end_entry! {
    /// A single level.
    fn single [S: Frames] = single_columns(
        plan: &About,
        levels: &[Level],
        frames: S,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    /// Two or three dense levels: one or two others beside the finest.
    fn dense [S: Source, F: Frames, const OTHERS: usize] = dense_columns(
        plan: &About,
        levels: &[Level],
        others: [S; OTHERS],
        finest: F,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

/// Demodulates columns of a row of one level, except blocks that are all weak at the coarsest
/// level.
pub(crate) fn demodulate_row<T: BlockSample>(
    backend: Backend,
    level: &Level,
    rows: &[&[T]],
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    out: WrappedRowMut<'_>,
) {
    let rows = Rows::new(rows, columns.end);
    demodulate(backend, level, rows, coarsest, columns, out);
}

back_end_entry! {
    fn demodulate [S: Frames] = demodulate_columns(
        level: &Level,
        frames: S,
        coarsest: Option<WrappedRow<'_>>,
        columns: Range<usize>,
        out: WrappedRowMut<'_>,
    )
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &About,
    levels: &[Level],
    frames: S,
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: &mut Results<'_>,
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
        let known = KnownBlock::new(v, map, at);
        if v.all8(known.unknown) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let folded = frames.fold(v, &level, at, V::AHEAD);
        let lit = folded.strong;
        let mut quality = Quality::new(v, known.where_known(v, lit));
        if v.none8(quality.strong) {
            out.store_unknown(v, at, known.first_reason(v, lit, quality.strong));
            continue;
        }
        quality.brightest = folded.brightest;
        let (finest, modulation) = level.fine(v, &angle, &folded, S::DOUBLED);
        let block = BlockLevels {
            coarse: finest,
            middle: finest,
            finest,
        };
        store(
            v, &about, &known, &block, lit, quality, modulation, at, &mut out,
        );
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
    out: &mut Results<'_>,
) {
    let three = OTHERS == 2;
    let about = if three {
        AboutLanes::new::<3>(v, plan)
    } else {
        AboutLanes::new::<2>(v, plan)
    };
    let ([first, .., last], Some(about)) = (levels, about) else {
        return;
    };
    // With two levels there is no middle one; `middle` is then a copy that is not used.
    let (Some(&source), Some(&other), Some(second)) =
        (others.first(), others.last(), levels.get(1))
    else {
        return;
    };
    let coarse = LevelSource::new(v, first, source.first(columns.end));
    let middle = LevelSource::new(v, second, other.first(columns.end));
    let (level, finest) = (LevelLanes::new(v, last), Frames::first(finest, columns.end));
    let mut out = out.first(columns.end);
    let angle = AngleLanes::new(v);
    let map = &plain::phase_bits(map)[..columns.end];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = KnownBlock::new(v, map, at);
        if v.all8(known.unknown) {
            out.store_unknown(v, at, v.splat8(Trust::Unexpected as u8));
            continue;
        }
        let block = coarse.source.block(v, &coarse.level, at);
        let lit = block.strong();
        let mut quality = Quality::new(v, known.where_known(v, lit));
        if v.none8(quality.strong) {
            out.store_unknown(v, at, known.first_reason(v, lit, quality.strong));
            continue;
        }
        let coarse = block.fine(v, &coarse.level, &angle, S::DOUBLED);
        quality.add(v, coarse.strong, coarse.brightest);
        let mut block = BlockLevels {
            coarse,
            middle: coarse,
            finest: coarse,
        };
        if three {
            block.middle = middle.fine(v, &angle, at);
            quality.add(v, block.middle.strong, block.middle.brightest);
        }
        let folded = finest.fold(v, &level, at, V::AHEAD_OF_MANY);
        let modulation;
        (block.finest, modulation) = level.fine(v, &angle, &folded, F::DOUBLED);
        quality.add(v, block.finest.strong, block.finest.brightest);
        store(
            v, &about, &known, &block, lit, quality, modulation, at, &mut out,
        );
    }
}

#[inline(always)]
fn demodulate_columns<V: Lanes, S: Frames>(
    v: V,
    level: &Level,
    frames: S,
    coarsest: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    mut out: WrappedRowMut<'_>,
) {
    let level = LevelSource::new(v, level, frames);
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
        out.store(v, at, &level.fine(v, &angle, at));
    }
}

/// A level and where its blocks come from.
#[derive(Clone, Copy)]
struct LevelSource<'a, V: Lanes, S> {
    level: LevelLanes<'a, V>,
    source: S,
}

impl<'a, V: Lanes, S: Source> LevelSource<'a, V, S> {
    #[inline(always)]
    fn new(v: V, level: &'a Level, source: S) -> Self {
        Self {
            level: LevelLanes::new(v, level),
            source,
        }
    }

    /// The demodulated block at `at`.
    #[inline(always)]
    fn fine(&self, v: V, angle: &AngleLanes<V>, at: usize) -> Demodulated<V> {
        let block = self.source.block(v, &self.level, at);
        block.fine(v, &self.level, angle, S::DOUBLED)
    }
}
