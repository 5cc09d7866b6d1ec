//! Stage 3, align: taught coordinates of a displaced row and its deviations from golden there.
//!
//! # Idea
//! The pose field gives the displacement of each pixel; inside a block it is taken as linear in column and height (`linear`). Golden's
//! height between four pixels is bilinear. The pixels of a block mostly have the whole displacement of its middle (`same`), or some
//! of them one pixel more or less (`next`); then golden is read along rows, many pixels at a time, and each pixel is checked to
//! have it. All other blocks go pixel by pixel (`each`). Plain loops over slices, compiled for each back-end's instructions.
//!
//! # Equations
//! With the displacement (du, dv, dz) at height z, a pixel's deviation is (z + dz) − G(u + du, v + dv), G golden's height.
//!
//! # Accuracy
//! The three ways have the same bits (`blocks_have_the_bits_of_one_pixel_after_the_other`); the deviation is within 50 nm of one of
//! whole maps (`strips_weigh_deviations_as_the_comparison_of_whole_maps_does`).

mod linear;

use super::squares::narrow::MAX_NARROW_NM;
use crate::math::nearest::whole;
use crate::pipeline::{NO_OFFSET, SQUARE};
use crate::simd::{Lanes, back_end_entry};
use crate::units::Height;
use core::ops::Range;
pub(super) use linear::{BLOCK, BlockNumbers, Node, VALUES, between, interpolate};
use linear::{Linear, floor, is_near};

/// Shifts [`SQUARE`] to the sign of 32 bits.
const TO_SIGN: u32 = SQUARE.leading_zeros() + 16;

/// The golden map that rows are compared with.
#[derive(Clone, Copy)]
pub(super) struct GoldenMap<'a> {
    pub height: &'a [Height],
    /// See [`crate::pipeline::CubicInput`].
    pub taught: &'a [u16],
    pub width: usize,
}

/// A row of height offsets to be aligned.
#[derive(Clone, Copy)]
pub(super) struct OffsetRow<'a> {
    pub v: usize,
    pub offset: &'a [i32],
    /// Displacements of its blocks.
    pub blocks: &'a [BlockNumbers],
}

back_end_entry! {
    /// Aligns columns of a row: writes their deviations from golden at the taught coordinates, and whether one is above
    /// [`MAX_NARROW_NM`].
    fn align_row [] = align_columns(
        golden: GoldenMap<'_>,
        row: OffsetRow<'_>,
        columns: Range<usize>,
        deviation: &mut [i32],
        overflow: &mut bool,
    )
}

back_end_entry! {
    /// The taught coordinates of columns of a row, rounded to nearest: columns and rows.
    fn taught_coordinates [] = round_coordinates(
        golden: GoldenMap<'_>,
        row: OffsetRow<'_>,
        columns: Range<usize>,
        taught: (&mut [i32], &mut [i32]),
    )
}

/// The pixels of a block, or some of them, and what displaces them.
struct Block<'a> {
    linear: Linear,
    /// The first pixel, and its number in the block.
    u: usize,
    v: usize,
    skipped: usize,
    /// Golden's heights that the offsets count from.
    bases: &'a [Height],
    offsets: &'a [i32],
}

impl<'a> Block<'a> {
    /// The pixels in `columns`, which belong to one block.
    #[inline(always)]
    fn new(golden: GoldenMap<'a>, row: OffsetRow<'a>, columns: Range<usize>) -> Self {
        let u = columns.start;
        Self {
            linear: Linear::of(&row.blocks[u / BLOCK]),
            u,
            v: row.v,
            skipped: u % BLOCK,
            bases: &golden.height[row.v * golden.width..][columns.clone()],
            offsets: &row.offset[columns],
        }
    }

    /// The place in golden of the first pixel after a whole displacement, if the block is whole, and golden has `more` neighbours
    /// to the right of all its pixels and below.
    #[inline(always)]
    fn place(&self, golden: GoldenMap<'_>, [along, down]: [i32; 2], more: usize) -> Option<usize> {
        let width = golden.width;
        let column = (self.u as i32).wrapping_add(along);
        let row = (self.v as i32).wrapping_add(down);
        let inside = self.offsets.len() == BLOCK
            && column >= 0
            && row >= 0
            && column as usize + BLOCK + more <= width
            && (row as usize + 1 + more) * width <= golden.height.len();
        inside.then(|| row as usize * width + column as usize)
    }
}

/// The height that an offset leads to, nm.
#[inline(always)]
fn height(base: Height, offset: i32) -> i32 {
    let base = if base.is_known() { base.nm() } else { 0 };
    base.wrapping_add(offset)
}

