//! How far the pixels of a row deviate from golden, where the part had what they see when it was taught.
//!
//! Golden's height between four pixels is bilinear. Blocks of pixels that all lie between the same neighbours, or all but, are
//! worked on together: plain loops over slices, compiled for each back-end's instructions, with the bits of one pixel after
//! the other.

use super::pose::{Node, SPACING};
use super::squares::narrow::MAX_TAME;
use crate::math::nearest::{nearest, whole};
use crate::pipeline::{NO_RISE, SQUARE};
use crate::simd::{Lanes, back_end_entry};
use crate::units::Height;
use core::ops::Range;

/// The golden map as rows are compared with it.
#[derive(Clone, Copy)]
pub(super) struct Golden<'a> {
    pub height: &'a [Height],
    /// See [`crate::pipeline::Seen`].
    pub taught: &'a [u16],
    pub width: usize,
}

/// A row to be compared.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub v: usize,
    pub rise: &'a [i32],
    /// Displacements at every [`SPACING`]th column, at and about this height in mm.
    pub nodes: &'a [Node],
    pub middle: f32,
}

/// What a row is written to.
pub(super) struct Found<'a> {
    /// In: where the part is compared. Out: from golden where the part had the spot.
    pub deviation: &'a mut [i32],
    pub column: &'a mut [i32],
    pub row: &'a mut [i32],
    /// Whether a deviation is too large for the sums of [`MAX_TAME`].
    pub wild: &'a mut bool,
}

/// Pixels that are worked on together; so many lie between two nodes several times.
const BLOCK: usize = 32;
/// No displacement reaches so many pixels: others are none.
const MAX_AWAY: f32 = 4096.0;

back_end_entry! {
    /// The spots and deviations of columns of a row.
    fn find_row [] = find_columns(
        golden: Golden<'_>,
        row: Row<'_>,
        columns: Range<usize>,
        found: Found<'_>,
    )
}

/// A block of pixels where the part had them. Masks are 0 or −1.
struct Block {
    /// Mask: there is a height, and the displacement is one.
    known: [i32; BLOCK],
    /// The height, nm, and what it gains by taking back the motion.
    z: [i32; BLOCK],
    gain: [f32; BLOCK],
    /// Displacement along the row and down: whole pixels, and what is left.
    along: Displaced,
    down: Displaced,
}

/// Displacements of a block.
struct Displaced {
    /// To the nearest pixel.
    nearest: [i32; BLOCK],
    /// To the next one before.
    whole: [i32; BLOCK],
    /// And from there.
    share: [f32; BLOCK],
}

impl Displaced {
    const NONE: Self = Self {
        nearest: [0; BLOCK],
        whole: [0; BLOCK],
        share: [0.0; BLOCK],
    };

    /// Splits displacements, which are kept as shares so far.
    #[inline(always)]
    fn split(&mut self) {
        for i in 0..BLOCK {
            let pixels = self.share[i];
            let nearest = nearest(pixels);
            let below = if nearest > pixels {
                nearest - 1.0
            } else {
                nearest
            };
            self.nearest[i] = whole(nearest);
            self.whole[i] = whole(below);
            self.share[i] = pixels - below;
        }
    }

    /// The least and the largest whole displacement of the known pixels.
    #[inline(always)]
    fn range(&self, known: &[i32; BLOCK]) -> (i32, i32) {
        let (mut least, mut most) = (i32::MAX, i32::MIN);
        for (&whole, &known) in self.whole.iter().zip(known) {
            let low = (whole & known) | (i32::MAX & !known);
            let high = (whole & known) | (i32::MIN & !known);
            least = if low < least { low } else { least };
            most = if high > most { high } else { most };
        }
        (least, most)
    }
}

impl Block {
    const EMPTY: Self = Self {
        known: [0; BLOCK],
        z: [0; BLOCK],
        gain: [0.0; BLOCK],
        along: Displaced::NONE,
        down: Displaced::NONE,
    };

