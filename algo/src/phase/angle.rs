//! The angle and the length of a folded pointer, in words.
//!
//! Half of t = short/long by a polynomial for 1/(2 long) about the middle of its range, in two qualities. Fine: a quadratic and
//! one residual step, then the arctangent by a polynomial of degree 5 at 1/131072 turn, so that its roundings stay below the
//! last bit. Rough, for levels that only give the fringe order of the next: a cubic and an arctangent of degree 3. No table,
//! no division, no estimate that differs from machine to machine.
//!
//! Over all pairs of 8-bit differences of a trusted pixel the fine angle is off by at most 2.24e-5 turn, RMS 6.2e-6
//! (`every_pair_of_8_bit_differences_is_within_the_bound`), the rough one by at most 3.2e-4
//! (`every_rough_angle_is_within_the_bound`).

use super::fold::Folded;
use crate::simd::Lanes;
use core::hint::black_box;

/// 1/(2x) in Q15 for x = (3 + d)/4, −1 ≤ d < 1, from the constant to the square: relative error 1 %. Minimax; the last digits
/// of all constants here by search over all pairs of 8-bit differences.
const RECIPROCAL: [i16; 3] = [21_826, -7_914, 2_710];
/// The same to the cube: relative error 0.2 %.
const ROUGH_RECIPROCAL: [i16; 4] = [21_817, -7_271, 2_724, -914];
/// atan(t)/2π on 0 ≤ t ≤ 1 in 1/131072 turn, from the first power of t to the fifth: error 4e-6 turn.
const ARCTANGENT: [i16; 5] = [20_831, 439, -9_260, 5_342, -967];
/// atan(2h)/2π on 0 ≤ h ≤ ½ in 1/65536 turn, from the first power of h to the third: error 1.9e-4 turn.
const ROUGH_ARCTANGENT: [i16; 3] = [21_455, -7_158, -6_092];
/// √(1 + t²) on 0 ≤ t ≤ 1 in powers of t²: relative error 6.5e-4.
pub(super) const LENGTH: [f64; 3] = [1.000_644, 0.484_927, -0.072_269];

/// The constants in all lanes.
pub(super) struct AngleLanes<V: Lanes> {
    reciprocal: [V::W; 3],
    rough_reciprocal: [V::W; 4],
    arctangent: [V::W; 5],
    rough_arctangent: [V::W; 3],
}

impl<V: Lanes> AngleLanes<V> {
    #[inline(always)]
    pub fn new(v: V) -> Self {
        Self {
            reciprocal: splat(v, RECIPROCAL),
            rough_reciprocal: splat(v, ROUGH_RECIPROCAL),
            arctangent: splat(v, ARCTANGENT),
            rough_arctangent: splat(v, ROUGH_ARCTANGENT),
        }
    }

    /// φ of half a block in 1/65536 turn, and t in Q15.
    #[inline(always)]
    pub fn fine(&self, v: V, folded: &Folded<V>, half: usize) -> (V::W, V::W) {
        let (short, long) = (folded.short[half], folded.long[half]);
        let reciprocal = polynomial(v, self.reciprocal, folded.centred[half]);
        let first = v.mul_q15(short, reciprocal);
        let first = v.add_sat(first, first);
        let missing = v.sub(short, v.mul_q15(first, long));
        let second = v.mul_q15(v.add(missing, missing), reciprocal);
        let t = v.add_sat(first, second);
        let angle = v.halve(v.mul_q15(t, polynomial(v, self.arctangent, t)));
        (folded.unfold(v, half, angle), t)
    }

    /// φ of half a block in 1/65536 turn, roughly.
    #[inline(always)]
    pub fn rough(&self, v: V, folded: &Folded<V>, half: usize) -> V::W {
        let reciprocal = polynomial(v, self.rough_reciprocal, folded.centred[half]);
        let h = v.mul_q15(folded.short[half], reciprocal);
        let angle = v.mul_q15(h, polynomial(v, self.rough_arctangent, h));
        folded.unfold(v, half, angle)
    }
}

#[inline(always)]
fn splat<V: Lanes, const N: usize>(v: V, constants: [i16; N]) -> [V::W; N] {
    // Hidden from the compiler, or it makes them anew at every use instead of reading them from memory.
    let constants = black_box(constants);
    let mut lanes = [v.splat16(0); N];
    let mut at = 0;
    while at < N {
        lanes[at] = v.splat16(constants[at]);
        at += 1;
    }
    lanes
}

/// The polynomial with these coefficients, from the constant on, by Horner's scheme in Q15.
#[inline(always)]
fn polynomial<V: Lanes, const N: usize>(v: V, coefficients: [V::W; N], x: V::W) -> V::W {
    let mut sum = coefficients[N - 1];
    let mut at = N - 1;
    while at > 0 {
        at -= 1;
        sum = v.add(v.mul_q15(x, sum), coefficients[at]);
    }
    sum
}

/// length · √(1 + t²) · (what `coefficients` have been multiplied by).
#[inline(always)]
pub(super) fn hypotenuse<V: Lanes>(v: V, length: V::W, t: V::W, coefficients: [V::W; 3]) -> V::W {
    v.mul_q15(length, polynomial(v, coefficients, v.mul_q15(t, t)))
}
