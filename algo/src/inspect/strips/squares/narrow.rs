//! Sums over squares in 32 bits, many pixels at a time: they tell where in a row the largest
//! deviation may be.

use super::extreme::{COUNT_BIT, Extreme, SquareRow, floor_of, least_support, strength};
use crate::pipeline::NO_OFFSET;
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Deviations up to this many nm are summed in 32 bits: more than a cubic gives.
pub const MAX_NARROW_NM: u32 = 1 << 22;
/// Sums over squares of up to so many such deviations do not overflow.
const MAX_PIXELS: usize = (i32::MAX as u32 / MAX_NARROW_NM) as usize;

/// Sums over the squares around the pixels of a row.
#[derive(Debug)]
pub struct NarrowSums {
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

    /// Sums over the squares around some columns, from packed sums down the columns with half a
    /// side of padding.
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
        // Sums over `wide` neighbouring columns, from the highest bit of the side down: doubled,
        // and one column more where the bit is set.
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

    /// Searches some squares for the largest deviation and for the largest sum: exactly, where the
    /// sums are large enough.
    pub fn search(
        &self,
        backend: Backend,
        row: &SquareRow<'_>,
        span: Range<usize>,
        [largest, strongest]: [&mut Option<Extreme>; 2],
    ) {
        let sums = &self.all[span.start - self.first..span.end - self.first];
        let centres = &row.centres[span.clone()];
        let mut greatest = 0;
        greatest_sum(backend, sums, centres, &mut greatest);
        let sum = i64::from(greatest);
        if sum >= floor_of(*largest, least_support(row.side)) {
            // A larger floor, as no square of the span has fewer deviations than the least count
            // allows.
            let reach = row.side / 2 * 2;
            let columns = &row.sums[span.start..span.end + reach];
            let mut least = i64::MAX;
            least_count(backend, columns, &mut least);
            let least = (least * (reach as i64 + 1)).max(least_support(row.side));
            if sum >= floor_of(*largest, least) {
                row.search(largest, span.clone());
            }
        }
        if sum > strength(*strongest) {
            let mut last = 0;
            last_with(backend, sums, centres, greatest, &mut last);
            row.strengthen(strongest, span.start + last);
        }
    }
}

back_end_entry! {
    /// The greatest |sum| of the squares whose middle is compared.
    fn greatest_sum [] = greatest_of(sums: &[i32], centres: &[i32], greatest: &mut i32)
}

back_end_entry! {
    /// The last of these squares that has this |sum|.
    fn last_with [] = last_of(sums: &[i32], centres: &[i32], magnitude: i32, last: &mut usize)
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
fn greatest_of<V: Lanes>(_: V, sums: &[i32], centres: &[i32], greatest: &mut i32) {
    let centres = &centres[..sums.len()];
    let mut most = 0;
    for i in 0..sums.len() {
        let magnitude = magnitude(sums[i], centres[i]);
        most = if magnitude > most { magnitude } else { most };
    }
    *greatest = most;
}

#[inline(always)]
fn last_of<V: Lanes>(_: V, sums: &[i32], centres: &[i32], magnitude: i32, last: &mut usize) {
    let centres = &centres[..sums.len()];
    let mut found = 0_u32;
    for i in 0..sums.len() {
        let here = self::magnitude(sums[i], centres[i]) == magnitude;
        found = if here { i as u32 } else { found };
    }
    *last = found as usize;
}

/// |sum| of a square whose middle is compared, else 0.
#[inline(always)]
fn magnitude(sum: i32, centre: i32) -> i32 {
    let magnitude = if sum < 0 { -sum } else { sum };
    if centre == NO_OFFSET { 0 } else { magnitude }
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    const WIDTH: usize = 200;

    /// Packed sums of the deviations down each column of squares of `side` pixels, with padding;
    /// and the deviations of a row.
    fn columns(side: usize, random: &mut SplitMix64) -> (Vec<i64>, Vec<i32>) {
        let mut draw = |below: usize| (random.next_u64() % below as u64) as i64;
        let mut sums = vec![0; WIDTH + side / 2 * 2];
        for sum in &mut sums[side / 2..side / 2 + WIDTH] {
            // A few are missing.
            for _ in 0..side as i64 - draw(side / 4 + 1) {
                *sum += (1 << COUNT_BIT) + draw(8001) - 4000;
            }
        }
        let centres = (0..WIDTH).map(|_| if draw(4) == 0 { NO_OFFSET } else { 0 });
        (sums, centres.collect())
    }

    #[test]
    fn lanes_and_single_squares_find_the_largest_mean_and_the_largest_sum() {
        let mut random = SplitMix64::seed_from_u64(3);
        let spans = [3..64, 64..128, 128..128, 130..131, 140..190];
        for (backend, side) in
            Backend::available().flat_map(|b| [1, 2, 9, 21].map(|side| (b, side)))
        {
            let (sums, centres) = columns(side, &mut random);
            let row = SquareRow {
                sums: &sums,
                centres: &centres,
                side,
                row: 7,
            };
            let mut narrow = NarrowSums::new(sums.len());
            narrow.add(backend, &sums, side, 3..190);
            let (mut by_lanes, mut single) = ([None; 2], [None; 2]);
            for span in spans.clone() {
                narrow.search(backend, &row, span.clone(), by_lanes.each_mut());
                row.search_both(single.each_mut(), span);
                assert_eq!(by_lanes, single, "{side}");
            }
            let [largest, strongest] = by_lanes.map(Option::unwrap);
            let columns = spans.iter().flat_map(Clone::clone);
            for column in columns.filter(|column| centres[*column] != NO_OFFSET) {
                let mut around = None;
                row.strengthen(&mut around, column);
                let around = around.unwrap();
                assert!(largest.reaches(&around), "{side}: {column}");
                assert!(strongest.sum.abs() >= around.sum.abs(), "{side}: {column}");
            }
        }
    }
}