    /// Takes the motion back in a block between two nodes; `offset` is the column of its first pixel from the first node,
    /// `unit` a pixel as a share of the way between them.
    #[inline(always)]
    fn take_back(
        &mut self,
        (from, to): (Node, Node),
        (offset, unit): (i32, f32),
        middle: f32,
        (bases, rises): (&[Height], &[i32]),
    ) {
        let length = rises.len();
        let bases = &bases[..length];
        let (known, z, gain) = (
            &mut self.known[..length],
            &mut self.z[..length],
            &mut self.gain[..length],
        );
        let (along, down) = (
            &mut self.along.share[..length],
            &mut self.down.share[..length],
        );
        for i in 0..length {
            let base = if bases[i].is_known() {
                bases[i].nm()
            } else {
                0
            };
            z[i] = base.wrapping_add(rises[i]);
            let share = offset.wrapping_add(i as i32) as f32 * unit;
            let above = z[i] as f32 * 1e-6 - middle;
            let du = at(&from, &to, 0, share, above);
            let dv = at(&from, &to, 1, share, above);
            let near = (rises[i] != NO_RISE) & is_near(du) & is_near(dv);
            known[i] = -i32::from(near);
            along[i] = if near { du } else { 0.0 };
            down[i] = if near { dv } else { 0.0 };
            gain[i] = at(&from, &to, 2, share, above) * 1e6;
        }
        for known in &mut self.known[length..] {
            *known = 0;
        }
        self.along.split();
        self.down.split();
    }
}

#[inline(always)]
fn find_columns<V: Lanes>(
    v: V,
    golden: Golden<'_>,
    row: Row<'_>,
    columns: Range<usize>,
    found: Found<'_>,
) {
    let width = golden.width;
    let bases = &golden.height[row.v * width..(row.v + 1) * width];
    let last = row.nodes.len() - 1;
    let mut block = Block::EMPTY;
    let mut wild = false;
    let mut start = columns.start;
    while start < columns.end {
        let node = start / SPACING;
        let left = node * SPACING;
        let end = ((start / BLOCK + 1) * BLOCK).min(columns.end);
        let length = end - start;
        v.fetch(bases, start, bases.len());
        let nodes = (row.nodes[node], row.nodes[(node + 1).min(last)]);
        let unit = 1.0 / ((left + SPACING).min(width - 1) - left).max(1) as f32;
        let seen = (&bases[start..end], &row.rise[start..end]);
        block.take_back(nodes, ((start - left) as i32, unit), row.middle, seen);
        let (column, line) = (&mut found.column[start..end], &mut found.row[start..end]);
        for i in 0..length {
            column[i] = ((start + i) as i32).wrapping_add(block.along.nearest[i]);
            line[i] = (row.v as i32).wrapping_add(block.down.nearest[i]);
        }
        let (left_most, right_most) = block.along.range(&block.known);
        let (top_most, bottom_most) = block.down.range(&block.known);
        let deviations = &mut found.deviation[start..end];
        if left_most <= right_most {
            let column = start as i32 + left_most;
            let top = row.v as i32 + top_most;
            // Three neighbours each way have room.
            let inside = column >= 0
                && top >= 0
                && column as usize + length + 2 <= width
                && (top as usize + 3) * width <= golden.height.len();
            let spread = (right_most - left_most) | (bottom_most - top_most);
            let place = (top as usize)
                .wrapping_mul(width)
                .wrapping_add(column as usize);
            let tame = if inside && spread == 0 {
                same(golden, &block, place, deviations)
            } else if inside && spread == 1 {
                next(golden, &block, (left_most, top_most), place, deviations)
            } else {
                false
            };
            if !tame {
                wild |= each(golden, &block, (start, row.v), deviations);
            }
        }
        start = end;
    }
    *found.wild = wild;
}

/// Pixels that lie between the same neighbours, the first at `place`. The answer is whether all deviations are small.
#[inline(always)]
fn same(golden: Golden<'_>, block: &Block, place: usize, out: &mut [i32]) -> bool {
    let (length, width) = (out.len(), golden.width);
    let upper = &golden.height[place..][..length + 1];
    let lower = &golden.height[place + width..][..length + 1];
    let taught = &golden.taught[place..][..length];
    let mut wild = 0;
    for i in 0..length {
        let corners = [
            upper[i].nm(),
            upper[i + 1].nm(),
            lower[i].nm(),
            lower[i + 1].nm(),
        ];
        let known = (block.known[i] != 0) & (taught[i] & SQUARE != 0);
        let nm = deviation(block, i, corners);
        out[i] = if known { whole(nm) } else { NO_RISE };
        wild |= i32::from(known & !is_tame(nm));
    }
    wild == 0
}

