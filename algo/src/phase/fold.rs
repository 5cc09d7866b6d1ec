//! The samples of a level at a block of pixels → the pointer (C, S) of its fringes → wrapped phase
//! and modulation.
//!
//! # Folding into the first octant
//!
//! **Idea.** N shifted samples of a fringe are projected on cosine and sine of their shifts. Offset
//! A drops out; what remains is a pointer whose angle is the phase and whose length is proportional
//! to the modulation. Signs and swap of its components are taken out ("folded"), so that
//! only an arctangent of 0…1 is needed.
//!
//! **Equation.** I_k = A + B sin 2π(φ + s_k) (Peng & Gupta 2008, eq. 1 with a shift); N equally
//! spaced shifts (Bruning et al. 1974):
//!
//! ```text
//! S = Σ I_k cos 2πs_k      C = Σ I_k sin 2πs_k      φ = atan2(S, C) / 2π      B = (2/N) √(S² + C²)
//! ```
//!
//! Four shifts of 8 bits are folded in bytes, exactly, all others in words from S and C of
//! [`super::terms`]. Where little modulation is trusted, pointers in words may be too short to be
//! normalised at once: they are lifted by two bits in blocks that have such pixels.
//!
//! **Shapes and units.** Samples in counts of the bit depth, one block of each of the N rows;
//! components in words, scaled by a power of two so that the longer one uses 15 bits.
//!
//! **Accuracy.** Folding rounds nothing. The threshold of modulation is decided from S² + C² in
//! words; at 8 bits that is exact for N = 3, 4 and 6
//! (`the_modulation_threshold_is_sixteen_counts_exactly`), else within 3/4 of a unit of the words,
//! 2.5e-4 of 16 counts and 1.5e-3 of 4.
//!
//! # Angle and length
//!
//! **Idea.** After folding, the pointer (C, S) lies in the first octant, so its
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

use super::level::{Demodulated, FAINT, LevelLanes};
use super::terms::Pointers;
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

/// The pointers of a block, folded into the first octant, and how to unfold their angles.
pub(super) struct Folded<V: Lanes> {
    /// The longer component, scaled by a power of two to 2¹⁴…2¹⁵ (below that only where the
    /// modulation is too small).
    pub long: [V::W; 2],
    /// The shorter component, with the same factor.
    pub short: [V::W; 2],
    /// 4 · long − 3 · 2¹⁵.
    pub centred: [V::W; 2],
    /// The longer component before scaling, in the level's unit.
    pub length: [V::W; 2],
    /// −1 where the angle is subtracted from the axis, 1 where it is added.
    pub sign: [V::W; 2],
    /// The axis that the angle is measured from, 1/65536 turn.
    pub axis: [V::W; 2],
    /// Folded in words, where that takes fewer operations: the angle is this angle less the one in
    /// the octant (0 or a quarter of a turn, 1/65536 turn).
    pub base: Option<[V::W; 2]>,
    /// Mask: the modulation is at least the trusted minimum.
    pub strong: V::B,
    /// Whether `strong` is set nowhere.
    pub dark: bool,
    /// 255 where a sample is at full scale, as long as the phase is not found without it.
    pub brightest: V::B,
}

impl<V: Lanes> Folded<V> {
    /// The phases of half a block from the angles in its octants.
    #[inline(always)]
    pub fn unfold(&self, v: V, half: usize, angle: V::W) -> V::W {
        let angle = match self.base {
            Some(base) => v.sub(base[half], angle),
            None => angle,
        };
        v.add_signed(self.axis[half], angle, self.sign[half])
    }
}

/// Tells the compiler that a branch is seldom taken: then registers are saved there and not before
/// it.
#[cold]
fn seldom() {}

/// Folds a block of four shifts of 8 bits, S = I₀ − I₂ and C = I₁ − I₃, in bytes with the signs
/// apart.
#[inline(always)]
pub(super) fn fold_four<V: Lanes>(
    v: V,
    level: &LevelLanes<'_, V>,
    [i0, i1, i2, i3]: [V::B; 4],
) -> Folded<V> {
    let (even, odd) = (v.max8(i0, i2), v.max8(i1, i3));
    let s = v.sub8(even, v.min8(i0, i2));
    let c = v.sub8(odd, v.min8(i1, i3));
    // The signs of S and C. Where one is 0 its sign is of no consequence: the angle is the same
    // from either side.
    let (s_down, c_down) = (v.eq8(even, i2), v.eq8(odd, i3));
    let (long, short) = (v.max8(s, c), v.min8(s, c));
    let steep = v.eq8(long, s);
    // Compared first: nothing that follows is needed of dark background.
    let (strong, dark) = strong_four(v, level, long, short);
    let backwards = v.xor8(v.xor8(s_down, c_down), steep);
    let axis = v.quarters8(steep, s_down, c_down);
    let scaled = v.scaled(long, short);
    Folded {
        long: scaled.long,
        short: scaled.short,
        centred: scaled.centred,
        length: v.widen_128(long),
        sign: v.signs(backwards),
        axis: v.widen_256(axis),
        base: None,
        strong,
        dark,
        brightest: v.max8(even, odd),
    }
}

