//! Stage 3, align: taught coordinates of a displaced row and its deviations from golden there.
//!
//! # Idea
//! The pose field gives the displacement of each pixel. Golden's height between four pixels is bilinear. Displacements vary slowly:
//! the pixels of a block mostly lie between the same neighbours relative to their own place (`same`), or some of them one
//! neighbour further (`next`); then golden is read along rows, many pixels at a time. All other blocks go pixel by pixel
//! (`each`). Plain loops over slices, compiled for each back-end's instructions.
//!
//! # Equations
//! With the displacement (du, dv, dz) at height z, a pixel's deviation is (z + dz) − G(u + du, v + dv), G golden's height.
//!
//! # Accuracy
//! The three ways have the same bits (`blocks_have_the_bits_of_one_pixel_after_the_other`); the deviation is within 50 nm of one of
//! whole maps (`strips_weigh_deviations_as_the_comparison_of_whole_maps_does`).

mod block;

use super::pose::{Node, SPACING};
use super::squares::narrow::MAX_NARROW_NM;
use crate::math::nearest::whole;
use crate::pipeline::{NO_OFFSET, SQUARE};
use crate::simd::{Lanes, back_end_entry};
use crate::units::Height;
use block::{BLOCK, Block};
use core::ops::Range;

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
    /// Displacements at every [`SPACING`]th column.
    pub nodes: &'a [Node],
    /// The height that the nodes' values hold at, mm.
    pub middle: f32,
}

/// What an aligned row is written to.
pub(super) struct AlignedRow<'a> {
    /// Deviations from golden at the taught coordinates.
    pub deviation: &'a mut [i32],
    /// Taught coordinates.
    pub column: &'a mut [i32],
    /// Taught coordinates.
    pub row: &'a mut [i32],
    /// Whether a deviation is above [`MAX_NARROW_NM`].
    pub overflow: &'a mut bool,
}

back_end_entry! {
    /// Aligns columns of a row.
    fn align_row [] = align_columns(
        golden: GoldenMap<'_>,
        row: OffsetRow<'_>,
        columns: Range<usize>,
        aligned: AlignedRow<'_>,
    )
}

#[inline(always)]
fn align_columns<V: Lanes>(
    v: V,
    golden: GoldenMap<'_>,
    row: OffsetRow<'_>,
    columns: Range<usize>,
    aligned: AlignedRow<'_>,
) {
    let width = golden.width;
    let bases = &golden.height[row.v * width..(row.v + 1) * width];
    let last = row.nodes.len() - 1;
    let mut block = Block::EMPTY;
    let mut overflow = false;
    let mut start = columns.start;
    while start < columns.end {
        let node = start / SPACING;
        let left = node * SPACING;
        let end = ((start / BLOCK + 1) * BLOCK).min(columns.end);
        let length = end - start;
        v.fetch(bases, start, bases.len());
        let nodes = (row.nodes[node], row.nodes[(node + 1).min(last)]);
        let unit = 1.0 / ((left + SPACING).min(width - 1) - left).max(1) as f32;
        let seen = (&bases[start..end], &row.offset[start..end]);
        block.take_back(nodes, ((start - left) as i32, unit), row.middle, seen);
        let (column, line) = (
            &mut aligned.column[start..end],
            &mut aligned.row[start..end],
        );
        for i in 0..length {
            column[i] = ((start + i) as i32).wrapping_add(block.along.nearest[i]);
            line[i] = (row.v as i32).wrapping_add(block.down.nearest[i]);
        }
        let (left_most, right_most) = block.along.range(&block.known);
        let (top_most, bottom_most) = block.down.range(&block.known);
        let deviations = &mut aligned.deviation[start..end];
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
            let small = if inside && spread == 0 {
                same(golden, &block, place, deviations)
            } else if inside && spread == 1 {
                next(golden, &block, (left_most, top_most), place, deviations)
            } else {
                false
            };
            if !small {
                overflow |= each(golden, &block, (start, row.v), deviations);
            }
        }
        start = end;
    }
    *aligned.overflow = overflow;
}

/// A block whose pixels all have the same whole displacement; its first pixel lies at `place`. The answer is whether all deviations
/// are small.
#[inline(always)]
fn same(golden: GoldenMap<'_>, block: &Block, place: usize, out: &mut [i32]) -> bool {
    let (length, width) = (out.len(), golden.width);
    let upper = &golden.height[place..][..length + 1];
    let lower = &golden.height[place + width..][..length + 1];
    let taught = &golden.taught[place..][..length];
    let mut large = 0;
    for i in 0..length {
        let corners = [
            upper[i].nm(),
            upper[i + 1].nm(),
            lower[i].nm(),
            lower[i + 1].nm(),
        ];
        let known = (block.known[i] != 0) & (taught[i] & SQUARE != 0);
        let nm = block.deviation(i, corners);
        out[i] = if known { whole(nm) } else { NO_OFFSET };
        large |= i32::from(known & !is_small(nm));
    }
    large == 0
}

/// A block in which whole displacements along and down differ by one at most; the least ones lead from its first pixel to `place`.
/// The answer is whether all deviations are small.
#[inline(always)]
fn next(
    golden: GoldenMap<'_>,
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
    let mut large = 0;
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
        let nm = block.deviation(i, corners);
        out[i] = if known { whole(nm) } else { NO_OFFSET };
        large |= i32::from(known & !is_small(nm));
    }
    large == 0
}

/// The height at a place of a row, or the next one.
#[inline(always)]
fn pick(next: bool, row: &[Height], at: usize) -> i32 {
    if next { row[at + 1].nm() } else { row[at].nm() }
}

/// A block pixel by pixel; `first` is the column and row of its first pixel. The answer is whether some deviation is large.
#[inline(always)]
fn each(golden: GoldenMap<'_>, block: &Block, first: (usize, usize), out: &mut [i32]) -> bool {
    let width = golden.width;
    let mut large = false;
    for (i, out) in out.iter_mut().enumerate() {
        if block.known[i] == 0 {
            *out = NO_OFFSET;
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
            *out = NO_OFFSET;
            continue;
        }
        let (upper, lower) = (&golden.height[place..], &golden.height[place + width..]);
        let corners = [upper[0].nm(), upper[1].nm(), lower[0].nm(), lower[1].nm()];
        let nm = block.deviation(i, corners);
        large |= !is_small(nm);
        *out = match is_small(nm) {
            true => whole(nm),
            // One above the value for "no offset".
            false => (nm as i32).max(NO_OFFSET + 1),
        };
    }
    large
}

/// Whether a deviation in nm is at most [`MAX_NARROW_NM`].
#[inline(always)]
fn is_small(nm: f32) -> bool {
    (nm > -(MAX_NARROW_NM as f32)) & (nm < MAX_NARROW_NM as f32)
}

#[cfg(test)]
mod tests;
