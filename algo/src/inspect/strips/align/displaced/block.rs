//! A block whose pixels are looked at one after the other: the row that it is of, what that is
//! compared with, and a pixel's deviation.

use super::linear::{BLOCK, BlockNumbers, Linear, Whole, floor, is_near};
use crate::inspect::strips::golden::base_nm;
use crate::inspect::weight::Factor;
use crate::math::nearest::{BELOW, whole};
use crate::pipeline::{NO_OFFSET, SQUARE};
use crate::units::Height;
use core::ops::Range;

/// The golden map that rows are compared with.
#[derive(Clone, Copy)]
pub struct GoldenMap<'a> {
    pub height: &'a [Height],
    /// See [`crate::pipeline::CubicInput`].
    pub taught: &'a [u16],
    /// What deviations in height are multiplied by.
    pub factor: &'a [Factor],
    pub width: usize,
}

impl GoldenMap<'_> {
    /// The place of a pixel after a whole displacement, and how many pixels the map has from there
    /// to the end of the row; none if it has not so many rows.
    #[inline(always)]
    pub fn inside(
        &self,
        (u, v): (usize, usize),
        [along, down]: [i32; 2],
        rows: usize,
    ) -> Option<(usize, usize)> {
        let column = (u as i32).wrapping_add(along);
        let row = (v as i32).wrapping_add(down);
        let inside = column >= 0
            && row >= 0
            && (column as usize) < self.width
            && (row as usize + rows) * self.width <= self.height.len();
        let place = (row as usize)
            .wrapping_mul(self.width)
            .wrapping_add(column as usize);
        inside.then(|| (place, self.width - column as usize))
    }
}

/// Deviations of a row, nm; [`NO_OFFSET`] where the part is not compared.
pub struct Deviations<'a> {
    /// In height.
    pub height: &'a mut [i32],
    /// Along the normal, weighted.
    pub normal: &'a mut [i32],
}

impl Deviations<'_> {
    #[inline]
    pub fn of(&mut self, columns: Range<usize>) -> Deviations<'_> {
        Deviations {
            height: &mut self.height[columns.clone()],
            normal: &mut self.normal[columns],
        }
    }

    #[inline]
    pub fn leave_open(&mut self) {
        self.height.fill(NO_OFFSET);
        self.normal.fill(NO_OFFSET);
    }
}

/// A row of height offsets to be aligned.
#[derive(Clone, Copy)]
pub struct OffsetRow<'a> {
    pub v: usize,
    pub offset: &'a [i32],
    /// Displacements of its blocks.
    pub blocks: &'a [BlockNumbers],
}

/// The height that an offset leads to, nm.
#[inline(always)]
pub fn height(base: Height, offset: i32) -> i32 {
    base_nm(base).wrapping_add(offset)
}

/// How far a pixel at height `z` that moves up by `rise` lies above golden, nm. It lies between
/// four corners (left and right, above and below), at these shares of the way from the first one
/// along and down.
#[inline(always)]
pub fn deviation_of((z, rise): (i32, f32), (along, down): (f32, f32), corners: [i32; 4]) -> f32 {
    let [first, right, under, both] = corners;
    let upper = right.wrapping_sub(first);
    let lower = both.wrapping_sub(under);
    let twist = lower.wrapping_sub(upper) as f32;
    let under = under.wrapping_sub(first) as f32;
    let golden = along * upper as f32 + down * (under + along * twist);
    let above = z.wrapping_sub(first) as f32;
    (above + rise) - golden
}

/// A deviation in nm times a factor in its units.
#[inline(always)]
pub fn scaled(nm: f32, units: i32) -> f32 {
    nm * (units as f32 * Factor::UNIT as f32)
}

/// Whether a deviation in nm is so small that [`whole`](crate::math::nearest::whole) rounds it.
#[inline(always)]
pub fn is_small(nm: f32) -> bool {
    (nm > -(BELOW as f32)) & (nm < BELOW as f32)
}

/// Shifts [`SQUARE`] to the sign of 32 bits.
const TO_SIGN: u32 = SQUARE.leading_zeros() + 16;

/// All bits if the part is compared at the four pixels from a taught one on, else none; in as many
/// bits as heights have, because narrower masks would have to be widened.
#[inline(always)]
pub fn square(taught: i32) -> i32 {
    (taught << TO_SIGN) >> 31
}

/// All bits, or none.
#[inline(always)]
pub fn mask(condition: bool) -> i32 {
    -i32::from(condition)
}

/// The first number where the mask is set, else the second.
#[inline(always)]
pub fn pick(mask: i32, a: i32, b: i32) -> i32 {
    (a & mask) | (b & !mask)
}

/// The pixels of a block, or some of them, and what displaces them.
pub struct Block<'a> {
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
