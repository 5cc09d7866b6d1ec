//! A block whose pixels are looked at one after the other.

use super::linear::{BLOCK, BlockNumbers, Linear, Whole, floor, is_near};
use super::pixel::{deviation_of, height, is_small, scaled};
use super::row::{Deviations, GoldenMap, OffsetRow};
use crate::math::nearest::whole;
use crate::pipeline::{NO_OFFSET, SQUARE};
use crate::units::Height;
use core::ops::Range;

/// The pixels of a block, or some of them, and what displaces them.
pub struct Block<'a> {
    pub numbers: &'a BlockNumbers,
    pub from: Whole,
    pub linear: Linear,
    /// The first pixel, and its number in the block.
    pub u: usize,
    pub v: usize,
    skipped: usize,
    /// Golden's heights that the offsets count from.
    pub bases: &'a [Height],
    pub offsets: &'a [i32],
}

impl<'a> Block<'a> {
    /// The pixels in `columns`, which belong to one block; none if its displacement is not known.
    #[inline(always)]
    pub fn new(golden: GoldenMap<'a>, row: OffsetRow<'a>, columns: Range<usize>) -> Option<Self> {
        let u = columns.start;
        let numbers = &row.blocks[u / BLOCK];
        let from = Whole::of(numbers)?;
        Some(Self {
            numbers,
            from,
            linear: Linear::of(numbers, from),
            u,
            v: row.v,
            skipped: u % BLOCK,
            bases: &golden.height[row.v * golden.width..][columns.clone()],
            offsets: &row.offset[columns],
        })
    }
}

impl Block<'_> {
    /// Writes its deviations, pixel by pixel.
    pub fn align(&self, golden: GoldenMap<'_>, out: &mut Deviations<'_>) {
        let from = self.from.pixels();
        let width = golden.width;
        let rows = golden.height.len() / width;
        out.leave_open();
        let out = out.height.iter_mut().zip(out.normal.iter_mut());
        for (i, (height_nm, normal_nm)) in out.enumerate() {
            if self.offsets[i] == NO_OFFSET {
                continue;
            }
            let z = height(self.bases[i], self.offsets[i]);
            let [along, down, rise] = self.linear.at(self.skipped + i, z);
            if !is_near(along) || !is_near(down) {
                continue;
            }
            let (left, top) = (floor(along), floor(down));
            let column = (self.u + i) as i32 + from[0] + whole(left);
            let row = self.v as i32 + from[1] + whole(top);
            let place = (row as usize)
                .wrapping_mul(width)
                .wrapping_add(column as usize);
            let inside =
                column >= 0 && row >= 0 && column + 1 < width as i32 && row + 1 < rows as i32;
            if !inside || golden.taught[place] & SQUARE == 0 {
                continue;
            }
            let (upper, lower) = (&golden.height[place..], &golden.height[place + width..]);
            let corners = [upper[0].nm(), upper[1].nm(), lower[0].nm(), lower[1].nm()];
            let nm = deviation_of((z, rise), (along - left, down - top), corners);
            let along_normal = scaled(nm, golden.factor[place].units());
            (*height_nm, *normal_nm) = match is_small(nm) {
                true => (whole(nm), whole(along_normal)),
                false => (large_whole(nm), large_whole(along_normal)),
            };
        }
    }

    /// Its taught coordinates.
    #[inline(always)]
    pub fn round(&self, column: &mut [i32], line: &mut [i32]) {
        let from = self.from.pixels();
        for i in 0..self.offsets.len() {
            let z = height(self.bases[i], self.offsets[i]);
            let [along, down, _] = self.linear.at(self.skipped + i, z);
            let known = (self.offsets[i] != NO_OFFSET) & is_near(along) & is_near(down);
            let pixels = if known {
                [whole(along), whole(down)]
            } else {
                [0; 2]
            };
            column[i] = ((self.u + i) as i32).wrapping_add(from[0] + pixels[0]);
            line[i] = (self.v as i32).wrapping_add(from[1] + pixels[1]);
        }
    }
}

/// A whole number of any size, one above the value for "no offset" at least.
fn large_whole(nm: f32) -> i32 {
    (nm as i32).max(NO_OFFSET + 1)
}
