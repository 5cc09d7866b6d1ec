//! What the two back-ends of x86-64 share: prefetching, and an operation that both compose of the
//! same instructions.

use super::lanes::{Lanes, Scaled};
use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

/// Rows of a single level are prefetched this many samples ahead, which is about 350 ns of work
/// with AVX2; rows of several levels half as far, which takes as long. docs/design.md has what
/// other distances cost.
pub(super) const AHEAD: usize = 512;
/// Bytes of a cache line.
const LINE: usize = 64;

/// Prefetches the cache lines of the block `after` samples behind the one at `at`: there are more
/// rows than the processor's own prefetcher follows. A block is `PIXELS` samples.
#[inline(always)]
pub(super) fn hint<T, const PIXELS: usize, const HINT: i32>(row: &[T], at: usize, after: usize) {
    let bytes = PIXELS * size_of::<T>();
    let lines = bytes / LINE;
    // Several blocks are one line.
    if lines == 0 && !(at / PIXELS).is_multiple_of(LINE / bytes) {
        return;
    }
    let ahead = row.as_ptr().wrapping_add(at + after).cast::<i8>();
    let mut line = 0;
    while line < lines.max(1) {
        // SAFETY: a hint, which no address makes fail; SSE is part of x86-64.
        unsafe { _mm_prefetch::<HINT>(ahead.wrapping_add(line * LINE)) };
        line += 1;
    }
}

/// Prefetches the cache line of sample `at`, which may lie behind the row.
#[inline(always)]
pub(super) fn hint_line<T>(row: &[T], at: usize) {
    // SAFETY: a hint, which no address makes fail; SSE is part of x86-64.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(row.as_ptr().wrapping_add(at).cast()) }
}

/// [`Lanes::scaled`] by the words of `scale`.
#[inline(always)]
pub(super) fn scaled_by<V: Lanes>(v: V, long: V::B, short: V::B, scale: [V::W; 2]) -> Scaled<V::W> {
    let zero = v.splat8(0);
    let (long, short) = (v.widen(long, zero), v.widen(short, zero));
    let long = [v.mul_low(long[0], scale[0]), v.mul_low(long[1], scale[1])];
    let short = [v.mul_low(short[0], scale[0]), v.mul_low(short[1], scale[1])];
    let turn = v.splat16(i16::MIN);
    Scaled {
        long,
        short,
        centred: [
            v.xor(v.shl::<2>(long[0]), turn),
            v.xor(v.shl::<2>(long[1]), turn),
        ],
    }
}
