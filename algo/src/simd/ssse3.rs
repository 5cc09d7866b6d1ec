//! The back-end of x86-64 with SSSE3, for processors without AVX2.
//!
//! Every operation is that of AVX2 on half as many pixels. Three of the instructions that AVX2 uses
//! have no form in SSSE3 (they came with SSE4.1) and are composed here: picking by a mask, the
//! larger of unsigned words, and the test for zero.

use super::lanes::{Lanes, Scaled, operations};
use super::rows::{block, block_mut};
use super::x86::{AHEAD, hint, hint_line, scaled_by};
use core::arch::x86_64::*;

/// The proof that this machine has SSSE3: only [`Ssse3::detect`] makes one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ssse3(());

impl Ssse3 {
    /// The proof, where this processor has SSSE3.
    pub fn detect() -> Option<Self> {
        #[cfg(feature = "std")]
        let there = std::is_x86_feature_detected!("ssse3");
        #[cfg(not(feature = "std"))]
        let there = cfg!(target_feature = "ssse3");
        there.then_some(Self(()))
    }
}

const BYTES: usize = 16;

/// Calls intrinsics of SSSE3. Sound because `self` proves that the processor has it.
macro_rules! ssse3 {
    ($e:expr) => {{
        // SAFETY: an `Ssse3` exists only where the processor has SSSE3 (`Ssse3::detect`), the only
        // condition of intrinsics on values.
        unsafe { $e }
    }};
}

type B = __m128i;
type W = __m128i;
type D = __m128i;
type F = __m128;
type Count = __m128i;

impl Lanes for Ssse3 {
    const PIXELS: usize = BYTES;
    const AHEAD: usize = AHEAD;
    type B = B;
    type Bound = B;
    type W = W;
    type D = D;
    type F = F;
    type Count = Count;

    operations! { ssse3, always;
        splat8(self, x: u8) -> B = _mm_set1_epi8(x.cast_signed());
        min8(self, a: B, b: B) -> B = _mm_min_epu8(a, b);
        max8(self, a: B, b: B) -> B = _mm_max_epu8(a, b);
        sub8(self, a: B, b: B) -> B = _mm_sub_epi8(a, b);
        excess8(self, a: B, b: B) -> B = _mm_subs_epu8(a, b);
        eq8(self, a: B, b: B) -> B = _mm_cmpeq_epi8(a, b);
        and8(self, a: B, b: B) -> B = _mm_and_si128(a, b);
        or8(self, a: B, b: B) -> B = _mm_or_si128(a, b);
        xor8(self, a: B, b: B) -> B = _mm_xor_si128(a, b);
        pick8(self, mask: B, a: B, b: B) -> B = _mm_or_si128(_mm_and_si128(mask, a), _mm_andnot_si128(mask, b));
        widen(self, low: B, high: B) -> [W; 2] = [_mm_unpacklo_epi8(low, high), _mm_unpackhi_epi8(low, high)];
        narrow_mask(self, mask: [W; 2]) -> B = _mm_packs_epi16(mask[0], mask[1]);
        splat16(self, x: i16) -> W = _mm_set1_epi16(x);
        add(self, a: W, b: W) -> W = _mm_add_epi16(a, b);
        sub(self, a: W, b: W) -> W = _mm_sub_epi16(a, b);
        add_sat(self, a: W, b: W) -> W = _mm_adds_epi16(a, b);
        mul_q15(self, a: W, b: W) -> W = _mm_mulhrs_epi16(a, b);
        mul_low(self, a: W, b: W) -> W = _mm_mullo_epi16(a, b);
        sign_of(self, x: W) -> W = _mm_or_si128(x, _mm_set1_epi16(1));
        left(self, n: u8) -> Count = _mm_cvtsi32_si128(i32::from(n));
        shl_by(self, x: W, n: Count) -> W = _mm_sll_epi16(x, n);
        sar_by(self, x: W, n: Count) -> W = _mm_sra_epi16(x, n);
        shr_by(self, x: W, n: Count) -> W = _mm_srl_epi16(x, n);
        halve(self, x: W) -> W = _mm_avg_epu16(x, _mm_setzero_si128());
        mean(self, a: W, b: W) -> W = _mm_avg_epu16(a, b);
        abs(self, x: W) -> W = _mm_abs_epi16(x);
        min(self, a: W, b: W) -> W = _mm_min_epi16(a, b);
        max(self, a: W, b: W) -> W = _mm_max_epi16(a, b);
        max_unsigned(self, a: W, b: W) -> W = _mm_add_epi16(a, _mm_subs_epu16(b, a));
        gt(self, a: W, b: W) -> W = _mm_cmpgt_epi16(a, b);
        eq(self, a: W, b: W) -> W = _mm_cmpeq_epi16(a, b);
        and(self, a: W, b: W) -> W = _mm_and_si128(a, b);
        or(self, a: W, b: W) -> W = _mm_or_si128(a, b);
        xor(self, a: W, b: W) -> W = _mm_xor_si128(a, b);
        pick(self, mask: W, a: W, b: W) -> W = _mm_or_si128(_mm_and_si128(mask, a), _mm_andnot_si128(mask, b));
        join(self, low: W, high: W) -> [D; 2] = [_mm_unpacklo_epi16(low, high), _mm_unpackhi_epi16(low, high)];
        narrow_mask32(self, mask: [D; 2]) -> W = _mm_packs_epi32(mask[0], mask[1]);
        splat32(self, x: i32) -> D = _mm_set1_epi32(x);
        add32(self, a: D, b: D) -> D = _mm_add_epi32(a, b);
        sar32_by(self, x: D, n: u8) -> D = _mm_sra_epi32(x, _mm_cvtsi32_si128(i32::from(n)));
        gt32(self, a: D, b: D) -> D = _mm_cmpgt_epi32(a, b);
        pick32(self, mask: D, a: D, b: D) -> D = _mm_or_si128(_mm_and_si128(mask, a), _mm_andnot_si128(mask, b));
        to_single(self, x: D) -> F = _mm_cvtepi32_ps(x);
        to_whole(self, x: F) -> D = _mm_cvtps_epi32(x);
        splat_single(self, x: f32) -> F = _mm_set1_ps(x);
        mul_single(self, a: F, b: F) -> F = _mm_mul_ps(a, b);
    }

