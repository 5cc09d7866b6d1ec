//! What the back-ends of x86-64 share: their proof, the operations that both have by the same
//! instructions, and prefetching.

use super::lanes::{Lanes, Scaled};
use core::arch::x86_64::_mm_prefetch;

/// Bytes of a cache line.
const LINE: usize = 64;
/// Rows are prefetched this many samples ahead, which is about 350 ns of work with AVX2.
/// docs/design.md has what other distances cost.
pub(super) const AHEAD: usize = 512;

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

/// Defines the proof of a back-end whose instructions the processor names `$feature`.
macro_rules! proof {
    ($(#[$doc:meta])* $name:ident = $feature:tt) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) struct $name(());

        impl $name {
            /// The proof, where this processor and its operating system have the instructions.
            pub fn detect() -> Option<Self> {
                #[cfg(feature = "std")]
                let available = std::is_x86_feature_detected!($feature);
                #[cfg(not(feature = "std"))]
                let available = cfg!(target_feature = $feature);
                available.then_some(Self(()))
            }
        }
    };
}
pub(super) use proof;

/// Calls intrinsics on values in a method of a back-end. Sound because `self` proves that the
/// processor has them.
macro_rules! proven {
    ($e:expr) => {{
        // SAFETY: a back-end's proof exists only where the processor has its instructions (`detect`
        // in `proof!`), the only condition of intrinsics on values.
        unsafe { $e }
    }};
}
pub(super) use proven;

/// The operations that both back-ends have by the same instructions, on vectors `V` of integers and
/// `F` of singles, `BYTES` long.
///
/// A back-end imports the intrinsics of its width without their prefix. Its `load_part` and
/// `store_part` are the vector that holds the elements from `part` on of a block, and its `scales`
/// the bytes 16 / 2ⁿ where n bits of the index are needed, for indices 0 to 15.
macro_rules! shared {
    () => {
        const PIXELS: usize = BYTES;
        const AHEAD: usize = AHEAD;
        type B = V;
        type Bound = V;
        type W = V;
        type D = V;
        type F = F;
        type Count = __m128i;

        operations! { proven, always;
            splat8(self, x: u8) -> V = set1_epi8(x.cast_signed());
            widen(self, low: V, high: V) -> [V; 2] = [unpacklo_epi8(low, high), unpackhi_epi8(low, high)];
            narrow_mask(self, mask: [V; 2]) -> V = packs_epi16(mask[0], mask[1]);
            splat16(self, x: i16) -> V = set1_epi16(x);
            left(self, n: u8) -> __m128i = _mm_cvtsi32_si128(i32::from(n));
            shl_by(self, x: V, n: __m128i) -> V = sll_epi16(x, n);
            sar_by(self, x: V, n: __m128i) -> V = sra_epi16(x, n);
            shr_by(self, x: V, n: __m128i) -> V = srl_epi16(x, n);
            abs(self, x: V) -> V = abs_epi16(x);
            join(self, low: V, high: V) -> [V; 2] = [unpacklo_epi16(low, high), unpackhi_epi16(low, high)];
            dot_pair(self, a: V, c: V, bd: V) -> [V; 2] = {
                let ac = self.join(a, c);
                [madd_epi16(ac[0], bd), madd_epi16(ac[1], bd)]
            };
            dot(self, a: V, b: V, c: V, d: V) -> [V; 2] = {
                let (ac, bd) = (self.join(a, c), self.join(b, d));
                [madd_epi16(ac[0], bd[0]), madd_epi16(ac[1], bd[1])]
            };
            narrow_mask32(self, mask: [V; 2]) -> V = packs_epi32(mask[0], mask[1]);
            splat32(self, x: i32) -> V = set1_epi32(x);
            sar32_by(self, x: V, n: u8) -> V = sra_epi32(x, self.left(n));
            to_single(self, x: V) -> F = cvtepi32_ps(x);
            to_whole(self, x: F) -> V = cvtps_epi32(x);
            splat_single(self, x: f32) -> F = set1_ps(x);
            sum(self, a: V, b: V) -> [V; 2] = {
                let ([low, high], ones) = (self.widen(a, b), set1_epi8(1));
                [maddubs_epi16(low, ones), maddubs_epi16(high, ones)]
            };
            difference(self, a: V, b: V) -> [V; 2] = {
                // Bytes 1 and −1.
                let ([low, high], signs) = (self.widen(a, b), set1_epi16(-255));
                [maddubs_epi16(low, signs), maddubs_epi16(high, signs)]
            };
            add_signed(self, a: V, b: V, sign: V) -> V = self.add(a, sign_epi16(b, sign));
            scaled(self, long: V, short: V) -> Scaled<V> = {
                // The five leading bits of the longer decide the scale: with the first of them it
                // is 128, a low byte, else 256 to 4096, a high byte by the others. A set high bit
                // reads 0.
                let first = self.and(long, self.splat8(128));
                let others = self.and(srli_epi16::<3>(long), self.splat8(15));
                let others = shuffle_epi8(self.scales(), self.or(first, others));
                scaled_by(self, long, short, self.widen(first, others))
            };
            normalised(self, long: V, short: V) -> [V; 2] = {
                // The four bits below the sign decide the scale; bytes with the high bit set read 0.
                let index = self.or(srli_epi16::<11>(long), self.splat16(i16::MIN));
                let scale = shuffle_epi8(self.scales(), index);
                [self.mul_low(long, scale), self.mul_low(short, scale)]
            };
        }
        operations! { plain, always;
            bound(self, x: u8) -> V = self.splat8(x);
            all_at_least(self, x: V, bound: V) -> bool = self.none8(self.excess8(bound, x));
            all_at_most(self, x: V, bound: V) -> bool = self.none8(self.excess8(x, bound));
            bytes_of(self, x: V) -> V = x;
            sign_of(self, x: V) -> V = self.or(x, self.splat16(1));
            pick(self, mask: V, a: V, b: V) -> V = self.pick8(mask, a, b);
            pick32(self, mask: V, a: V, b: V) -> V = self.pick8(mask, a, b);
            right(self, n: u8) -> __m128i = self.left(n);
            halve(self, x: V) -> V = self.mean(x, self.splat16(0));
            narrow_rounded(self, x: [V; 2], n: u8) -> V = {
                let half = self.splat32((1_i32 << n) >> 1);
                let (low, high) = (self.add32(x[0], half), self.add32(x[1], half));
                self.narrow_mask32([self.sar32_by(low, n), self.sar32_by(high, n)])
            };
            load16(self, from: &[u16], at: usize) -> [V; 2] = [self.load_part(from, at, 0), self.load_part(from, at, 8)];
            load32(self, from: &[i32], at: usize) -> [[V; 2]; 2] = [
                [self.load_part(from, at, 0), self.load_part(from, at, 4)],
                [self.load_part(from, at, 8), self.load_part(from, at, 12)],
            ];
        }

        #[inline(always)]
        fn load8(self, from: &[u8], at: usize) -> V {
            let block = block(from, at, BYTES);
            // SAFETY: the slice holds the bytes that are read; the load needs no alignment; `self`
            // proves the instruction.
            unsafe { loadu(block.as_ptr().cast()) }
        }
        #[inline(always)]
        fn store8(self, to: &mut [u8], at: usize, x: V) {
            let block = block_mut(to, at, BYTES);
            // SAFETY: the slice holds the bytes that are written; the store needs no alignment;
            // `self` proves the instruction.
            unsafe { storeu(block.as_mut_ptr().cast(), x) }
        }
        #[inline(always)]
        fn store16(self, to: &mut [u16], at: usize, x: [V; 2]) {
            self.store_part(to, at, 0, x[0]);
            self.store_part(to, at, 8, x[1]);
        }
        #[inline(always)]
        fn store32(self, to: &mut [i32], at: usize, x: [[V; 2]; 2]) {
            self.store_part(to, at, 0, x[0][0]);
            self.store_part(to, at, 4, x[0][1]);
            self.store_part(to, at, 8, x[1][0]);
            self.store_part(to, at, 12, x[1][1]);
        }
        #[inline(always)]
        fn shl<const N: i32>(self, x: V) -> V {
            proven!(slli_epi16::<N>(x))
        }
        #[inline(always)]
        fn sar<const N: i32>(self, x: V) -> V {
            proven!(srai_epi16::<N>(x))
        }
        #[inline(always)]
        fn fetch<T>(self, row: &[T], at: usize, after: usize) {
            hint::<T, BYTES, _MM_HINT_T0>(row, at, after);
        }
        #[inline(always)]
        fn claim_ahead<T>(self, row: &[T], at: usize) {
            hint::<T, BYTES, _MM_HINT_ET0>(row, at, AHEAD);
        }
    };
}
pub(super) use shared;
