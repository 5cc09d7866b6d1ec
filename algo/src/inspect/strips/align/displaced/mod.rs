//! Stage 3, align: taught coordinates of a displaced row and its deviations from golden there.
//!
//! # Idea
//! The pose field gives the displacement of each pixel; inside a block it is linear in column and
//! quadratic in height (`linear`). Golden's height between four pixels is bilinear. Neighbouring
//! blocks whose pixels have one whole displacement are worked on together for as long as that holds
//! (`same`): golden is read along rows, many pixels at a time, and each pixel is checked. All other
//! blocks go pixel by pixel (`block`). Plain loops over slices, compiled for each back-end's
//! instructions.
//!
//! # Equations
//! With the displacement (du, dv, dz) at height z, a pixel's deviation in height is (z + dz) −
//! G(u + du, v + dv), G golden's height. That along the normal is the same times the factor of the
//! first of the four pixels.
//!
//! # Accuracy
//! Both ways have the same bits (`blocks_have_the_bits_of_one_pixel_after_the_other`); the
//! deviation is within 50 nm of one of whole maps
//! (`strips_weigh_deviations_as_the_comparison_of_whole_maps_does`).

mod block;
mod linear;
mod same;

use crate::simd::{Backend, Lanes, back_end_entry};
use block::Block;
pub use block::{Deviations, GoldenMap, OffsetRow, mask, pick, scaled};
use core::ops::Range;
pub(in crate::inspect::strips) use linear::{
    BLOCK, BlockNumbers, Linear, Node, Whole, between, floor, interpolate, is_near,
};
use same::align_same;

back_end_entry! {
    /// The taught coordinates of columns of a row, rounded to nearest: columns and rows.
    fn taught_coordinates [] = round_coordinates(
        golden: GoldenMap<'_>,
        row: OffsetRow<'_>,
        columns: Range<usize>,
        taught: (&mut [i32], &mut [i32]),
    )
}

/// Aligns columns of a row: writes their deviations from golden at the taught coordinates.
pub fn align_row(
    backend: Backend,
    golden: GoldenMap<'_>,
    row: OffsetRow<'_>,
    columns: Range<usize>,
    mut out: Deviations<'_>,
) {
    let mut start = columns.start;
    while start < columns.end {
        if start.is_multiple_of(BLOCK) {
            let mut blocks = 0;
            let left = start..columns.end;
            align_same(backend, golden, row, left, &mut out, &mut blocks);
            start += blocks * BLOCK;
            if start >= columns.end {
                break;
            }
        }
        let end = ((start / BLOCK + 1) * BLOCK).min(columns.end);
        let mut here = out.of(start..end);
        match Block::new(golden, row, start..end) {
            Some(block) => block.align(golden, &mut here),
            None => here.leave_open(),
        }
        start = end;
    }
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
        let (column, line) = (&mut taught.0[start..end], &mut taught.1[start..end]);
        if let Some(block) = Block::new(golden, row, start..end) {
            block.round(column, line);
        } else {
            for (column, u) in column.iter_mut().zip(start..) {
                *column = u as i32;
            }
            line.fill(row.v as i32);
        }
        start = end;
    }
}

#[cfg(test)]
mod tests;
