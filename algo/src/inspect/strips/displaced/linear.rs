//! The displacements of a block of pixels, linear in column and height.
//!
//! # Equations
//! In column i of a block and at height z, du = a + b i + c z; dv and dz likewise. a and b follow from the nodes left and right of the
//! block; c, which differs by about 1 % from node to node, is that of the block's middle.
//!
//! # Accuracy
//! c is off by at most a quarter of that difference: below 0.001 pixels for a turn by half a degree and heights within 5 mm of the
//! middle one, less than between nodes ([`SPACING`]).

use super::BLOCK;
use crate::inspect::strips::pose::{Node, SPACING, VALUES};
use crate::math::nearest::{nearest, whole};

/// Larger displacements, pixels, are taken as not known.
const MAX_AWAY: f32 = 4096.0;

/// du, dv (pixels, less those of `whole`) and dz (nm) of the pixels of a block.
#[derive(Clone, Copy, Default)]
pub(super) struct Linear {
    /// Of the first pixel at height 0.
    first: [f32; VALUES],
    /// Change per column.
    step: [f32; VALUES],
    /// Change per nm of height.
    slope: [f32; VALUES],
    /// Whole pixels of du and dv in the middle of the block, rounded down.
    whole: [f32; 2],
    /// −1 where du and dv of the middle are nearer to `whole` than to one pixel more, else 0: pixels with another whole
    /// displacement mostly lie between this and two more.
    pub lower: [i32; 2],
}

impl Linear {
    /// Of the block of column `u` in a row of `width` pixels. `middle` is the height that the nodes' values hold at, mm.
    #[inline(always)]
    pub fn of_block(u: usize, nodes: &[Node], width: usize, middle: f32) -> Self {
        let (node, u) = (u / SPACING, u / BLOCK * BLOCK);
        let left = node * SPACING;
        let unit = 1.0 / ((left + SPACING).min(width - 1) - left).max(1) as f32;
        let (from, to) = (nodes[node], nodes[(node + 1).min(nodes.len() - 1)]);
        let first = (u - left) as f32 * unit;
        let centre = first + (BLOCK / 2) as f32 * unit;
        let mut linear = Self::default();
        for i in 0..VALUES {
            let way = to[i] - from[i];
            let slope = from[VALUES + i] + (to[VALUES + i] - from[VALUES + i]) * centre;
            let mut value = from[i];
            if i < 2 {
                let pixels = value + way * centre;
                linear.whole[i] = floor(pixels);
                linear.lower[i] = -i32::from(pixels - linear.whole[i] < 0.5);
                value -= linear.whole[i];
            }
            linear.first[i] = (value + way * first) - slope * middle;
            linear.step[i] = way * unit;
            linear.slope[i] = slope * 1e-6;
        }
        // From mm to nm.
        linear.first[2] *= 1e6;
        linear.step[2] *= 1e6;
        linear.slope[2] *= 1e6;
        linear
    }

    /// Of pixel `i` at height `z`, nm.
    #[inline(always)]
    pub fn at(&self, i: usize, z: i32) -> [f32; VALUES] {
        let Self {
            first, step, slope, ..
        } = self;
        let (column, z) = (i as i32 as f32, z as f32);
        [
            (first[0] + step[0] * column) + slope[0] * z,
            (first[1] + step[1] * column) + slope[1] * z,
            (first[2] + step[2] * column) + slope[2] * z,
        ]
    }

    /// The whole displacement of the block, along and down; none if it is not known.
    #[inline(always)]
    pub fn whole(&self) -> Option<[i32; 2]> {
        let [along, down] = self.whole;
        (is_near(along) & is_near(down)).then(|| [whole(along), whole(down)])
    }
}

/// Whether a displacement is known; NaN is not.
#[inline(always)]
pub(super) fn is_near(pixels: f32) -> bool {
    (pixels > -MAX_AWAY) & (pixels < MAX_AWAY)
}

/// Rounded down; of displacements.
#[inline(always)]
pub(super) fn floor(pixels: f32) -> f32 {
    let nearest = nearest(pixels);
    if nearest > pixels {
        nearest - 1.0
    } else {
        nearest
    }
}
