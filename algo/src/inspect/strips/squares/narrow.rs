//! Sums over squares in 32 bits, many pixels at a time: they tell where in a row the largest deviation may be.

use super::COUNT_BIT;
use super::extreme::{Extreme, SquareRow, floor_of, least_support};
use crate::pipeline::NO_OFFSET;
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Deviations up to this many nm are summed in 32 bits: more than a cubic gives.
pub(in super::super) const MAX_NARROW_NM: u32 = 1 << 22;
/// Sums over squares of up to so many such deviations do not overflow.
const MAX_PIXELS: usize = (i32::MAX as u32 / MAX_NARROW_NM) as usize;
/// Squares that are tested together.
const BLOCK: usize = 64;

/// Sums over the squares around the pixels of a row.
#[derive(Debug)]
pub(super) struct NarrowSums {
    /// Sums down single columns.
    columns: Vec<i32>,
    /// Sums over some neighbouring columns.
    some: Vec<i32>,
    /// Sums over as many columns as a square has, from the square around column `first` on.
    all: Vec<i32>,
    first: usize,
}

impl NarrowSums {
    /// For so many columns with their padding.
    pub fn new(columns: usize) -> Self {
        Self {
            columns: vec![0; columns],
            some: vec![0; columns],
            all: vec![0; columns],
            first: 0,
        }
    }

    /// Whether sums over squares of this side fit into 32 bits.
    pub fn hold(side: usize) -> bool {
        (side | 1) * (side | 1) < MAX_PIXELS
    }

    /// Sums over the squares around some columns, from packed sums down the columns with half a side of padding.
    pub fn add(&mut self, backend: Backend, sums: &[i64], side: usize, around: Range<usize>) {
        self.first = around.start;
        let sums = &sums[around.start..around.end + side / 2 * 2];
        let length = sums.len();
        let Self {
            columns, some, all, ..
        } = self;
        unpack(backend, sums, &mut columns[..length]);
        let side = side | 1;
        let bits = side.ilog2();
        if bits == 0 {
            all[..length].copy_from_slice(&columns[..length]);
        }
        // Sums over `wide` neighbouring columns, from the highest bit of the side down: doubled, and one column more where the bit
        // is set.
        let mut wide = 1;
        for bit in (0..bits).rev() {
            core::mem::swap(all, some);
            let before = if wide == 1 { &*columns } else { &*some };
            let one = (side >> bit) & 1;
            let reach = 2 * wide + one - 1;
            let out = &mut all[..length - reach];
            let (left, right) = (&before[..], &before[wide..]);
            match one {
                0 => add_two(backend, left, right, out),
                _ => add_three(backend, left, right, &columns[2 * wide..], out),
            }
            wide = 2 * wide + one;
        }
    }

    /// Searches a span for the largest deviation: exactly, in the blocks in which a sum is large enough.
    pub fn search(
        &self,
        backend: Backend,
        best: &mut Option<Extreme>,
        row: &SquareRow<'_>,
        span: Range<usize>,
    ) {
        let reach = row.side / 2 * 2;
        let mut start = span.start;
        while start < span.end {
            let block = start..(start + BLOCK).min(span.end);
            start = block.end;
            let sums = &self.all[block.start - self.first..block.end - self.first];
            let centres = &row.centres[block.clone()];
            let mut reached = false;
            let floor = floor_of(*best, least_support(row.side));
            sift(backend, sums, centres, floor, &mut reached);
            if reached {
                // A larger floor, as no square of the block has fewer deviations than the least count allows.
                let mut least = i64::MAX;
                least_count(
                    backend,
                    &row.sums[block.start..block.end + reach],
                    &mut least,
                );
                let least = (least * (reach as i64 + 1)).max(least_support(row.side));
                sift(backend, sums, centres, floor_of(*best, least), &mut reached);
            }
            if reached {
                row.search(best, block);
            }
        }
    }
}

back_end_entry! {
    /// Whether the sum of a square whose middle is compared reaches ± `floor`.
    fn sift [] = sift_sums(sums: &[i32], centres: &[i32], floor: i64, reached: &mut bool)
}

back_end_entry! {
    /// Lowers `least` to the smallest count of packed sums.
    fn least_count [] = least_of(sums: &[i64], least: &mut i64)
}

back_end_entry! {
    /// The low halves of packed sums: the sums themselves where 32 bits hold them.
    fn unpack [] = unpack_columns(sums: &[i64], out: &mut [i32])
}

back_end_entry! {
    /// a + b.
    fn add_two [] = two(a: &[i32], b: &[i32], out: &mut [i32])
}

back_end_entry! {
    /// a + b + c.
    fn add_three [] = three(a: &[i32], b: &[i32], c: &[i32], out: &mut [i32])
}

#[inline(always)]
fn sift_sums<V: Lanes>(_: V, sums: &[i32], centres: &[i32], floor: i64, reached: &mut bool) {
    let floor = if floor > i64::from(i32::MAX) {
        i32::MAX
    } else {
        floor as i32
    };
    let centres = &centres[..sums.len()];
    let mut any = 0_u32;
    for i in 0..sums.len() {
        let far = (sums[i] >= floor) | (sums[i] <= -floor);
        any |= u32::from(far & (centres[i] != NO_OFFSET));
    }
    *reached = any != 0;
}

#[inline(always)]
fn least_of<V: Lanes>(_: V, sums: &[i64], least: &mut i64) {
    let mut smallest = i64::MAX;
    for &packed in sums {
        // A negative sum borrows from the count: half a count is added.
        let lifted = packed + (1 << (COUNT_BIT - 1));
        smallest = if lifted < smallest { lifted } else { smallest };
    }
    let count = smallest >> COUNT_BIT;
    *least = if count < *least { count } else { *least };
}

#[inline(always)]
fn unpack_columns<V: Lanes>(_: V, sums: &[i64], out: &mut [i32]) {
    let sums = &sums[..out.len()];
    for i in 0..out.len() {
        out[i] = sums[i] as i32;
    }
}

#[inline(always)]
fn two<V: Lanes>(_: V, a: &[i32], b: &[i32], out: &mut [i32]) {
    let (a, b) = (&a[..out.len()], &b[..out.len()]);
    for i in 0..out.len() {
        out[i] = a[i].wrapping_add(b[i]);
    }
}

#[inline(always)]
fn three<V: Lanes>(_: V, a: &[i32], b: &[i32], c: &[i32], out: &mut [i32]) {
    let length = out.len();
    let (a, b, c) = (&a[..length], &b[..length], &c[..length]);
    for i in 0..length {
        out[i] = a[i].wrapping_add(b[i]).wrapping_add(c[i]);
    }
}