    #[inline(always)]
    fn load8(self, from: &[u8], at: usize) -> Self::B {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 bytes that are read; the load needs no alignment; `self`
        // proves SSSE3.
        unsafe { _mm_loadu_si128(block.as_ptr().cast()) }
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
        // SAFETY: the slice holds the 16 bytes that are written; the store needs no alignment;
        // `self` proves SSSE3.
        unsafe { _mm_storeu_si128(block.as_mut_ptr().cast(), x) }
    }
    #[inline(always)]
    fn quarters8(self, mask: Self::B, s: Self::B, c: Self::B) -> Self::B {
        // Picked by exclusive or, because kernels need that of both masks, too.
        let picked = self.xor8(c, self.and8(mask, self.xor8(s, c)));
        let half = self.and8(picked, self.splat8(128));
        self.or8(half, self.and8(mask, self.splat8(64)))
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
        ssse3!(_mm_movemask_epi8(mask)) == 0xFFFF
    }
    #[inline(always)]
    fn none8(self, bytes: Self::B) -> bool {
        let zero = self.splat8(0);
        self.all8(self.eq8(bytes, zero))
    }
    #[inline(always)]
    fn none_below(self, a: Self::W, b: Self::W) -> bool {
        self.all8(self.gt(a, self.sub(b, self.splat16(1))))
    }
    #[inline(always)]
    fn bytes_of(self, mask: Self::W) -> Self::B {
        mask
    }
    #[inline(always)]
    fn sum(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        let [low, high] = self.widen(a, b);
        ssse3!({
            let ones = _mm_set1_epi8(1);
            [_mm_maddubs_epi16(low, ones), _mm_maddubs_epi16(high, ones)]
        })
    }
    #[inline(always)]
    fn difference(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        let [low, high] = self.widen(a, b);
        ssse3!({
            // Bytes 1 and −1.
            let signs = _mm_set1_epi16(-255);
            [
                _mm_maddubs_epi16(low, signs),
                _mm_maddubs_epi16(high, signs),
            ]
        })
    }
    #[inline(always)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        // The five leading bits of the longer decide the scale: with the first of them it is 128, a
        // low byte, else 256 to 4096, a high byte by the others. A set high bit reads 0.
        let scale = ssse3!({
            let table = _mm_setr_epi8(16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1);
            let first = _mm_and_si128(long, _mm_set1_epi8(-128));
            let others = _mm_and_si128(_mm_srli_epi16::<3>(long), _mm_set1_epi8(15));
            let index = _mm_or_si128(first, others);
            self.widen(first, _mm_shuffle_epi8(table, index))
        });
        scaled_by(self, long, short, scale)
    }
    #[inline(always)]
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2] {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 words that are read, 8 at a time; as `load8`.
        unsafe {
            let start = block.as_ptr();
            [
                _mm_loadu_si128(start.cast()),
                _mm_loadu_si128(start.add(8).cast()),
            ]
        }
    }
    #[inline(always)]
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 16 words that are written, 8 at a time; as `store8`.
        unsafe {
            let start = block.as_mut_ptr();
            _mm_storeu_si128(start.cast(), x[0]);
            _mm_storeu_si128(start.add(8).cast(), x[1]);
        }
    }
    #[inline(always)]
    fn add_signed(self, a: Self::W, b: Self::W, sign: Self::W) -> Self::W {
        self.add(a, ssse3!(_mm_sign_epi16(b, sign)))
    }
    #[inline(always)]
    fn shl<const N: i32>(self, x: Self::W) -> Self::W {
        ssse3!(_mm_slli_epi16::<N>(x))
    }
    #[inline(always)]
    fn sar<const N: i32>(self, x: Self::W) -> Self::W {
        ssse3!(_mm_srai_epi16::<N>(x))
    }
    #[inline(always)]
    fn normalised(self, long: Self::W, short: Self::W) -> [Self::W; 2] {
        // The four bits below the sign decide the scale; bytes with the high bit set read 0.
        let scale = ssse3!({
            let table = _mm_setr_epi8(16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1);
            let index = _mm_or_si128(_mm_srli_epi16::<11>(long), _mm_set1_epi16(i16::MIN));
            _mm_shuffle_epi8(table, index)
        });
        [self.mul_low(long, scale), self.mul_low(short, scale)]
    }
    #[inline(always)]
    fn right(self, n: u8) -> Self::Count {
        self.left(n)
    }
    #[inline(always)]
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W) {
        ssse3!({
            // The low words of each, then the high words.
            let apart = _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
            let (a, b) = (_mm_shuffle_epi8(x[0], apart), _mm_shuffle_epi8(x[1], apart));
            (_mm_unpacklo_epi64(a, b), _mm_unpackhi_epi64(a, b))
        })
    }
    #[inline(always)]
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2] {
        let (ac, bd) = (self.join(a, c), self.join(b, d));
        ssse3!([_mm_madd_epi16(ac[0], bd[0]), _mm_madd_epi16(ac[1], bd[1])])
    }
    #[inline(always)]
    fn dot_pair(self, a: Self::W, c: Self::W, bd: Self::D) -> [Self::D; 2] {
        let ac = self.join(a, c);
        ssse3!([_mm_madd_epi16(ac[0], bd), _mm_madd_epi16(ac[1], bd)])
    }
    #[inline(always)]
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        ssse3!({
            let half = _mm_set1_epi32((1_i32 << n) >> 1);
            let n = _mm_cvtsi32_si128(i32::from(n));
            _mm_packs_epi32(
                _mm_sra_epi32(_mm_add_epi32(x[0], half), n),
                _mm_sra_epi32(_mm_add_epi32(x[1], half), n),
            )
        })
    }
    #[inline(always)]
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2] {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 double words that are read, 4 at a time; as `load8`.
        unsafe {
            let start = block.as_ptr();
            [
                [
                    _mm_loadu_si128(start.cast()),
                    _mm_loadu_si128(start.add(4).cast()),
                ],
                [
                    _mm_loadu_si128(start.add(8).cast()),
                    _mm_loadu_si128(start.add(12).cast()),
                ],
            ]
        }
    }
    #[inline(always)]
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 16 double words that are written, 4 at a time; as `store8`.
        unsafe {
            let start = block.as_mut_ptr();
            _mm_storeu_si128(start.cast(), x[0][0]);
            _mm_storeu_si128(start.add(4).cast(), x[0][1]);
            _mm_storeu_si128(start.add(8).cast(), x[1][0]);
            _mm_storeu_si128(start.add(12).cast(), x[1][1]);
        }
    }
}
