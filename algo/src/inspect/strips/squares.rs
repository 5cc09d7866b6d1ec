//! Which squares of a row can have the largest deviation at all: sums in 32 bits, many pixels at a time.

use super::extreme::{Extreme, SquareRow, floor_of};
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Rises up to this many nm are summed in 32 bits: more than a cubic gives.
pub(super) const MAX_TAME: u32 = 1 << 22;
/// Squares of up to so many pixels of them.
const MAX_PIXELS: usize = (i32::MAX as u32 / MAX_TAME) as usize;
/// Squares that are looked at together.
const BLOCK: usize = 64;

/// Sums over the squares around the pixels of a row.
#[derive(Debug)]
pub(super) struct Squares {
    /// Of columns of the square's height.
    columns: Vec<i32>,
    /// Of some columns.
    some: Vec<i32>,
    /// Of as many as the square has: what starts at a column.
    all: Vec<i32>,
}

impl Squares {
    /// For so many columns with their padding.
    pub fn new(columns: usize) -> Self {
        Self {
            columns: vec![0; columns],
            some: vec![0; columns],
            all: vec![0; columns],
        }
    }

    /// Whether sums over squares of this side fit.
    pub fn hold(side: usize) -> bool {
        (side | 1) * (side | 1) < MAX_PIXELS
    }

    /// Sums over squares from packed sums down the columns.
    pub fn add(&mut self, backend: Backend, sums: &[i64], side: usize) {
        let length = sums.len();
        let columns = &mut self.columns[..length];
        unpack(backend, sums, columns);
        let side = side | 1;
        self.all[..length].copy_from_slice(columns);
        // From the highest bit of the side down: twice as many columns, and one more where the bit is set.
        let mut wide = 1;
        for bit in (0..side.ilog2()).rev() {
            core::mem::swap(&mut self.all, &mut self.some);
            let one = (side >> bit) & 1;
            let reach = 2 * wide + one - 1;
            let out = &mut self.all[..length - reach];
            let (left, right) = (&self.some[..], &self.some[wide..]);
            match one {
                0 => add_two(backend, left, right, out),
                _ => add_three(backend, left, right, &self.columns[2 * wide..], out),
            }
            wide = 2 * wide + one;
        }
    }

    /// Looks closer where a sum is large enough to matter.
    pub fn search(&self, best: &mut Option<Extreme>, row: &SquareRow<'_>, span: Range<usize>) {
        let mut start = span.start;
        while start < span.end {
            let end = (start + BLOCK).min(span.end);
            let floor = floor_of(*best, row.side).min(i64::from(i32::MAX)) as i32;
            let mut reached = 0_u32;
            for &sum in &self.all[start..end] {
                reached |= u32::from(sum >= floor) | u32::from(sum <= -floor);
            }
            if reached != 0 {
                row.search(best, start..end);
            }
            start = end;
        }
    }
}

back_end_entry! {
    /// The low halves of packed sums: the sums themselves, as far as 32 bits hold them.
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
