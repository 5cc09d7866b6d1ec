//! The displacements of a block of pixels, linear in column and quadratic in height.
//!
//! # Equations
//! In column i of a block and at height z, du = a + b i + c z + e z²; dv and dz likewise. a and b
//! follow from the nodes left and right of the block; c and e, which differ by about 1 % from node
//! to node, are those of the block's middle. From a row of nodes to the next, all are interpolated.
//! A shift is seen by the more pixels the nearer a point is to the camera, so the displacement goes
//! by 1/(distance − z): of a part that reaches 75 mm from its middle height at 600 mm, e makes 1.6
//! % of it, which on a steep wall were tens of micrometres.
//!
//! # Accuracy
//! c is off by at most a quarter of its difference: below 0.001 pixels for a turn by half a degree
//! and heights within 5 mm of the middle one, less than between nodes
//! ([`SPACING`](crate::inspect::strips::pose)). The cubic term, a further eighth of the quadratic
//! one, is left out.

use crate::math::nearest::{nearest, whole};
use crate::simd::{Lanes, back_end_entry};

/// Pixels that are worked on together; the distance of two nodes is a multiple of it.
pub const BLOCK: usize = 32;
/// Values of a displacement: du, dv (pixels), dz (mm).
pub const VALUES: usize = 3;
/// Larger displacements, pixels, are taken as not known.
const MAX_AWAY: f32 = 4096.0;

/// The displacement that a pixel has at the middle height, its change per mm of height, and what of
/// that is quadratic, per mm².
pub type Node = [[f64; VALUES]; 3];

/// The numbers of a block: a, b, c and e of the three values (pixels and nm, heights in nm), du and
/// dv of its middle, and two 0: a multiple of a vector's length.
pub type BlockNumbers = [f32; 16];

/// Where du and dv of a block's middle are in its numbers.
const MIDDLE: usize = 4 * VALUES;

/// The numbers of the block that begins `column` pixels after the first of two nodes, which are
/// `pixels` apart; `middle` is the middle height, mm.
pub fn between([from, to]: [&Node; 2], pixels: usize, column: usize, middle: f64) -> BlockNumbers {
    let unit = 1.0 / pixels.max(1) as f64;
    let first = column as f64 * unit;
    let centre = first + (BLOCK / 2) as f64 * unit;
    let mut numbers = BlockNumbers::default();
    for i in 0..VALUES {
        let at_centre = |of: usize| from[of][i] + (to[of][i] - from[of][i]) * centre;
        let way = to[0][i] - from[0][i];
        let (slope, bend) = (at_centre(1), at_centre(2));
        // Heights count from 0, not from the middle one.
        let start = from[0][i] + way * first - (slope - bend * middle) * middle;
        // dz from mm to nm.
        let scale = if i < 2 { 1.0 } else { 1e6 };
        numbers[i] = (start * scale) as f32;
        numbers[VALUES + i] = (way * unit * scale) as f32;
        numbers[2 * VALUES + i] = ((slope - 2.0 * bend * middle) * 1e-6 * scale) as f32;
        numbers[3 * VALUES + i] = (bend * 1e-12 * scale) as f32;
        if i < 2 {
            numbers[MIDDLE + i] = at_centre(0) as f32;
        }
    }
    numbers
}

back_end_entry! {
    /// Interpolates the numbers of the blocks of a row between two rows of nodes; `share` is the
    /// way from the one above.
    fn interpolate [] = interpolate_row(
        above: &[BlockNumbers],
        below: &[BlockNumbers],
        share: f32,
        row: &mut [BlockNumbers],
    )
}

#[inline(always)]
fn interpolate_row<V: Lanes>(
    _: V,
    above: &[BlockNumbers],
    below: &[BlockNumbers],
    share: f32,
    row: &mut [BlockNumbers],
) {
    let out = row.as_flattened_mut();
    let (above, below) = (
        &above.as_flattened()[..out.len()],
        &below.as_flattened()[..out.len()],
    );
    for i in 0..out.len() {
        out[i] = above[i] + (below[i] - above[i]) * share;
    }
}

/// The whole displacement of a block's middle, along and down: pixels, rounded down.
#[derive(Clone, Copy)]
pub struct Whole([f32; 2]);

impl Whole {
    /// Of these numbers; none if it is not known.
    #[inline(always)]
    pub fn of(numbers: &BlockNumbers) -> Option<Self> {
        let [along, down] = [floor(numbers[MIDDLE]), floor(numbers[MIDDLE + 1])];
        (is_near(along) & is_near(down)).then_some(Self([along, down]))
    }

    /// As whole numbers.
    #[inline(always)]
    pub fn pixels(self) -> [i32; 2] {
        self.0.map(whole)
    }

    /// Whether all pixels of a block have it at the middle height.
    #[inline(always)]
    pub fn fits(self, numbers: &BlockNumbers) -> bool {
        let mut fits = true;
        for i in 0..2 {
            let way = numbers[VALUES + i].abs() * (BLOCK / 2) as f32;
            let middle = numbers[MIDDLE + i] - self.0[i];
            fits &= (middle - way >= 0.0) & (middle + way < 1.0);
        }
        fits
    }
}

/// du, dv (pixels, less whole ones) and dz (nm) of the pixels of a block.
#[derive(Clone, Copy)]
pub struct Linear {
    /// Of the first pixel at height 0.
    first: [f32; VALUES],
    /// Change per column.
    step: [f32; VALUES],
    /// Change per nm of height, and per nm².
    slope: [f32; VALUES],
    bend: [f32; VALUES],
}

impl Linear {
    /// Of these numbers, less a whole displacement.
    #[inline(always)]
    pub fn of(numbers: &BlockNumbers, less: Whole) -> Self {
        let [first, step, slope, bend] = [0, 1, 2, 3].map(|of| {
            let at = of * VALUES;
            [numbers[at], numbers[at + 1], numbers[at + 2]]
        });
        Self {
            first: [first[0] - less.0[0], first[1] - less.0[1], first[2]],
            step,
            slope,
            bend,
        }
    }

    /// Of pixel `i` at height `z`, nm.
    #[inline(always)]
    pub fn at(&self, i: usize, z: i32) -> [f32; VALUES] {
        self.at_height(i, z as f32)
    }

    /// Of pixel `i` at height `z`, nm.
    #[inline(always)]
    pub fn at_height(&self, i: usize, z: f32) -> [f32; VALUES] {
        let Self {
            first,
            step,
            slope,
            bend,
        } = self;
        let column = i as i32 as f32;
        [
            (first[0] + step[0] * column) + (slope[0] + bend[0] * z) * z,
            (first[1] + step[1] * column) + (slope[1] + bend[1] * z) * z,
            (first[2] + step[2] * column) + (slope[2] + bend[2] * z) * z,
        ]
    }
}

/// Whether a displacement is known; NaN is not.
#[inline(always)]
pub fn is_near(pixels: f32) -> bool {
    (pixels > -MAX_AWAY) & (pixels < MAX_AWAY)
}

/// Rounded down; of displacements.
#[inline(always)]
pub fn floor(pixels: f32) -> f32 {
    let nearest = nearest(pixels);
    if nearest > pixels {
        nearest - 1.0
    } else {
        nearest
    }
}
