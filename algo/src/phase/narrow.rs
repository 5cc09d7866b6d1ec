//! Fewer columns than a block: a block around them, of rows that are narrower a copy that is wide enough.

use super::PhaseRow;
use super::arrived::{ClimbedRow, ClimbedRowMut, NO_DOUBT, WrappedRow, WrappedRowMut};
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

/// `N` columns of what geometric levels have come to.
pub(super) struct FewClimbed<const N: usize> {
    pub fraction: [u16; N],
    pub turns: [u16; N],
    pub doubt: [u8; N],
}

impl<const N: usize> FewClimbed<N> {
    pub fn new() -> Self {
        Self {
            fraction: [0; N],
            turns: [0; N],
            doubt: [NO_DOUBT; N],
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

impl FewClimbed<MAX_PIXELS> {
    /// Padded columns of a row.
    pub fn padded(row: ClimbedRow<'_>, columns: &Range<usize>) -> Self {
        Self {
            fraction: padded(row.fraction, columns),
            turns: padded(row.turns, columns),
            doubt: padded(row.doubt, columns),
        }
    }
}

/// `N` columns of a level about a known map.
#[derive(Clone, Copy)]
pub(super) struct FewWrapped<const N: usize> {
    pub phase: [u16; N],
    pub doubts: [u8; N],
}

impl<const N: usize> FewWrapped<N> {
    pub fn new() -> Self {
        Self {
            phase: [0; N],
            doubts: [0; N],
        }
    }

    pub fn row(&self) -> WrappedRow<'_> {
        WrappedRow {
            phase: &self.phase,
            doubts: &self.doubts,
        }
    }

    pub fn row_mut(&mut self) -> WrappedRowMut<'_> {
        WrappedRowMut {
            phase: &mut self.phase,
            doubts: &mut self.doubts,
        }
    }
}

impl FewWrapped<MAX_PIXELS> {
    /// Padded columns of a row.
    pub fn padded(row: WrappedRow<'_>, columns: &Range<usize>) -> Self {
        Self {
            phase: padded(row.phase, columns),
            doubts: padded(row.doubts, columns),
        }
    }
}
