//! Loads and stores of vectors from two places of 16 bytes each.

use super::BYTES;
use crate::simd::rows::{block, block_mut};
use core::arch::x86_64::*;

/// The vector whose lower and upper 128 bits are the elements from `low` and from `high` of the
/// block at `at`.
#[inline(always)]
pub(super) fn load_halves<T>(from: &[T], at: usize, low: usize, high: usize) -> __m256i {
    let block = block(from, at, BYTES);
    let (low, high) = (&block[low..], &block[high..]);
    assert!(size_of_val(low) >= 16 && size_of_val(high) >= 16);
    // SAFETY: both slices hold at least 16 bytes, asserted above; the loads need no alignment. AVX2
    // as above: only methods of `Avx2` call this.
    unsafe { _mm256_loadu2_m128i(high.as_ptr().cast(), low.as_ptr().cast()) }
}

/// Stores the lower and upper 128 bits of a vector as [`load_halves`] loads them.
#[inline(always)]
pub(super) fn store_halves<T>(to: &mut [T], at: usize, low: usize, high: usize, x: __m256i) {
    let block = block_mut(to, at, BYTES);
    assert!(size_of_val(&block[low..]) >= 16 && size_of_val(&block[high..]) >= 16);
    // SAFETY: at least 16 bytes follow both places, asserted above, and the two places do not
    // overlap in any call; the stores need no alignment. AVX2 as above: only methods of `Avx2` call
    // this.
    unsafe {
        let start = block.as_mut_ptr();
        _mm256_storeu2_m128i(start.add(high).cast(), start.add(low).cast(), x);
    }
}
