//! Counts along a row, and sums down the columns: plain loops, compiled for each back-end's instructions.

use crate::phase::Trust;
use crate::pipeline::NO_RISE;
use crate::simd::{Lanes, back_end_entry};

/// Number of trusts.
pub(super) const TRUSTS: usize = Trust::REASONS.len() + 1;
/// All of them, the frequent ones first.
const ORDER: [Trust; TRUSTS] = [
    Trust::Resolved,
    Trust::Unexpected,
    Trust::Dark,
    Trust::LowModulation,
    Trust::Saturated,
    Trust::Residual,
    Trust::OutOfRange,
];
/// Pixels whose counts fit into a byte.
const BLOCK: usize = 255;
/// A packed sum holds the number of its terms above this bit, and their sum below it.
pub(super) const COUNT_BIT: u32 = 44;

back_end_entry! {
    /// Adds the number of pixels with each trust to `counts`.
    fn count_trusts [] = trusts(row: &[Trust], counts: &mut [u64; TRUSTS])
}

back_end_entry! {
    /// Adds the number of known rises to `count`.
    fn count_known [] = known(row: &[i32], count: &mut u64)
}

back_end_entry! {
    /// Adds a row to packed sums down the columns, and takes one out of them.
    fn slide [] = slide_columns(sums: &mut [i64], new: &[i32], old: &[i32])
}

#[inline(always)]
fn trusts<V: Lanes>(_: V, row: &[Trust], counts: &mut [u64; TRUSTS]) {
    for block in row.chunks(BLOCK) {
        let mut left = block.len() as u64;
        for trust in ORDER {
            // Mostly there are only the first ones: it ends when all are counted.
            if left == 0 {
                break;
            }
            let mut here = 0_u8;
            for &seen in block {
                here = here.wrapping_add(u8::from(seen as u8 == trust as u8));
            }
            counts[trust as usize] += u64::from(here);
            left -= u64::from(here);
        }
    }
}

#[inline(always)]
fn known<V: Lanes>(_: V, row: &[i32], count: &mut u64) {
    let mut known = 0_u32;
    for &rise in row {
        known = known.wrapping_add(u32::from(rise != NO_RISE));
    }
    *count += u64::from(known);
}

#[inline(always)]
fn slide_columns<V: Lanes>(_: V, sums: &mut [i64], new: &[i32], old: &[i32]) {
    let length = sums.len();
    let (new, old) = (&new[..length], &old[..length]);
    for i in 0..length {
        let (enters, leaves) = (new[i] != NO_RISE, old[i] != NO_RISE);
        let rise =
            i64::from(if enters { new[i] } else { 0 }) - i64::from(if leaves { old[i] } else { 0 });
        let count = i64::from(i32::from(enters) - i32::from(leaves));
        sums[i] = sums[i].wrapping_add(rise).wrapping_add(count << COUNT_BIT);
    }
}
