//! Decoding fewer columns than a block: a block of the row around them, or a padded copy of rows
//! that are narrower than a block.

use super::PhaseRow;
use super::samples::BlockSample;
use crate::frame::{FrameView, Samples};
use crate::simd::MAX_PIXELS;
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec::Vec;
use core::ops::Range;

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
