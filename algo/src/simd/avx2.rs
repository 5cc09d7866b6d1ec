//! The back-end of x86-64 with AVX2.
//!
//! AVX2 widens within each 128-bit half of a vector: the first `W` of a block holds its pixels 0–7
//! and 16–23, the second 8–15 and 24–31. Narrowing restores the order.

use super::lanes::{Lanes, Scaled, operations, pairs, plain};
use super::rows::{block, block_mut};
use super::x86::{AHEAD, hint, proof, proven, scaled_by, shared};
use core::arch::x86_64::*;
use core::arch::x86_64::{
    _mm256_abs_epi16 as abs_epi16, _mm256_cvtepi32_ps as cvtepi32_ps,
    _mm256_cvtps_epi32 as cvtps_epi32, _mm256_loadu_si256 as loadu,
    _mm256_madd_epi16 as madd_epi16, _mm256_maddubs_epi16 as maddubs_epi16,
    _mm256_packs_epi16 as packs_epi16, _mm256_packs_epi32 as packs_epi32,
    _mm256_set1_epi8 as set1_epi8, _mm256_set1_epi16 as set1_epi16,
    _mm256_set1_epi32 as set1_epi32, _mm256_set1_ps as set1_ps,
    _mm256_shuffle_epi8 as shuffle_epi8, _mm256_sign_epi16 as sign_epi16,
    _mm256_sll_epi16 as sll_epi16, _mm256_slli_epi16 as slli_epi16, _mm256_sra_epi16 as sra_epi16,
    _mm256_sra_epi32 as sra_epi32, _mm256_srai_epi16 as srai_epi16, _mm256_srl_epi16 as srl_epi16,
    _mm256_srli_epi16 as srli_epi16, _mm256_storeu_si256 as storeu,
    _mm256_unpackhi_epi8 as unpackhi_epi8, _mm256_unpackhi_epi16 as unpackhi_epi16,
    _mm256_unpacklo_epi8 as unpacklo_epi8, _mm256_unpacklo_epi16 as unpacklo_epi16,
};

proof! {
    /// The proof that this machine has AVX2: only [`Avx2::detect`] makes one.
    Avx2 = "avx2"
}

const BYTES: usize = 32;

type V = __m256i;
type F = __m256;

impl Avx2 {
    /// The vector whose lower and upper 128 bits are the elements from `part` and from `part` + 16
    /// of the block at `at`.
    #[inline(always)]
    fn load_part<T>(self, from: &[T], at: usize, part: usize) -> V {
        let block = block(from, at, BYTES);
        let (low, high) = (&block[part..], &block[part + 16..]);
        assert!(size_of_val(low) >= 16 && size_of_val(high) >= 16);
        // SAFETY: both slices hold at least 16 bytes, asserted above; the loads need no alignment;
        // `self` proves AVX2.
        unsafe { _mm256_loadu2_m128i(high.as_ptr().cast(), low.as_ptr().cast()) }
    }

    /// Stores the lower and upper 128 bits of a vector as [`Self::load_part`] loads them.
    #[inline(always)]
    fn store_part<T>(self, to: &mut [T], at: usize, part: usize, x: V) {
        let block = block_mut(to, at, BYTES);
        assert!(
            size_of_val(&block[part..part + 16]) >= 16 && size_of_val(&block[part + 16..]) >= 16
        );
        // SAFETY: at least 16 bytes follow both places, asserted above, and the first place ends
        // before the second; the stores need no alignment; `self` proves AVX2.
        unsafe {
            let start = block.as_mut_ptr();
            _mm256_storeu2_m128i(start.add(part + 16).cast(), start.add(part).cast(), x);
        }
    }

    #[inline(always)]
    fn scales(self) -> V {
        proven!(_mm256_setr_epi8(
            16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, //
            16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1,
        ))
    }
}

impl Lanes for Avx2 {
    shared!();

    pairs! { proven, always, V;
        min8 = _mm256_min_epu8;
        max8 = _mm256_max_epu8;
        sub8 = _mm256_sub_epi8;
        excess8 = _mm256_subs_epu8;
        eq8 = _mm256_cmpeq_epi8;
        and8 = _mm256_and_si256;
        or8 = _mm256_or_si256;
        xor8 = _mm256_xor_si256;
        add = _mm256_add_epi16;
        sub = _mm256_sub_epi16;
        add_sat = _mm256_adds_epi16;
        mul_q15 = _mm256_mulhrs_epi16;
        mul_low = _mm256_mullo_epi16;
        mean = _mm256_avg_epu16;
        excess = _mm256_subs_epu16;
        min = _mm256_min_epi16;
        max = _mm256_max_epi16;
        max_unsigned = _mm256_max_epu16;
        gt = _mm256_cmpgt_epi16;
        eq = _mm256_cmpeq_epi16;
        and = _mm256_and_si256;
        or = _mm256_or_si256;
        xor = _mm256_xor_si256;
        add32 = _mm256_add_epi32;
        gt32 = _mm256_cmpgt_epi32;
    }
    pairs! { proven, always, F; mul_single = _mm256_mul_ps; }

    operations! { proven, always;
        pick8(self, mask: V, a: V, b: V) -> V = _mm256_blendv_epi8(b, a, mask);
        all8(self, mask: V) -> bool = _mm256_movemask_epi8(mask) == -1;
        none8(self, bytes: V) -> bool = _mm256_testz_si256(bytes, bytes) == 1;
        split(self, x: [V; 2]) -> (V, V) = {
            let low0 = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(x[0]));
            let low1 = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(x[1]));
            let high0 = _mm256_srai_epi32::<16>(x[0]);
            let high1 = _mm256_srai_epi32::<16>(x[1]);
            (packs_epi32(low0, low1), packs_epi32(high0, high1))
        };
    }
}
