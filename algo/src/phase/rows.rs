//! Decoding row by row: each level on arrival, then the finest.
//!
//! Chooses the sample type, gathers the rows of the frames, widens columns that are fewer than a
//! block, and calls the kernel of the sequence's form.

use super::arrived::{Arrived, ArrivedRow, WrappedRow};
use super::kernel::{about, geometric};
use super::narrow::{ResultColumns, RowSample, near, near_known, near_rows, padded_rows};
use super::unwrap::Unwrapper;
use super::{Decoder, PhaseRow};
use crate::frame::FrameView;
use crate::pattern::{MAX_LEVELS, MAX_SHIFTS};
use crate::simd::{MAX_PIXELS, Results};
use crate::units::AbsolutePhase;
use core::ops::Range;

impl Decoder {
    /// Room for levels that are decoded on arrival, of frames of this size.
    pub fn arrived(&self, width: usize, height: usize) -> Arrived {
        match (&self.unwrapper, self.levels.len() - 1) {
            (Unwrapper::Geometric(_), 1..) => Arrived::geometric(width, height),
            (_, coarser) => Arrived::about_map(width, height, coarser),
        }
    }

    /// Decodes row `v` of level `level`, whose frames [`Self::check_arrival`] has passed. Blocks
    /// that the coarsest level found dark are skipped.
    pub(crate) fn arrive_row(
        &self,
        level: usize,
        frames: &[FrameView<'_>],
        v: usize,
        row: ArrivedRow<&mut [u16], &mut [u8]>,
    ) {
        if self.bit_depth == 8 {
            self.typed_arrival::<u8>(level, frames, v, row);
        } else {
            self.typed_arrival::<u16>(level, frames, v, row);
        }
    }

    /// Decodes `columns` of row `v` into the same columns of `out`, from the levels that have
    /// arrived, which are all but the finest, and the frames of the finest, which
    /// [`Self::check_last`] has passed.
    ///
    /// `map` is the row of the known map for dense and single-level sequences; other sequences do
    /// not read it.
    pub fn row(
        &self,
        arrived: &Arrived,
        last: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        if self.bit_depth == 8 {
            self.typed_row::<u8>(arrived.row(v), last, v, map, columns, out);
        } else {
            self.typed_row::<u16>(arrived.row(v), last, v, map, columns, out);
        }
    }

    fn typed_arrival<T: RowSample>(
        &self,
        at: usize,
        frames: &[FrameView<'_>],
        v: usize,
        row: ArrivedRow<&mut [u16], &mut [u8]>,
    ) {
        let mut rows = LevelRows::new();
        rows.extend(frames.iter().map(|&frame| T::row(frame, v)));
        let columns = 0..width(&rows);
        if columns.len() >= MAX_PIXELS {
            return self.arrive(at, &rows, row, columns);
        }
        let padded = padded_rows(&rows, &columns);
        let mut around = LevelRows::new();
        around.extend(near_rows(&rows, &padded, &columns));
        self.arrive(at, &around, row, 0..MAX_PIXELS);
    }

    fn arrive<T: RowSample>(
        &self,
        at: usize,
        rows: &[&[T]],
        out: ArrivedRow<&mut [u16], &mut [u8]>,
        columns: Range<usize>,
    ) {
        let (backend, level) = (self.backend, &self.levels[at]);
        match (&self.unwrapper, out) {
            (Unwrapper::Geometric(plan), ArrivedRow::Expected(out)) => {
                geometric::level_row(backend, plan, at, level, rows, columns, out);
            }
            (_, ArrivedRow::Wrapped { mut levels, pixels }) => {
                if let Some((coarsest, out)) = levels.level(at, pixels) {
                    about::demodulate_row(backend, level, rows, coarsest, columns, out);
                }
            }
            // `Decoder::arrived` makes the layout that fits the unwrapper.
            (Unwrapper::About(_), ArrivedRow::Expected(_)) => {}
        }
    }

    fn typed_row<T: RowSample>(
        &self,
        arrived: ArrivedRow<&[u16], &[u8]>,
        frames: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let mut rows = LevelRows::new();
        rows.extend(frames.iter().map(|&frame| T::row(frame, v)));
        if columns.len() >= MAX_PIXELS {
            return self.finest(&rows, (arrived, 0), map, columns, out);
        }
        let near = near(&columns, width(&rows));
        let padded = padded_rows(&rows, &near);
        let mut around = LevelRows::new();
        around.extend(near_rows(&rows, &padded, &near));
        let mut few = ResultColumns::new();
        let map = near_known(map, &near);
        let before = (arrived, near.start);
        self.finest(&around, before, &map, 0..MAX_PIXELS, few.row());
        few.copy_to(out, columns, near.start);
    }

    /// Decodes from the rows of the finest level's frames and what has arrived from column `start`
    /// on.
    fn finest<T: RowSample>(
        &self,
        rows: &[&[T]],
        (arrived, start): (ArrivedRow<&[u16], &[u8]>, usize),
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let (backend, levels) = (self.backend, &self.levels[..]);
        let out = results(out, &columns);
        let there = start..start + columns.end;
        match (&self.unwrapper, arrived, levels) {
            (Unwrapper::Geometric(plan), _, [level]) => {
                geometric::single_row(backend, plan, level, rows, columns, out);
            }
            (Unwrapper::Geometric(plan), ArrivedRow::Expected(before), [.., level]) => {
                let before = before.part(there);
                geometric::finest_row(backend, plan, level, rows, before, columns, out);
            }
            (
                Unwrapper::About(plan),
                ArrivedRow::Wrapped {
                    levels: row,
                    pixels,
                },
                [coarser @ .., level],
            ) => {
                let of_level = |at: usize| row.part(at * pixels..(at + 1) * pixels);
                let before = (0..coarser.len()).map(|at| of_level(at).part(there.clone()));
                let before: heapless::Vec<WrappedRow<'_>, MAX_LEVELS> = before.collect();
                about::finest_row(backend, plan, level, &before, rows, map, columns, out);
            }
            // A decoder has levels, and `Decoder::arrived` makes the layout that fits the
            // unwrapper.
            _ => {}
        }
    }
}

/// Where the kernels write.
fn results<'a>(out: PhaseRow<'a>, columns: &Range<usize>) -> Results<'a> {
    Results::new(out.phase, out.modulation, out.trust, columns.end)
}

/// The rows of a level's frames.
type LevelRows<'a, T> = heapless::Vec<&'a [T], MAX_SHIFTS>;

/// Pixels of a row.
fn width<T>(rows: &[&[T]]) -> usize {
    rows.first().map_or(0, |row| row.len())
}