#[inline(always)]
fn align_columns<V: Lanes>(
    v: V,
    golden: GoldenMap<'_>,
    row: OffsetRow<'_>,
    columns: Range<usize>,
    deviation: &mut [i32],
    overflow: &mut bool,
) {
    *overflow = false;
    let mut start = columns.start;
    while start < columns.end {
        let end = ((start / BLOCK + 1) * BLOCK).min(columns.end);
        let block = Block::new(golden, row, start..end);
        let out = &mut deviation[start..end];
        v.fetch(golden.height, row.v * golden.width + start, golden.width);
        if let Some([along, down]) = block.linear.whole() {
            let mut small = false;
            if let Some(place) = block.place(golden, [along, down], 1) {
                v.fetch(golden.height, place, 2 * golden.width);
                small = same(golden, &block, place, out);
            }
            let lower = block.linear.lower;
            if !small
                && let from = [along + lower[0], down + lower[1]]
                && let Some(place) = block.place(golden, from, 2)
            {
                small = next(golden, &block, place, out);
            }
            if !small {
                *overflow |= each(golden, &block, [along, down], out);
            }
        } else {
            out.fill(NO_OFFSET);
        }
        start = end;
    }
}

/// A block whose pixels all have its whole displacement, which leads from its first pixel to `place`. The answer is false if they
/// have not, or if some deviation is not small.
#[inline(always)]
fn same(golden: GoldenMap<'_>, block: &Block<'_>, place: usize, out: &mut [i32]) -> bool {
    let upper = &golden.height[place..][..BLOCK + 1];
    let lower = &golden.height[place + golden.width..][..BLOCK + 1];
    let taught = &golden.taught[place..][..BLOCK];
    let (bases, offsets) = (&block.bases[..BLOCK], &block.offsets[..BLOCK]);
    let (linear, out) = (block.linear, &mut out[..BLOCK]);
    let (mut farthest, mut largest) = (0, 0);
    for i in 0..BLOCK {
        let z = height(bases[i], offsets[i]);
        let [along, down, rise] = linear.at(i, z);
        let corners = [
            upper[i].nm(),
            upper[i + 1].nm(),
            lower[i].nm(),
            lower[i + 1].nm(),
        ];
        let nm = deviation((z, rise), (along, down), corners);
        // Masks of 32 bits, as wide as the heights: narrower ones would be widened again.
        let measured = -i32::from(offsets[i] != NO_OFFSET);
        let known = measured & (i32::from(taught[i]) << TO_SIGN) >> 31;
        out[i] = (whole(nm) & known) | (NO_OFFSET & !known);
        farthest = farthest.max(order(along).max(order(down)) & measured.cast_unsigned());
        largest = largest.max(order(nm.abs()) & known.cast_unsigned());
    }
    farthest < order(1.0) && largest < order(MAX_NARROW_NM as f32)
}

/// The bits of a number: from 0 up in the order of the numbers; those of negative ones and NaN are larger than all others.
#[inline(always)]
fn order(number: f32) -> u32 {
    number.to_bits()
}

/// A block whose pixels have a whole displacement that leads from the first one to `place`, or one pixel more along, down or
/// both. The answer is false if they have not, or if some deviation is not small.
#[inline(always)]
fn next(golden: GoldenMap<'_>, block: &Block<'_>, place: usize, out: &mut [i32]) -> bool {
    let width = golden.width;
    let first = &golden.height[place..][..BLOCK + 2];
    let second = &golden.height[place + width..][..BLOCK + 2];
    let third = &golden.height[place + 2 * width..][..BLOCK + 2];
    let upper = &golden.taught[place..][..BLOCK + 1];
    let lower = &golden.taught[place + width..][..BLOCK + 1];
    let (bases, offsets) = (&block.bases[..BLOCK], &block.offsets[..BLOCK]);
    let (linear, out) = (block.linear, &mut out[..BLOCK]);
    let [left, top] = [linear.lower[0] as f32, linear.lower[1] as f32];
    let mut refused = 0;
    for i in 0..BLOCK {
        let z = height(bases[i], offsets[i]);
        let [along, down, rise] = linear.at(i, z);
        let inside = lies_in(along, left, 2.0) & lies_in(down, top, 2.0);
        let (right, under) = (along >= left + 1.0, down >= top + 1.0);
        let shares = (
            along - if right { left + 1.0 } else { left },
            down - if under { top + 1.0 } else { top },
        );
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
        let nm = deviation((z, rise), shares, corners);
        let measured = offsets[i] != NO_OFFSET;
        let known = measured & (taught & SQUARE != 0);
        out[i] = if known { whole(nm) } else { NO_OFFSET };
        refused |= i32::from((measured & !inside) | (known & !is_small(nm)));
    }
    refused == 0
}

