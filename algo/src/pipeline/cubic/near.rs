//! Which blocks of a frame lie near pixels of a known surface. The other blocks need no cubics.

use super::KnownSurface;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Side of a block in pixels.
const SIDE: usize = 16;

/// Square blocks of pixels, each with whether it or a block near it contains a known pixel.
pub(super) struct Near {
    width: usize,
    columns: usize,
    blocks: Vec<bool>,
}

impl Near {
    /// For a surface: every pixel within `around` pixels of a known one is in a near block.
    pub fn new(surface: &KnownSurface, around: usize) -> Self {
        let width = surface.width.max(1);
        let columns = width.div_ceil(SIDE);
        let height = surface.phase.len() / width;
        let rows = height.div_ceil(SIDE);
        let mut known = vec![false; columns * rows];
        for (v, row) in surface.phase.chunks(width).enumerate() {
            let blocks = known[v / SIDE * columns..].iter_mut();
            for (block, phases) in blocks.zip(row.chunks(SIDE)) {
                *block |= phases.iter().any(|phase| phase.is_known());
            }
        }
        let reach = around.div_ceil(SIDE);
        let beside = |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
        let near = |at: usize| {
            let across = beside(at % columns, columns);
            beside(at / columns, rows)
                .any(|row| known[row * columns..][across.clone()].iter().any(|on| *on))
        };
        Self {
            width,
            columns,
            blocks: (0..known.len()).map(near).collect(),
        }
    }

    /// The columns of each block along row `v`, and whether the block is near.
    pub fn row(&self, v: usize) -> impl Iterator<Item = (Range<usize>, bool)> {
        let blocks = &self.blocks[v / SIDE * self.columns..][..self.columns];
        let starts = (0..self.width).step_by(SIDE);
        starts
            .zip(blocks)
            .map(|(start, near)| (start..(start + SIDE).min(self.width), *near))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{AbsolutePhase, Height};

    #[test]
    fn every_pixel_within_the_distance_of_a_known_one_is_near_and_most_others_are_not() {
        let (width, height, around) = (150, 90, 20);
        let mut surface = KnownSurface {
            width,
            phase: vec![AbsolutePhase::UNKNOWN; width * height],
            height: vec![Height::from_nm(0); width * height],
        };
        let (column, row) = (70_usize, 40_usize);
        surface.phase[row * width + column] = AbsolutePhase::from_turns(1.0);
        let blocks = Near::new(&surface, around);
        let mut far = 0;
        for v in 0..height {
            let mut next = 0;
            for (columns, near) in blocks.row(v) {
                assert_eq!(columns.start, next);
                next = columns.end;
                for u in columns {
                    let close = u.abs_diff(column) <= around && v.abs_diff(row) <= around;
                    assert!(near || !close, "({u}, {v})");
                    far += usize::from(!near);
                }
            }
            assert_eq!(next, width);
        }
        assert!(far > width * height / 3, "{far}");
    }
}
