//! The back-end of x86-64 with AVX2.
//!
//! AVX2 widens within each 128-bit half of a vector: the first `W` of a block holds its pixels 0–7
//! and 16–23, the second 8–15 and 24–31. Narrowing restores the order.

mod memory;

use super::lanes::{Lanes, Scaled, operations};
use super::rows::{block, block_mut};
use super::x86::{AHEAD, hint, hint_line, scaled_by};
use core::arch::x86_64::*;
use memory::{load_halves, store_halves};

/// The proof that this machine has AVX2: only [`Avx2::detect`] makes one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// The proof, where this processor and its operating system have AVX2.
    pub fn detect() -> Option<Self> {
        #[cfg(feature = "std")]
        let there = std::is_x86_feature_detected!("avx2");
        #[cfg(not(feature = "std"))]
        let there = cfg!(target_feature = "avx2");
        there.then_some(Self(()))
    }
}

const BYTES: usize = 32;

/// Calls intrinsics of AVX2. Sound because `self` proves that the processor has it.
macro_rules! avx2 {
    ($e:expr) => {{
        // SAFETY: an `Avx2` exists only where the processor has AVX2 (`Avx2::detect`), the only
        // condition of intrinsics on values.
        unsafe { $e }
    }};
}

type B = __m256i;
type W = __m256i;
type D = __m256i;
type F = __m256;
type Count = __m128i;

impl Lanes for Avx2 {
    const PIXELS: usize = BYTES;
    const AHEAD: usize = AHEAD;
    type B = B;
    type Bound = B;
    type W = W;
    type D = D;
    type F = F;
    type Count = Count;

    operations! { avx2, always;
        splat8(self, x: u8) -> B = _mm256_set1_epi8(x.cast_signed());
        min8(self, a: B, b: B) -> B = _mm256_min_epu8(a, b);
        max8(self, a: B, b: B) -> B = _mm256_max_epu8(a, b);
        sub8(self, a: B, b: B) -> B = _mm256_sub_epi8(a, b);
        eq8(self, a: B, b: B) -> B = _mm256_cmpeq_epi8(a, b);
        and8(self, a: B, b: B) -> B = _mm256_and_si256(a, b);
        or8(self, a: B, b: B) -> B = _mm256_or_si256(a, b);
        xor8(self, a: B, b: B) -> B = _mm256_xor_si256(a, b);
        pick8(self, mask: B, a: B, b: B) -> B = _mm256_blendv_epi8(b, a, mask);
        excess8(self, a: B, b: B) -> B = _mm256_subs_epu8(a, b);
        widen(self, low: B, high: B) -> [W; 2] = [_mm256_unpacklo_epi8(low, high), _mm256_unpackhi_epi8(low, high)];
        narrow_mask(self, mask: [W; 2]) -> B = _mm256_packs_epi16(mask[0], mask[1]);
        splat16(self, x: i16) -> W = _mm256_set1_epi16(x);
        add(self, a: W, b: W) -> W = _mm256_add_epi16(a, b);
        sub(self, a: W, b: W) -> W = _mm256_sub_epi16(a, b);
        add_sat(self, a: W, b: W) -> W = _mm256_adds_epi16(a, b);
        mul_q15(self, a: W, b: W) -> W = _mm256_mulhrs_epi16(a, b);
        mul_low(self, a: W, b: W) -> W = _mm256_mullo_epi16(a, b);
        sign_of(self, x: W) -> W = _mm256_or_si256(x, _mm256_set1_epi16(1));
        left(self, n: u8) -> Count = _mm_cvtsi32_si128(i32::from(n));
        shl_by(self, x: W, n: Count) -> W = _mm256_sll_epi16(x, n);
        sar_by(self, x: W, n: Count) -> W = _mm256_sra_epi16(x, n);
        shr_by(self, x: W, n: Count) -> W = _mm256_srl_epi16(x, n);
        halve(self, x: W) -> W = _mm256_avg_epu16(x, _mm256_setzero_si256());
        mean(self, a: W, b: W) -> W = _mm256_avg_epu16(a, b);
        abs(self, x: W) -> W = _mm256_abs_epi16(x);
        excess(self, a: W, b: W) -> W = _mm256_subs_epu16(a, b);
        min(self, a: W, b: W) -> W = _mm256_min_epi16(a, b);
        max(self, a: W, b: W) -> W = _mm256_max_epi16(a, b);
        max_unsigned(self, a: W, b: W) -> W = _mm256_max_epu16(a, b);
        gt(self, a: W, b: W) -> W = _mm256_cmpgt_epi16(a, b);
        eq(self, a: W, b: W) -> W = _mm256_cmpeq_epi16(a, b);
        and(self, a: W, b: W) -> W = _mm256_and_si256(a, b);
        or(self, a: W, b: W) -> W = _mm256_or_si256(a, b);
        xor(self, a: W, b: W) -> W = _mm256_xor_si256(a, b);
        pick(self, mask: W, a: W, b: W) -> W = _mm256_blendv_epi8(b, a, mask);
        join(self, low: W, high: W) -> [D; 2] = [_mm256_unpacklo_epi16(low, high), _mm256_unpackhi_epi16(low, high)];
        narrow_mask32(self, mask: [D; 2]) -> W = _mm256_packs_epi32(mask[0], mask[1]);
        splat32(self, x: i32) -> D = _mm256_set1_epi32(x);
        add32(self, a: D, b: D) -> D = _mm256_add_epi32(a, b);
        sar32_by(self, x: D, n: u8) -> D = _mm256_sra_epi32(x, _mm_cvtsi32_si128(i32::from(n)));
        gt32(self, a: D, b: D) -> D = _mm256_cmpgt_epi32(a, b);
        pick32(self, mask: D, a: D, b: D) -> D = _mm256_blendv_epi8(b, a, mask);
        to_single(self, x: D) -> F = _mm256_cvtepi32_ps(x);
        to_whole(self, x: F) -> D = _mm256_cvtps_epi32(x);
        splat_single(self, x: f32) -> F = _mm256_set1_ps(x);
        mul_single(self, a: F, b: F) -> F = _mm256_mul_ps(a, b);
    }

