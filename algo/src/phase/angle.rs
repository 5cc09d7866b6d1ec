//! Wrapped phase and length of a folded pointer, by multiplications of words.
//!
//! **Idea.** After folding ([`super::fold`]) the pointer (C, S) lies in the first octant, so its
//! angle is the arctangent of t = short / long, 0 ≤ t ≤ 1. Both the quotient and the arctangent are
//! polynomials.
//!
//! **Equation**, fine quality:
//!
//! ```text
//! t₀ = 2 short · R(long)                          R(x) ≈ 1/(2x), a quadratic about the middle of the range of long
//! t  = t₀ + 2 (short − t₀ · long) · R(long)       one Newton step on the remainder of the division
//! a  = t · P(t)                                   ≈ atan(t)/2π, a polynomial of degree 5 in t
//! φ  = axis ± a                                   unfolded
//! √(S² + C²) = long · √(1 + t²)                   a polynomial of degree 2 in t²
//! ```
//!
//! Rough quality, for levels that only give the fringe order of the next: R is a cubic, there is no
//! Newton step, a is of degree 3.
//!
//! **Shapes and units.** Half a block. `long` is Q15 in ½…1, `short` the same scale; t in Q15;
//! angles in 1/65536 turn, inside the fine arctangent in 1/131072 turn so that its roundings stay
//! below the last bit.
//!
//! **Departures** from `atan2`: no table, no division and no hardware estimate of a reciprocal,
//! which would differ from machine to machine. The coefficients are minimax; their last digits come
//! from a search over all pairs of 8-bit differences.
//!
//! **Accuracy.** Over all pairs of 8-bit differences of a trusted pixel the fine angle is off by at
//! most 2.24e-5 turn, RMS 6.2e-6 (`every_pair_of_8_bit_differences_is_within_the_bound`), the rough
//! one by at most 3.2e-4 (`every_rough_angle_is_within_the_bound`).

use super::fold::Folded;
use super::level::{Demodulated, LevelLanes};
use crate::simd::Lanes;
use core::hint::black_box;

/// 1/(2x) in Q15 for x = (3 + d)/4, −1 ≤ d < 1, coefficients of d⁰ to d²: relative error 1 %.
const RECIPROCAL: [i16; 3] = [21_826, -7_914, 2_710];
/// 1/(2x) with coefficients of d⁰ to d³: relative error 0.2 %.
const ROUGH_RECIPROCAL: [i16; 4] = [21_817, -7_271, 2_724, -914];
/// atan(t)/2π on 0 ≤ t ≤ 1 in 1/131072 turn, coefficients of t to t⁵: error 4e-6 turn.
const ARCTANGENT: [i16; 5] = [20_831, 439, -9_260, 5_342, -967];
/// atan(2h)/2π on 0 ≤ h ≤ ½ in 1/65536 turn, coefficients of h to h³: error 1.9e-4 turn.
const ROUGH_ARCTANGENT: [i16; 3] = [21_455, -7_158, -6_092];

/// The constants in all lanes, for both halves of a block.
pub(super) struct AngleLanes<V: Lanes> {
    reciprocal: [[V::W; 3]; 2],
    rough_reciprocal: [[V::W; 4]; 2],
    arctangent: [[V::W; 5]; 2],
    rough_arctangent: [[V::W; 3]; 2],
}

impl<V: Lanes> AngleLanes<V> {
    #[inline(always)]
    pub fn new(v: V) -> Self {
        Self {
            reciprocal: halves(v, RECIPROCAL),
            rough_reciprocal: halves(v, ROUGH_RECIPROCAL),
            arctangent: halves(v, ARCTANGENT),
            rough_arctangent: halves(v, ROUGH_ARCTANGENT),
        }
    }

    /// φ of half a block in fine quality, 1/65536 turn, and t in Q15.
    #[inline(always)]
    pub fn fine(&self, v: V, folded: &Folded<V>, half: usize) -> (V::W, V::W) {
        let (short, long) = (folded.short[half], folded.long[half]);
        let reciprocal = polynomial(v, self.reciprocal[half], folded.centred[half]);
        let quotient = v.mul_q15(short, reciprocal);
        let quotient = v.add_sat(quotient, quotient);
        let remainder = v.sub(short, v.mul_q15(quotient, long));
        let correction = v.mul_q15(v.add(remainder, remainder), reciprocal);
        let t = v.add_sat(quotient, correction);
        let angle = v.halve(v.mul_q15(t, polynomial(v, self.arctangent[half], t)));
        (folded.unfold(v, half, angle), t)
    }

    /// φ of half a block in rough quality, 1/65536 turn.
    #[inline(always)]
    pub fn rough(&self, v: V, folded: &Folded<V>, half: usize) -> V::W {
        let reciprocal = polynomial(v, self.rough_reciprocal[half], folded.centred[half]);
        let h = v.mul_q15(folded.short[half], reciprocal);
        let angle = v.mul_q15(h, polynomial(v, self.rough_arctangent[half], h));
        folded.unfold(v, half, angle)
    }
}

impl<V: Lanes> LevelLanes<'_, V> {
    /// Wrapped phase of a folded block, and modulation in units of full scale / 32767.5 (not
    /// meaningful where it is below the trusted minimum). `doubled` is
    /// [`super::source::Frames::DOUBLED`]: whether the plan's `doubled` can be set at all.
    #[inline(always)]
    pub fn fine(
        &self,
        v: V,
        angle: &AngleLanes<V>,
        folded: &Folded<V>,
        doubled: bool,
    ) -> (Demodulated<V>, [V::W; 2]) {
        let (low, t_low) = angle.fine(v, folded, 0);
        let (high, t_high) = angle.fine(v, folded, 1);
        let mut modulation = [
            hypotenuse(v, folded.length[0], t_low, self.hypotenuse),
            hypotenuse(v, folded.length[1], t_high, self.hypotenuse),
        ];
        if doubled {
            modulation = [
                v.shl_by(modulation[0], self.doubled),
                v.shl_by(modulation[1], self.doubled),
            ];
        }
        let block = Demodulated {
            phase: [low, high],
            strong: folded.strong,
            brightest: folded.brightest,
        };
        (block, modulation)
    }
}

/// Constants in all lanes, for each half. With few registers they stay in memory; copies of their
/// own let each instruction read its operand from there, where a copy for both would be loaded to a
/// register first.
#[inline(always)]
fn halves<V: Lanes, const N: usize>(v: V, constants: [i16; N]) -> [[V::W; N]; 2] {
    let low = splat(v, constants);
    let high = if V::FEW_REGISTERS {
        splat(v, constants)
    } else {
        low
    };
    [low, high]
}

#[inline(always)]
fn splat<V: Lanes, const N: usize>(v: V, constants: [i16; N]) -> [V::W; N] {
    // Hidden from the compiler, which otherwise builds each constant anew at every use instead of
    // loading it.
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
fn hypotenuse<V: Lanes>(v: V, length: V::W, t: V::W, coefficients: [V::W; 3]) -> V::W {
    v.mul_q15(length, polynomial(v, coefficients, v.mul_q15(t, t)))
}