/// Pixels of which some lie a neighbour further along or down than others; the least displacements lead to `place`. The answer
/// is whether all deviations are small.
#[inline(always)]
fn next(
    golden: Golden<'_>,
    block: &Block,
    (left_most, top_most): (i32, i32),
    place: usize,
    out: &mut [i32],
) -> bool {
    let (length, width) = (out.len(), golden.width);
    let first = &golden.height[place..][..length + 2];
    let second = &golden.height[place + width..][..length + 2];
    let third = &golden.height[place + 2 * width..][..length + 2];
    let upper = &golden.taught[place..][..length + 1];
    let lower = &golden.taught[place + width..][..length + 1];
    let mut wild = 0;
    for i in 0..length {
        let right = block.along.whole[i] > left_most;
        let under = block.down.whole[i] > top_most;
        let near = [
            pick(right, first, i),
            pick(right, second, i),
            pick(right, third, i),
        ];
        let far = [
            pick(right, first, i + 1),
            pick(right, second, i + 1),
            pick(right, third, i + 1),
        ];
        let corners = [
            if under { near[1] } else { near[0] },
            if under { far[1] } else { far[0] },
            if under { near[2] } else { near[1] },
            if under { far[2] } else { far[1] },
        ];
        let upper = if right { upper[i + 1] } else { upper[i] };
        let lower = if right { lower[i + 1] } else { lower[i] };
        let taught = if under { lower } else { upper };
        let known = (block.known[i] != 0) & (taught & SQUARE != 0);
        let nm = deviation(block, i, corners);
        out[i] = if known { whole(nm) } else { NO_RISE };
        wild |= i32::from(known & !is_tame(nm));
    }
    wild == 0
}

/// The height at a place of a row, or the next one.
#[inline(always)]
fn pick(next: bool, row: &[Height], at: usize) -> i32 {
    if next { row[at + 1].nm() } else { row[at].nm() }
}

/// Pixels that lie anywhere; `first` is the column and row of the first of the block. The answer is whether some deviation is
/// large.
#[inline(always)]
fn each(golden: Golden<'_>, block: &Block, first: (usize, usize), out: &mut [i32]) -> bool {
    let width = golden.width;
    let mut wild = false;
    for (i, out) in out.iter_mut().enumerate() {
        if block.known[i] == 0 {
            *out = NO_RISE;
            continue;
        }
        let column = (first.0 + i) as i32 + block.along.whole[i];
        let row = first.1 as i32 + block.down.whole[i];
        let place = (row as usize)
            .wrapping_mul(width)
            .wrapping_add(column as usize);
        let rows = golden.height.len() / width;
        let inside = column >= 0 && row >= 0 && column + 1 < width as i32 && row + 1 < rows as i32;
        if !inside || golden.taught[place] & SQUARE == 0 {
            *out = NO_RISE;
            continue;
        }
        let (upper, lower) = (&golden.height[place..], &golden.height[place + width..]);
        let corners = [upper[0].nm(), upper[1].nm(), lower[0].nm(), lower[1].nm()];
        let nm = deviation(block, i, corners);
        wild |= !is_tame(nm);
        *out = match is_tame(nm) {
            true => whole(nm),
            // One above the value for "unknown".
            false => (nm as i32).max(NO_RISE + 1),
        };
    }
    wild
}

/// How far pixel `i` of a block lies above golden, nm; the corners are left and right, above and below.
#[inline(always)]
fn deviation(block: &Block, i: usize, corners: [i32; 4]) -> f32 {
    let [first, right, under, both] = corners;
    let right = right.wrapping_sub(first) as f32;
    let under = under.wrapping_sub(first) as f32;
    let both = both.wrapping_sub(first) as f32;
    let (along, down) = (block.along.share[i], block.down.share[i]);
    let golden = along * right + down * (under + along * (both - under - right));
    let above = block.z[i].wrapping_sub(first) as f32;
    (above + block.gain[i]) - golden
}

/// Whether a deviation in nm is small enough for the sums of [`MAX_TAME`].
#[inline(always)]
fn is_tame(nm: f32) -> bool {
    (nm > -(MAX_TAME as f32)) & (nm < MAX_TAME as f32)
}

/// A value of the nodes around a pixel.
#[inline(always)]
fn at(from: &Node, to: &Node, value: usize, share: f32, above: f32) -> f32 {
    mix(from.value[value], to.value[value], share)
        + mix(from.slope[value], to.slope[value], share) * above
}

#[inline(always)]
fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

/// Whether a displacement is one; not a number is none.
#[inline(always)]
fn is_near(pixels: f32) -> bool {
    (pixels > -MAX_AWAY) & (pixels < MAX_AWAY)
}

#[cfg(test)]
mod tests;