/// Mask: the sum of both squares is at least the level's least power; and whether it is set
/// nowhere.
#[inline(always)]
fn strong_four<V: Lanes>(v: V, level: &LevelLanes<'_, V>, long: V::B, short: V::B) -> (V::B, bool) {
    // On most of a part the longer component is enough by itself, and in the background no shorter
    // one makes up for it.
    if v.all_at_least(long, level.four.long_enough) {
        return (v.splat8(u8::MAX), false);
    }
    if v.all_at_most(long, level.four.too_short) {
        return (v.splat8(0), true);
    }
    seldom();
    let zero = v.splat8(0);
    let (long, short) = (v.widen(long, zero), v.widen(short, zero));
    let mut strong = long;
    let mut half = 0;
    while half < 2 {
        let missing = v.excess(level.four.power, v.mul_low(long[half], long[half]));
        let missing = v.excess(missing, v.mul_low(short[half], short[half]));
        strong[half] = v.eq(missing, v.splat16(0));
        half += 1;
    }
    let strong = v.narrow_mask(strong);
    (strong, v.none8(strong))
}

/// Folds the pointers of a block of any other level, in words.
#[inline(always)]
pub(super) fn fold<V: Lanes>(
    v: V,
    level: &LevelLanes<'_, V>,
    Pointers { s, c, brightest }: Pointers<V>,
) -> Folded<V> {
    let (along, across) = ([v.abs(s[0]), v.abs(s[1])], [v.abs(c[0]), v.abs(c[1])]);
    let length = [v.max(along[0], across[0]), v.max(along[1], across[1])];
    let short = [v.min(along[0], across[0]), v.min(along[1], across[1])];
    // Where the longer component is C.
    let mut flat = [v.gt(across[0], along[0]), v.gt(across[1], along[1])];
    // On most of a part the longer component is enough by itself.
    let (strong, dark, low, high);
    if v.none_below(v.min(length[0], length[1]), level.long_enough) {
        (strong, dark) = (v.splat8(u8::MAX), false);
        low = v.normalised(length[0], short[0]);
        high = v.normalised(length[1], short[1]);
    } else {
        seldom();
        strong = v.narrow_mask([
            strong_words(v, level, length[0], short[0]),
            strong_words(v, level, length[1], short[1]),
        ]);
        dark = v.none8(strong);
        low = lifted(v, level, length[0], short[0]);
        high = lifted(v, level, length[1], short[1]);
    }
    if !V::FEW_REGISTERS {
        // `flat` as above, but compared here, where one instruction can take the bits of its
        // inverse.
        flat = [v.gt(length[0], along[0]), v.gt(length[1], along[1])];
    }
    let low = octant(v, [s[0], c[0]], flat[0], low);
    let high = octant(v, [s[1], c[1]], flat[1], high);
    Folded {
        long: [low.long, high.long],
        short: [low.short, high.short],
        centred: [low.centred, high.centred],
        length,
        sign: [low.sign, high.sign],
        axis: [low.axis, high.axis],
        base: Some([low.base, high.base]),
        strong,
        dark,
        brightest,
    }
}

/// Both components normalised, [`FAINT`] ones too where these can be trusted.
#[inline(always)]
fn lifted<V: Lanes>(v: V, level: &LevelLanes<'_, V>, mut long: V::W, mut short: V::W) -> [V::W; 2] {
    if V::LIFTS_FAINT && level.plan.faint {
        let faint = v.gt(v.splat16(FAINT), long);
        long = v.pick(faint, v.shl::<2>(long), long);
        short = v.pick(faint, v.shl::<2>(short), short);
    }
    v.normalised(long, short)
}

/// Mask: the sum of both squares is at least the level's least power. Takes the magnitudes: of S
/// and C the compiler for NEON would narrow one half twice.
#[inline(always)]
fn strong_words<V: Lanes>(v: V, level: &LevelLanes<'_, V>, a: V::W, b: V::W) -> V::W {
    let power = v.dot(a, a, b, b);
    // Not kept in all lanes: it is needed too seldom.
    let below = v.splat32(level.plan.below_least_power);
    v.narrow_mask32([v.gt32(power[0], below), v.gt32(power[1], below)])
}

/// [`Folded`] of half a block.
struct Octant<W> {
    long: W,
    short: W,
    centred: W,
    sign: W,
    axis: W,
    base: W,
}

#[inline(always)]
fn octant<V: Lanes>(v: V, [s, c]: [V::W; 2], flat: V::W, [long, short]: [V::W; 2]) -> Octant<V::W> {
    let backwards = v.xor(v.xor(s, c), flat);
    let quarter = v.splat16(1 << 14);
    Octant {
        long,
        short,
        centred: v.xor(v.shl::<2>(long), v.splat16(i16::MIN)),
        sign: v.sign_of(backwards),
        // 0 or half a turn.
        axis: v.and(c, v.splat16(i16::MIN)),
        base: v.xor(v.and(flat, quarter), quarter),
    }
}

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
    /// [`super::kernel::Frames::DOUBLED`]: whether the plan's `doubled` can be set at all.
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
    let mut k = 0;
    while k < N {
        lanes[k] = v.splat16(constants[k]);
        k += 1;
    }
    lanes
}

/// The polynomial with these coefficients, from the constant on, by Horner's scheme in Q15.
#[inline(always)]
fn polynomial<V: Lanes, const N: usize>(v: V, coefficients: [V::W; N], x: V::W) -> V::W {
    let mut sum = coefficients[N - 1];
    let mut k = N - 1;
    while k > 0 {
        k -= 1;
        sum = v.add(v.mul_q15(x, sum), coefficients[k]);
    }
    sum
}

/// length · √(1 + t²) · (what `coefficients` have been multiplied by).
#[inline(always)]
fn hypotenuse<V: Lanes>(v: V, length: V::W, t: V::W, coefficients: [V::W; 3]) -> V::W {
    v.mul_q15(length, polynomial(v, coefficients, v.mul_q15(t, t)))
}
