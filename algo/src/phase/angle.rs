//! The angle and the length of a folded pointer, in words.
//!
//! t = short/long by a quadratic approximation of the reciprocal and one residual step; arctangent by a polynomial of
//! degree 5 at 1/131072 turn, so that its roundings stay below the last bit. No table, no division, no estimate that
//! differs from machine to machine.
//!
//! Largest error over all pairs of 8-bit differences of a trusted pixel 2.24e-5 turn, RMS 6.3e-6
//! (`every_pair_of_8_bit_differences_is_within_the_bound`).

use crate::simd::Lanes;
use core::hint::black_box;

/// 1/(8x) on ½ ≤ x < 1 in Q15, from the constant to the square: relative error 1 %. Minimax; the last digits of this and of
/// the arctangent by search over all pairs of 8-bit differences.
const EIGHTH_OF_RECIPROCAL: [i16; 3] = [17_388, -23_839, 10_587];
/// atan(t)/2π on 0 ≤ t ≤ 1 in 1/131072 turn, from the first power of t to the fifth: error 4e-6 turn.
const ARCTANGENT: [i16; 5] = [20_834, 435, -9_271, 5_365, -978];
/// √(1 + t²) on 0 ≤ t ≤ 1 in powers of t²: relative error 6.5e-4.
pub(super) const LENGTH: [f64; 3] = [1.000_644, 0.484_927, -0.072_269];

/// The constants in all lanes.
pub(super) struct AngleLanes<V: Lanes> {
    reciprocal: [V::W; 3],
    arctangent: [V::W; 5],
    most: V::W,
}

impl<V: Lanes> AngleLanes<V> {
    #[inline(always)]
    pub fn new(v: V) -> Self {
        // Hidden from the compiler, or it makes them anew at every use instead of reading them from memory.
        let [r0, r1, r2] = black_box(EIGHTH_OF_RECIPROCAL);
        let [c1, c2, c3, c4, c5] = black_box(ARCTANGENT);
        Self {
            reciprocal: [v.splat16(r0), v.splat16(r1), v.splat16(r2)],
            arctangent: [
                v.splat16(c1),
                v.splat16(c2),
                v.splat16(c3),
                v.splat16(c4),
                v.splat16(c5),
            ],
            most: v.splat16(black_box(4095)),
        }
    }

    /// short/long in Q15, at most 32767, for ½ ≤ long < 1 in Q15 and 0 ≤ short ≤ long.
    #[inline(always)]
    pub fn quotient(&self, v: V, short: V::W, long: V::W) -> V::W {
        let [c0, c1, c2] = self.reciprocal;
        let eighth = v.add(v.mul_q15(long, c2), c1);
        let eighth = v.add(v.mul_q15(long, eighth), c0);
        // At most 4095, so that eight times it stays a word.
        let first = v.min(v.mul_q15(short, eighth), self.most);
        let first = v.shl::<3>(first);
        let missing = v.sub(short, v.mul_q15(first, long));
        v.add_sat(first, v.mul_q15(v.shl::<3>(missing), eighth))
    }

    /// atan(t)/2π in 1/65536 turn, rounded; t in Q15.
    #[inline(always)]
    pub fn arctangent(&self, v: V, t: V::W) -> V::W {
        let [c1, c2, c3, c4, c5] = self.arctangent;
        let sum = v.add(v.mul_q15(t, c5), c4);
        let sum = v.add(v.mul_q15(t, sum), c3);
        let sum = v.add(v.mul_q15(t, sum), c2);
        let sum = v.add(v.mul_q15(t, sum), c1);
        v.halve(v.mul_q15(t, sum))
    }
}

/// length · √(1 + t²) · (what `coefficients` have been multiplied by).
#[inline(always)]
pub(super) fn hypotenuse<V: Lanes>(v: V, length: V::W, t: V::W, coefficients: [V::W; 3]) -> V::W {
    let [c0, c1, c2] = coefficients;
    let square = v.mul_q15(t, t);
    let root = v.add(v.mul_q15(square, c2), c1);
    let root = v.add(v.mul_q15(square, root), c0);
    v.mul_q15(length, root)
}
