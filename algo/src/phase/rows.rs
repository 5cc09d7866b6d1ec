//! Decoding row by row: each level on arrival, then the finest.
//!
//! Chooses the sample type, gathers the rows of the frames, widens columns that are fewer than a
//! block, and calls the kernel of the sequence's form.

use super::arrived::{Arrived, ArrivedRow, WrappedRow};
use super::decode::Unwrapper;
use super::kernel::{about, geometric};
use super::samples::BlockSample;
use super::{Decoder, PhaseRow};
use crate::frame::{FrameView, Samples};
use crate::pattern::{MAX_LEVELS, MAX_SHIFTS};
use crate::simd::{MAX_PIXELS, Results};
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
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
    /// not read it. Where edges of light are refused, the columns on either side are decoded, too.
    pub fn row(
        &self,
        arrived: &Arrived,
        last: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let decoded = match &self.light_edges {
            // They are looked for with the neighbours of each pixel.
            Some(_) if !columns.is_empty() => {
                columns.start.saturating_sub(1)..out.phase.len().min(columns.end + 1)
            }
            _ => columns.clone(),
        };
        let row = arrived.row(v);
        let PhaseRow {
            phase,
            modulation,
            trust,
        } = out;
        let out = PhaseRow {
            phase: &mut *phase,
            modulation: &mut *modulation,
            trust: &mut *trust,
        };
        if self.bit_depth == 8 {
            self.typed_row::<u8>(row, last, v, map, decoded, out);
        } else {
            self.typed_row::<u16>(row, last, v, map, decoded, out);
        }
        let out = PhaseRow {
            phase,
            modulation,
            trust,
        };
        self.refuse_light_edges(out, columns);
    }

    /// Refuses decoded columns of a row, if edges of light are refused.
    pub(crate) fn refuse_light_edges(&self, row: PhaseRow<'_>, columns: Range<usize>) {
        if let Some(edges) = &self.light_edges {
            edges.refuse(row.phase, row.modulation, row.trust, columns);
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
            (Unwrapper::Geometric(plan), ArrivedRow::Predicted(out)) => {
                geometric::level_row(backend, plan, at, level, rows, columns, out);
            }
            (_, ArrivedRow::Wrapped { mut levels, pixels }) => {
                if let Some((coarsest, out)) = levels.level(at, pixels) {
                    about::demodulate_row(backend, level, rows, coarsest, columns, out);
                }
            }
            // `Decoder::arrived` makes the layout that fits the unwrapper.
            (Unwrapper::About(_), ArrivedRow::Predicted(_)) => {}
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
        let mut saturated = false;
        let out = Results::new(
            out.phase,
            out.modulation,
            out.trust,
            &mut saturated,
            columns.end,
        );
        let arrived_columns = start..start + columns.end;
        match (&self.unwrapper, arrived, levels) {
            (Unwrapper::Geometric(plan), _, [level]) => {
                geometric::single_row(backend, plan, level, rows, columns, out);
            }
            (Unwrapper::Geometric(plan), ArrivedRow::Predicted(before), [.., level]) => {
                let before = before.part(arrived_columns);
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
                let before =
                    (0..coarser.len()).map(|at| of_level(at).part(arrived_columns.clone()));
                let before: heapless::Vec<WrappedRow<'_>, MAX_LEVELS> = before.collect();
                about::finest_row(backend, plan, level, &before, rows, map, columns, out);
            }
            // A decoder has levels, and `Decoder::arrived` makes the layout that fits the
            // unwrapper.
            _ => {}
        }
    }
}

/// The rows of a level's frames.
type LevelRows<'a, T> = heapless::Vec<&'a [T], MAX_SHIFTS>;

/// Pixels of a row.
fn width<T>(rows: &[&[T]]) -> usize {
    rows.first().map_or(0, |row| row.len())
}

/// A sample type whose rows can be taken out of a frame.
pub(super) trait RowSample: BlockSample + Default {
    /// Row `v` of a frame; empty if its samples are of the other type.
    fn row(frame: FrameView<'_>, v: usize) -> &[Self];
}

impl RowSample for u8 {
    fn row(frame: FrameView<'_>, v: usize) -> &[Self] {
        match frame.row(v) {
            Samples::Eight(row) => row,
            Samples::Sixteen(_) => &[],
        }
    }
}

impl RowSample for u16 {
    fn row(frame: FrameView<'_>, v: usize) -> &[Self] {
        match frame.row(v) {
            Samples::Sixteen(row) => row,
            Samples::Eight(_) => &[],
        }
    }
}

/// A block of columns around fewer columns; the whole row if it is narrower than a block.
pub(super) fn near(columns: &Range<usize>, width: usize) -> Range<usize> {
    let start = columns.start.min(width.saturating_sub(MAX_PIXELS));
    start..(start + MAX_PIXELS).min(width)
}

/// Padded copies of the rows if these are narrower than a block; else none.
pub(super) fn padded_rows<T: RowSample>(
    rows: &[&[T]],
    near: &Range<usize>,
) -> Vec<[T; MAX_PIXELS]> {
    let narrow = rows.iter().filter(|_| near.len() < MAX_PIXELS);
    let padded = |row: &&[T]| {
        let mut padded = [T::default(); MAX_PIXELS];
        padded[..near.len()].copy_from_slice(&row[near.clone()]);
        padded
    };
    narrow.map(padded).collect()
}

/// The columns `near` of the rows, or their padded copies.
pub(super) fn near_rows<'a, T>(
    rows: &[&'a [T]],
    padded: &'a [[T; MAX_PIXELS]],
    near: &Range<usize>,
) -> impl Iterator<Item = &'a [T]> {
    rows.iter()
        .enumerate()
        .map(|(at, row)| match padded.get(at) {
            Some(padded) => &padded[..],
            None => &row[near.clone()],
        })
}

/// The known map at the columns `near`, padded to a block.
pub(super) fn near_known(
    map: &[AbsolutePhase],
    columns: &Range<usize>,
) -> [AbsolutePhase; MAX_PIXELS] {
    let mut known = [AbsolutePhase::UNKNOWN; MAX_PIXELS];
    if let Some(map) = map.get(columns.clone()) {
        known[..map.len()].copy_from_slice(map);
    }
    known
}

/// Results of a block, to be copied to the columns that were asked for.
pub(super) struct ResultColumns {
    phase: [AbsolutePhase; MAX_PIXELS],
    modulation: [Modulation; MAX_PIXELS],
    trust: [Trust; MAX_PIXELS],
}

impl ResultColumns {
    pub fn new() -> Self {
        Self {
            phase: [AbsolutePhase::UNKNOWN; MAX_PIXELS],
            modulation: [Modulation::default(); MAX_PIXELS],
            trust: [Trust::default(); MAX_PIXELS],
        }
    }

    /// To be written by a kernel.
    pub fn row(&mut self) -> PhaseRow<'_> {
        PhaseRow {
            phase: &mut self.phase,
            modulation: &mut self.modulation,
            trust: &mut self.trust,
        }
    }

    /// Copies `columns` to a row; the first pixel of the block is column `start`.
    pub fn copy_to(&self, out: PhaseRow<'_>, columns: Range<usize>, start: usize) {
        let few = columns.start - start..columns.end - start;
        out.phase[columns.clone()].copy_from_slice(&self.phase[few.clone()]);
        out.modulation[columns.clone()].copy_from_slice(&self.modulation[few.clone()]);
        out.trust[columns].copy_from_slice(&self.trust[few]);
    }
}