/// Whether a displacement is at least `low` and less than so many pixels more.
#[inline(always)]
fn lies_in(displacement: f32, low: f32, pixels: f32) -> bool {
    (displacement >= low) & (displacement < low + pixels)
}

/// The height at a place of a row, or the next one.
#[inline(always)]
fn pick(next: bool, row: &[Height], at: usize) -> i32 {
    if next { row[at + 1].nm() } else { row[at].nm() }
}

/// A block pixel by pixel, from its whole displacement. The answer is whether some deviation is large.
#[inline(always)]
fn each(golden: GoldenMap<'_>, block: &Block<'_>, from: [i32; 2], out: &mut [i32]) -> bool {
    let width = golden.width;
    let rows = golden.height.len() / width;
    let mut large = false;
    for (i, out) in out.iter_mut().enumerate() {
        *out = NO_OFFSET;
        if block.offsets[i] == NO_OFFSET {
            continue;
        }
        let z = height(block.bases[i], block.offsets[i]);
        let [along, down, rise] = block.linear.at(block.skipped + i, z);
        if !is_near(along) || !is_near(down) {
            continue;
        }
        let (left, top) = (floor(along), floor(down));
        let column = (block.u + i) as i32 + from[0] + whole(left);
        let row = block.v as i32 + from[1] + whole(top);
        let place = (row as usize)
            .wrapping_mul(width)
            .wrapping_add(column as usize);
        let inside = column >= 0 && row >= 0 && column + 1 < width as i32 && row + 1 < rows as i32;
        if !inside || golden.taught[place] & SQUARE == 0 {
            continue;
        }
        let (upper, lower) = (&golden.height[place..], &golden.height[place + width..]);
        let corners = [upper[0].nm(), upper[1].nm(), lower[0].nm(), lower[1].nm()];
        let nm = deviation((z, rise), (along - left, down - top), corners);
        large |= !is_small(nm);
        *out = match is_small(nm) {
            true => whole(nm),
            // One above the value for "no offset".
            false => (nm as i32).max(NO_OFFSET + 1),
        };
    }
    large
}

/// How far a pixel at height `z` that moves up by `rise` lies above golden, nm. It lies between four corners (left and right, above and
/// below), at these shares of the way from the first one along and down.
#[inline(always)]
fn deviation((z, rise): (i32, f32), (along, down): (f32, f32), corners: [i32; 4]) -> f32 {
    let [first, right, under, both] = corners;
    let upper = right.wrapping_sub(first);
    let lower = both.wrapping_sub(under);
    let twist = lower.wrapping_sub(upper) as f32;
    let under = under.wrapping_sub(first) as f32;
    let golden = along * upper as f32 + down * (under + along * twist);
    let above = z.wrapping_sub(first) as f32;
    (above + rise) - golden
}

/// Whether a deviation in nm is at most [`MAX_NARROW_NM`].
#[inline(always)]
fn is_small(nm: f32) -> bool {
    (nm > -(MAX_NARROW_NM as f32)) & (nm < MAX_NARROW_NM as f32)
}

#[inline(always)]
fn round_coordinates<V: Lanes>(
    _: V,
    golden: GoldenMap<'_>,
    row: OffsetRow<'_>,
    columns: Range<usize>,
    taught: (&mut [i32], &mut [i32]),
) {
    let mut start = columns.start;
    while start < columns.end {
        let end = ((start / BLOCK + 1) * BLOCK).min(columns.end);
        let block = Block::new(golden, row, start..end);
        let (column, line) = (&mut taught.0[start..end], &mut taught.1[start..end]);
        let from = block.linear.whole().unwrap_or_default();
        for i in 0..end - start {
            let z = height(block.bases[i], block.offsets[i]);
            let [along, down, _] = block.linear.at(block.skipped + i, z);
            let known = (block.offsets[i] != NO_OFFSET) & is_near(along) & is_near(down);
            let pixels = if known {
                [whole(along), whole(down)]
            } else {
                [0; 2]
            };
            column[i] = ((start + i) as i32).wrapping_add(from[0] + pixels[0]);
            line[i] = (row.v as i32).wrapping_add(from[1] + pixels[1]);
        }
        start = end;
    }
}

#[cfg(test)]
mod tests;
