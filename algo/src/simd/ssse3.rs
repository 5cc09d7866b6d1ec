//! The back-end of x86-64 with SSSE3, for processors without AVX2.
//!
//! Every operation is that of AVX2 on half as many pixels. Three of the instructions that AVX2 uses
//! have no form in SSSE3 (they came with SSE4.1) and are composed here: picking by a mask, the
//! larger of unsigned words, and the test for zero.

use super::lanes::{Lanes, Scaled, operations, pairs, plain};
use super::rows::{block, block_mut};
use super::x86::{AHEAD, hint, proof, proven, scaled_by, shared};
use core::arch::x86_64::*;
use core::arch::x86_64::{
    _mm_abs_epi16 as abs_epi16, _mm_cvtepi32_ps as cvtepi32_ps, _mm_cvtps_epi32 as cvtps_epi32,
    _mm_loadu_si128 as loadu, _mm_madd_epi16 as madd_epi16, _mm_maddubs_epi16 as maddubs_epi16,
    _mm_packs_epi16 as packs_epi16, _mm_packs_epi32 as packs_epi32, _mm_set1_epi8 as set1_epi8,
    _mm_set1_epi16 as set1_epi16, _mm_set1_epi32 as set1_epi32, _mm_set1_ps as set1_ps,
    _mm_shuffle_epi8 as shuffle_epi8, _mm_sign_epi16 as sign_epi16, _mm_sll_epi16 as sll_epi16,
    _mm_slli_epi16 as slli_epi16, _mm_sra_epi16 as sra_epi16, _mm_sra_epi32 as sra_epi32,
    _mm_srai_epi16 as srai_epi16, _mm_srl_epi16 as srl_epi16, _mm_srli_epi16 as srli_epi16,
    _mm_storeu_si128 as storeu, _mm_unpackhi_epi8 as unpackhi_epi8,
    _mm_unpackhi_epi16 as unpackhi_epi16, _mm_unpacklo_epi8 as unpacklo_epi8,
    _mm_unpacklo_epi16 as unpacklo_epi16,
};

proof! {
    /// The proof that this machine has SSSE3: only [`Ssse3::detect`] makes one.
    Ssse3 = "ssse3"
}

const BYTES: usize = 16;

type V = __m128i;
type F = __m128;

impl Ssse3 {
    /// The vector of the elements from `part` of the block at `at`.
    #[inline(always)]
    fn load_part<T>(self, from: &[T], at: usize, part: usize) -> V {
        let part = &block(from, at, BYTES)[part..];
        assert!(size_of_val(part) >= 16);
        // SAFETY: the slice holds at least 16 bytes, asserted above; the load needs no alignment.
        unsafe { loadu(part.as_ptr().cast()) }
    }

    /// Stores a vector as [`Self::load_part`] loads it.
    #[inline(always)]
    fn store_part<T>(self, to: &mut [T], at: usize, part: usize, x: V) {
        let part = &mut block_mut(to, at, BYTES)[part..];
        assert!(size_of_val(part) >= 16);
        // SAFETY: the slice holds at least 16 bytes, asserted above; the store needs no alignment.
        unsafe { storeu(part.as_mut_ptr().cast(), x) }
    }

    #[inline(always)]
    fn scales(self) -> V {
        proven!(_mm_setr_epi8(
            16, 8, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1,
        ))
    }
}

impl Lanes for Ssse3 {
    shared!();

    pairs! { proven, always, V;
        min8 = _mm_min_epu8;
        max8 = _mm_max_epu8;
        sub8 = _mm_sub_epi8;
        excess8 = _mm_subs_epu8;
        eq8 = _mm_cmpeq_epi8;
        and8 = _mm_and_si128;
        or8 = _mm_or_si128;
        xor8 = _mm_xor_si128;
        add = _mm_add_epi16;
        sub = _mm_sub_epi16;
        add_sat = _mm_adds_epi16;
        mul_q15 = _mm_mulhrs_epi16;
        mul_low = _mm_mullo_epi16;
        mean = _mm_avg_epu16;
        excess = _mm_subs_epu16;
        min = _mm_min_epi16;
        max = _mm_max_epi16;
        gt = _mm_cmpgt_epi16;
        eq = _mm_cmpeq_epi16;
        and = _mm_and_si128;
        or = _mm_or_si128;
        xor = _mm_xor_si128;
        add32 = _mm_add_epi32;
        gt32 = _mm_cmpgt_epi32;
    }
    pairs! { proven, always, F; mul_single = _mm_mul_ps; }

    operations! { proven, always;
        pick8(self, mask: V, a: V, b: V) -> V = _mm_or_si128(_mm_and_si128(mask, a), _mm_andnot_si128(mask, b));
        max_unsigned(self, a: V, b: V) -> V = _mm_add_epi16(a, _mm_subs_epu16(b, a));
        all8(self, mask: V) -> bool = _mm_movemask_epi8(mask) == 0xFFFF;
        split(self, x: [V; 2]) -> (V, V) = {
            // The low words of each, then the high words.
            let apart = _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
            let (a, b) = (shuffle_epi8(x[0], apart), shuffle_epi8(x[1], apart));
            (_mm_unpacklo_epi64(a, b), _mm_unpackhi_epi64(a, b))
        };
    }

    operations! { plain, always;
        // Picked by exclusive or, because kernels need that of both masks, too.
        quarters8(self, mask: V, s: V, c: V) -> V = {
            let picked = self.xor8(c, self.and8(mask, self.xor8(s, c)));
            let half = self.and8(picked, self.splat8(128));
            self.or8(half, self.and8(mask, self.splat8(64)))
        };
        none8(self, bytes: V) -> bool = self.all8(self.eq8(bytes, self.splat8(0)));
        none_below(self, a: V, b: V) -> bool = self.all8(self.gt(a, self.sub(b, self.splat16(1))));
    }
}