    #[inline(always)]
    fn load8(self, from: &[u8], at: usize) -> Self::B {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 32 bytes that are read; the load needs no alignment; `self`
        // proves AVX2.
        unsafe { _mm256_loadu_si256(block.as_ptr().cast()) }
    }
    #[inline(always)]
    fn fetch<T>(self, row: &[T], at: usize, after: usize) {
        hint::<T, BYTES, _MM_HINT_T0>(row, at, after);
    }
    #[inline(always)]
    fn fetch_line<T>(self, row: &[T], at: usize) {
        hint_line(row, at);
    }
    #[inline(always)]
    fn claim_ahead<T>(self, row: &[T], at: usize) {
        hint::<T, BYTES, _MM_HINT_ET0>(row, at, AHEAD);
    }
    #[inline(always)]
    fn store8(self, to: &mut [u8], at: usize, x: Self::B) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 32 bytes that are written; the store needs no alignment;
        // `self` proves AVX2.
        unsafe { _mm256_storeu_si256(block.as_mut_ptr().cast(), x) }
    }
    #[inline(always)]
    fn bound(self, x: u8) -> Self::Bound {
        self.splat8(x)
    }
    #[inline(always)]
    fn all_at_least(self, x: Self::B, bound: Self::Bound) -> bool {
        self.none8(self.excess8(bound, x))
    }
    #[inline(always)]
    fn all_at_most(self, x: Self::B, bound: Self::Bound) -> bool {
        self.none8(self.excess8(x, bound))
    }
    #[inline(always)]
    fn all8(self, mask: Self::B) -> bool {
        avx2!(_mm256_movemask_epi8(mask)) == -1
    }

    #[inline(always)]
    fn none8(self, bytes: Self::B) -> bool {
        avx2!(_mm256_testz_si256(bytes, bytes)) == 1
    }

    #[inline(always)]
    fn bytes_of(self, x: Self::W) -> Self::B {
        x
    }
    #[inline(always)]
    fn sum(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        let [low, high] = self.widen(a, b);
        avx2!({
            let ones = _mm256_set1_epi8(1);
            [
                _mm256_maddubs_epi16(low, ones),
                _mm256_maddubs_epi16(high, ones),
            ]
        })
    }
    #[inline(always)]
    fn difference(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        let [low, high] = self.widen(a, b);
        avx2!({
            // Bytes 1 and −1.
            let signs = _mm256_set1_epi16(-255);
            [
                _mm256_maddubs_epi16(low, signs),
                _mm256_maddubs_epi16(high, signs),
            ]
        })
    }
    #[inline(always)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        // The five leading bits of the longer decide the scale: with the first of them it is 128, a
        // low byte, else 256 to 4096, a high byte by the others. A set high bit reads 0.
        let scale = avx2!({
            let table = _mm256_setr_epi8(
                16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, //
                16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1,
            );
            let first = _mm256_and_si256(long, _mm256_set1_epi8(-128));
            let others = _mm256_and_si256(_mm256_srli_epi16::<3>(long), _mm256_set1_epi8(15));
            let index = _mm256_or_si256(first, others);
            self.widen(first, _mm256_shuffle_epi8(table, index))
        });
        scaled_by(self, long, short, scale)
    }
    #[inline(always)]
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2] {
        [load_halves(from, at, 0, 16), load_halves(from, at, 8, 24)]
    }
    #[inline(always)]
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]) {
        store_halves(to, at, 0, 16, x[0]);
        store_halves(to, at, 8, 24, x[1]);
    }
    #[inline(always)]
    fn add_signed(self, a: Self::W, b: Self::W, sign: Self::W) -> Self::W {
        self.add(a, avx2!(_mm256_sign_epi16(b, sign)))
    }
    #[inline(always)]
    fn shl<const N: i32>(self, x: Self::W) -> Self::W {
        avx2!(_mm256_slli_epi16::<N>(x))
    }
    #[inline(always)]
    fn sar<const N: i32>(self, x: Self::W) -> Self::W {
        avx2!(_mm256_srai_epi16::<N>(x))
    }
    #[inline(always)]
    fn normalised(self, long: Self::W, short: Self::W) -> [Self::W; 2] {
        // The four bits below the sign decide the scale; bytes with the high bit set read 0.
        let scale = avx2!({
            let table = _mm256_setr_epi8(
                16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, //
                16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1,
            );
            let index = _mm256_or_si256(_mm256_srli_epi16::<11>(long), _mm256_set1_epi16(i16::MIN));
            _mm256_shuffle_epi8(table, index)
        });
        [self.mul_low(long, scale), self.mul_low(short, scale)]
    }
    #[inline(always)]
    fn right(self, n: u8) -> Self::Count {
        self.left(n)
    }
    #[inline(always)]
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W) {
        avx2!({
            let low0 = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(x[0]));
            let low1 = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(x[1]));
            let high0 = _mm256_srai_epi32::<16>(x[0]);
            let high1 = _mm256_srai_epi32::<16>(x[1]);
            (
                _mm256_packs_epi32(low0, low1),
                _mm256_packs_epi32(high0, high1),
            )
        })
    }
    #[inline(always)]
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2] {
        let (ac, bd) = (self.join(a, c), self.join(b, d));
        avx2!([
            _mm256_madd_epi16(ac[0], bd[0]),
            _mm256_madd_epi16(ac[1], bd[1])
        ])
    }
    #[inline(always)]
    fn dot_pair(self, a: Self::W, c: Self::W, bd: Self::D) -> [Self::D; 2] {
        let ac = self.join(a, c);
        avx2!([_mm256_madd_epi16(ac[0], bd), _mm256_madd_epi16(ac[1], bd)])
    }
    #[inline(always)]
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        avx2!({
            let half = _mm256_set1_epi32((1_i32 << n) >> 1);
            let n = _mm_cvtsi32_si128(i32::from(n));
            _mm256_packs_epi32(
                _mm256_sra_epi32(_mm256_add_epi32(x[0], half), n),
                _mm256_sra_epi32(_mm256_add_epi32(x[1], half), n),
            )
        })
    }
    #[inline(always)]
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2] {
        [
            [load_halves(from, at, 0, 16), load_halves(from, at, 4, 20)],
            [load_halves(from, at, 8, 24), load_halves(from, at, 12, 28)],
        ]
    }
    #[inline(always)]
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]) {
        store_halves(to, at, 0, 16, x[0][0]);
        store_halves(to, at, 4, 20, x[0][1]);
        store_halves(to, at, 8, 24, x[1][0]);
        store_halves(to, at, 12, 28, x[1][1]);
    }
}
