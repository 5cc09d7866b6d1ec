//! Rows that are narrower than a block: copied into one that is wide enough.

use super::block::LevelRow;
use super::fold::BlockSample;
use super::wrapped::WrappedRow;
use crate::frame::{FrameView, Samples};
use alloc::vec;
use alloc::vec::Vec;
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

/// A level of a few columns, followed by dark pixels up to a block.
pub(super) enum PaddedLevel<T> {
    Frames(Vec<[T; MAX_PIXELS]>),
    Wrapped {
        phase: Vec<u16>,
        modulation: Vec<u16>,
        doubts: Vec<u8>,
    },
}

/// Copies `columns` of a level's row.
pub(super) fn padded_level<T: RowSample>(
    row: &LevelRow<'_, T>,
    columns: &Range<usize>,
) -> PaddedLevel<T> {
    match row {
        LevelRow::Frames(rows) => PaddedLevel::Frames(
            rows.iter()
                .map(|row| {
                    let mut padded = [T::default(); MAX_PIXELS];
                    padded[..columns.len()].copy_from_slice(&row[columns.clone()]);
                    padded
                })
                .collect(),
        ),
        LevelRow::Wrapped(row) => PaddedLevel::Wrapped {
            phase: padded(row.phase, columns),
            modulation: padded(row.modulation, columns),
            doubts: padded(row.doubts, columns),
        },
    }
}

fn padded<T: Copy + Default>(row: &[T], columns: &Range<usize>) -> Vec<T> {
    let mut padded = vec![T::default(); MAX_PIXELS];
    padded[..columns.len()].copy_from_slice(&row[columns.clone()]);
    padded
}

impl<T: RowSample> PaddedLevel<T> {
    /// Its rows of samples, if it is made of those.
    pub fn samples(&self) -> impl Iterator<Item = &[T]> {
        let rows: &[[T; MAX_PIXELS]] = match self {
            Self::Frames(rows) => rows,
            Self::Wrapped { .. } => &[],
        };
        rows.iter().map(|row| &row[..])
    }

    /// As the level of a row; `samples` are its rows of samples.
    pub fn row<'a>(&'a self, samples: &'a [&'a [T]]) -> LevelRow<'a, T> {
        match self {
            Self::Frames(_) => LevelRow::Frames(samples),
            Self::Wrapped {
                phase,
                modulation,
                doubts,
            } => LevelRow::Wrapped(WrappedRow {
                phase,
                modulation,
                doubts,
            }),
        }
    }
}
