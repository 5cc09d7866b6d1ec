//! Fewer columns than a block: a block around them, of rows that are narrower a copy that is wide enough.

use super::PhaseRow;
use super::arrived::{ClimbedRow, ClimbedRowMut, WrappedRow, WrappedRowMut};
use super::fold::BlockSample;
use crate::frame::{FrameView, Samples};
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use core::ops::Range;

/// At least the pixels of any back-end's block.
pub(super) const MAX_PIXELS: usize = 64;

/// A sample by which a frame's rows can be asked for.
pub(super) trait RowSample: BlockSample + Default {
    /// Row `v` of a frame; empty if it is of the other kind of samples.
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

/// Columns of a row, followed by what is dark, up to a block.
pub(super) fn padded<T: Copy + Default>(row: &[T], columns: &Range<usize>) -> [T; MAX_PIXELS] {
    let mut padded = [T::default(); MAX_PIXELS];
    padded[..columns.len()].copy_from_slice(&row[columns.clone()]);
    padded
}

/// A padded row of results, and the place that they belong to.
pub(super) struct FewResults {
    phase: [AbsolutePhase; MAX_PIXELS],
    modulation: [Modulation; MAX_PIXELS],
    trust: [Trust; MAX_PIXELS],
}

impl FewResults {
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

    /// To the columns that they were computed for; the first pixel is that of column `start`.
    pub fn copy_to(&self, out: PhaseRow<'_>, columns: Range<usize>, start: usize) {
        let few = columns.start - start..columns.end - start;
        out.phase[columns.clone()].copy_from_slice(&self.phase[few.clone()]);
        out.modulation[columns.clone()].copy_from_slice(&self.modulation[few.clone()]);
        out.trust[columns].copy_from_slice(&self.trust[few]);
    }
}

/// A padded row of what geometric levels have come to.
pub(super) struct FewClimbed {
    pub fraction: [u16; MAX_PIXELS],
    pub turns: [u16; MAX_PIXELS],
    pub doubt: [u8; MAX_PIXELS],
}

impl FewClimbed {
    pub fn new(row: ClimbedRow<'_>, columns: &Range<usize>) -> Self {
        Self {
            fraction: padded(row.fraction, columns),
            turns: padded(row.turns, columns),
            doubt: padded(row.doubt, columns),
        }
    }

    pub fn row(&self) -> ClimbedRow<'_> {
        ClimbedRow {
            fraction: &self.fraction,
            turns: &self.turns,
            doubt: &self.doubt,
        }
    }

    pub fn row_mut(&mut self) -> ClimbedRowMut<'_> {
        ClimbedRowMut {
            fraction: &mut self.fraction,
            turns: &mut self.turns,
            doubt: &mut self.doubt,
        }
    }
}

/// A padded row of a level about a known map.
pub(super) struct FewWrapped {
    pub phase: [u16; MAX_PIXELS],
    pub modulation: [u16; MAX_PIXELS],
    pub doubts: [u8; MAX_PIXELS],
}

impl Default for FewWrapped {
    fn default() -> Self {
        Self {
            phase: [0; MAX_PIXELS],
            modulation: [0; MAX_PIXELS],
            doubts: [0; MAX_PIXELS],
        }
    }
}

impl FewWrapped {
    pub fn new(row: WrappedRow<'_>, columns: &Range<usize>) -> Self {
        Self {
            phase: padded(row.phase, columns),
            modulation: padded(row.modulation, columns),
            doubts: padded(row.doubts, columns),
        }
    }

    pub fn row(&self) -> WrappedRow<'_> {
        WrappedRow {
            phase: &self.phase,
            modulation: &self.modulation,
            doubts: &self.doubts,
        }
    }

    pub fn row_mut(&mut self) -> WrappedRowMut<'_> {
        WrappedRowMut {
            phase: &mut self.phase,
            modulation: &mut self.modulation,
            doubts: &mut self.doubts,
        }
    }
}
