//! The samples of a level at a block of pixels → the pointer (C, S) of its fringes, folded into the first octant.
//!
//! **Idea.** N shifted samples of a fringe are projected on cosine and sine of their shifts. Offset A drops out; what remains is
//! a pointer whose angle is the phase and whose length is proportional to the modulation. Signs and swap of its components are
//! taken out ("folded"), so that [`super::angle`] needs an arctangent of 0…1 only.
//!
//! **Equation.** I_k = A + B sin 2π(φ + s_k) (Peng & Gupta 2008, eq. 1 with a shift); N equally spaced shifts (Bruning et al.
//! 1974):
//!
//! ```text
//! S = Σ I_k cos 2πs_k      C = Σ I_k sin 2πs_k      φ = atan2(S, C) / 2π      B = (2/N) √(S² + C²)
//! ```
//!
//! With s_k = k/N this becomes, by the number of shifts and bits:
//!
//! | N | S | C | arithmetic |
//! |---|---|---|---|
//! | 4, 8 bits | I₀ − I₂ | I₁ − I₃ | bytes, exact, folding included |
//! | 4, up to 12 bits | I₀ − I₂ | I₁ − I₃ | words, exact |
//! | 3, up to 12 bits | (2I₀ − I₁ − I₂)/2 | (√3/2)(I₁ − I₂) | words; one rounding in C |
//! | any other | Σ w I | Σ w I | weights in Q14, sums in 32 bits, rounded to words |
//!
//! **Shapes and units.** Samples in counts of the bit depth, one block of each of the N rows; components in words, scaled by a
//! power of two so that the longer one uses 15 bits.
//!
//! **Accuracy.** Every N from 3 to 64 at every depth against the definition in f64
//! (`any_number_of_steps_at_any_depth_agrees_with_the_definition`). The threshold of modulation is decided exactly, from S² + C²
//! (`the_modulation_threshold_is_sixteen_counts_exactly`).

use super::level::{LevelLanes, Samples};
use crate::frame::Sample;
use crate::simd::{Four, Lanes};

/// The pointers of a block, folded into the first octant, and how to unfold their angles.
pub(super) struct Folded<V: Lanes> {
    /// The longer component, scaled by a power of two to 2¹⁴…2¹⁵ (below that only where the modulation is too small).
    pub long: [V::W; 2],
    /// The shorter component, with the same factor.
    pub short: [V::W; 2],
    /// 4 · long − 3 · 2¹⁵.
    pub centred: [V::W; 2],
    /// The longer component before scaling, in the level's unit.
    pub length: [V::W; 2],
    /// −1 where the octant's angle is subtracted from the axis, 1 where it is added.
    pub sign: [V::W; 2],
    /// The axis that the octant's angle is measured from, 1/65536 turn.
    pub axis: [V::W; 2],
    /// Mask: the modulation is at least the trusted minimum.
    pub strong: V::B,
    /// 255 where a sample is at full scale and the level does not tolerate that.
    pub brightest: V::B,
}

impl<V: Lanes> Folded<V> {
    /// The phases of half a block from the angles in its octants.
    #[inline(always)]
    pub fn unfold(&self, v: V, half: usize, angle: V::W) -> V::W {
        v.add_signed(self.axis[half], angle, self.sign[half])
    }
}

/// A sample type that the kernels can read blocks of.
pub(crate) trait BlockSample: Sample {
    /// Folds a level of four shifts a quarter of a turn apart, in the fastest way for this type.
    fn four<V: Lanes>(
        v: V,
        level: &LevelLanes<'_, V>,
        rows: &Four<'_, Self>,
        at: usize,
    ) -> Folded<V>;
    /// A block of samples as words.
    fn words<V: Lanes>(v: V, row: &[Self], at: usize) -> [V::W; 2];
    /// Mask: the sample is at full scale or above.
    fn saturated<V: Lanes>(v: V, level: &LevelLanes<'_, V>, row: &[Self], at: usize) -> V::B;
}

/// Folds the block at `at` of a level's rows, one row per shift.
#[inline(always)]
pub(super) fn fold<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    rows: &[&[T]],
    at: usize,
) -> Folded<V> {
    let mut folded = match (&level.plan.samples, rows) {
        (Samples::Four, &[a, b, c, d]) => T::four(v, level, &Four::new([a, b, c, d], a.len()), at),
        (Samples::Three, &[a, b, c]) => three(v, level, [a, b, c], at),
        _ => weighted(v, level, &level.plan.weights, rows, at),
    };
    folded.brightest = v.and8(folded.brightest, level.saturates);
    folded
}

/// At 8 bits and N = 4, B = √(S² + C²)/2 reaches 16 counts where S² + C² ≥ 32²: for each longer component from 16 to 31 the
/// least shorter one that is enough; 255 where none is.
const LEAST_SHORT: [u8; 16] = [
    255, 255, 255, 255, 255, 255, 255, 23, 22, 20, 19, 18, 16, 14, 12, 8,
];

impl BlockSample for u8 {
    #[inline(always)]
    fn four<V: Lanes>(
        v: V,
        _level: &LevelLanes<'_, V>,
        rows: &Four<'_, Self>,
        at: usize,
    ) -> Folded<V> {
        let [i0, i1, i2, i3] = v.load8_of_four(rows, at);
        let (even, odd) = (v.max8(i0, i2), v.max8(i1, i3));
        let s = v.sub8(even, v.min8(i0, i2));
        let c = v.sub8(odd, v.min8(i1, i3));
        // The signs of S and C. Where one is 0 its sign is of no consequence: the angle is the same from either side.
        let (s_down, c_down) = (v.eq8(even, i2), v.eq8(odd, i3));
        let (long, short) = (v.max8(s, c), v.min8(s, c));
        let steep = v.eq8(long, s);
        let backwards = v.xor8(v.xor8(s_down, c_down), steep);
        let axis = v.quarters8(v.pick8(steep, s_down, c_down), steep);
        let scaled = v.scaled(long, short);
        let least = v.by_excess(&LEAST_SHORT, long);
        Folded {
            long: scaled.long,
            short: scaled.short,
            centred: scaled.centred,
            length: v.widen_128(long),
            sign: v.signs(backwards),
            axis: v.widen_256(axis),
            strong: v.eq8(v.max8(short, least), short),
            brightest: v.max8(even, odd),
        }
    }

    #[inline(always)]
    fn words<V: Lanes>(v: V, row: &[Self], at: usize) -> [V::W; 2] {
        v.widen(v.load8(row, at), v.splat8(0))
    }

    #[inline(always)]
    fn saturated<V: Lanes>(v: V, _level: &LevelLanes<'_, V>, row: &[Self], at: usize) -> V::B {
        v.eq8(v.load8(row, at), v.splat8(u8::MAX))
    }
}

impl BlockSample for u16 {
    #[inline(always)]
    fn four<V: Lanes>(
        v: V,
        level: &LevelLanes<'_, V>,
        rows: &Four<'_, Self>,
        at: usize,
    ) -> Folded<V> {
        let [a, b, c, d] = rows.rows();
        let (a, b) = (v.load16(a, at), v.load16(b, at));
        let (c, d) = (v.load16(c, at), v.load16(d, at));
        let s = [
            v.shl_by(v.sub(a[0], c[0]), level.lift),
            v.shl_by(v.sub(a[1], c[1]), level.lift),
        ];
        let c_ = [
            v.shl_by(v.sub(b[0], d[0]), level.lift),
            v.shl_by(v.sub(b[1], d[1]), level.lift),
        ];
        let over = [
            any_full(v, level, a[0], b[0], c[0], d[0]),
            any_full(v, level, a[1], b[1], c[1], d[1]),
        ];
        let strong = [
            dot_enough(v, level, [s[0], s[0], c_[0], c_[0]]),
            dot_enough(v, level, [s[1], s[1], c_[1], c_[1]]),
        ];
        octant(v, s, c_, v.narrow_mask(strong), v.narrow_mask(over))
    }

    #[inline(always)]
    fn words<V: Lanes>(v: V, row: &[Self], at: usize) -> [V::W; 2] {
        v.load16(row, at)
    }

    #[inline(always)]
    fn saturated<V: Lanes>(v: V, level: &LevelLanes<'_, V>, row: &[Self], at: usize) -> V::B {
        let x = v.load16(row, at);
        v.narrow_mask([
            any_full(v, level, x[0], x[0], x[0], x[0]),
            any_full(v, level, x[1], x[1], x[1], x[1]),
        ])
    }
}

/// Mask: one of the samples is at full scale or above.
#[inline(always)]
fn any_full<V: Lanes>(v: V, level: &LevelLanes<'_, V>, a: V::W, b: V::W, c: V::W, d: V::W) -> V::W {
    // With the sign bit inverted, signed comparison orders unsigned words.
    let turn = v.splat16(i16::MIN);
    let (a, b) = (v.xor(a, turn), v.xor(b, turn));
    let (c, d) = (v.xor(c, turn), v.xor(d, turn));
    let brightest = v.max(v.max(a, b), v.max(c, d));
    v.gt(brightest, level.below_full_scale)
}

/// Mask: a·b + c·d is at least the level's least power.
#[inline(always)]
fn dot_enough<V: Lanes>(v: V, level: &LevelLanes<'_, V>, [a, b, c, d]: [V::W; 4]) -> V::W {
    let power = v.dot(a, b, c, d);
    let below = level.below_least_power;
    v.narrow_mask32([v.gt32(power[0], below), v.gt32(power[1], below)])
}

/// √3/2 in Q15.
const ROOT_3_HALVES: i16 = 28_378;

/// N = 3.
#[inline(always)]
fn three<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    rows: [&[T]; 3],
    at: usize,
) -> Folded<V> {
    let [a, b, c] = rows;
    let saturated = v.or8(
        v.or8(T::saturated(v, level, a, at), T::saturated(v, level, b, at)),
        T::saturated(v, level, c, at),
    );
    let (a, b, c) = (T::words(v, a, at), T::words(v, b, at), T::words(v, c, at));
    let (s0, c0, strong0) = three_words(v, level, a[0], b[0], c[0]);
    let (s1, c1, strong1) = three_words(v, level, a[1], b[1], c[1]);
    octant(
        v,
        [s0, s1],
        [c0, c1],
        v.narrow_mask([strong0, strong1]),
        saturated,
    )
}

/// S, C and the mask of enough modulation: 4 (S² + C²) = (2I₀ − I₁ − I₂)² + 3 (I₁ − I₂)², exactly.
#[inline(always)]
fn three_words<V: Lanes>(
    v: V,
    level: &LevelLanes<'_, V>,
    a: V::W,
    b: V::W,
    c: V::W,
) -> (V::W, V::W, V::W) {
    let across = v.sub(b, c);
    let along = v.sub(v.add(a, a), v.add(b, c));
    let threefold = v.add(across, v.add(across, across));
    let strong = dot_enough(v, level, [along, along, across, threefold]);
    let s = v.shl_by(along, level.half_lift);
    let c_ = v.mul_q15(v.shl_by(across, level.lift), v.splat16(ROOT_3_HALVES));
    (s, c_, strong)
}

/// Any N, by weights.
#[inline(always)]
fn weighted<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    weights: &[[i16; 2]],
    rows: &[&[T]],
    at: usize,
) -> Folded<V> {
    let zero = v.splat32(0);
    let mut s = [[zero; 2]; 2];
    let mut c = [[zero; 2]; 2];
    let mut saturated = v.splat8(0);
    let centre = level.centre;
    let none = v.splat16(0);
    // Two rows at a time: one instruction multiplies and adds two pairs of words.
    for (rows, weights) in rows.chunks(2).zip(weights.chunks(2)) {
        let ([s_first, c_first], [s_second, c_second]) = match *weights {
            [first, second] => (first, second),
            [first] => (first, [0; 2]),
            _ => ([0; 2], [0; 2]),
        };
        let first = T::words(v, rows[0], at);
        saturated = v.or8(saturated, T::saturated(v, level, rows[0], at));
        let second = match rows.get(1) {
            Some(row) => {
                saturated = v.or8(saturated, T::saturated(v, level, row, at));
                T::words(v, row, at)
            }
            None => [none; 2],
        };
        let mut half = 0;
        while half < 2 {
            let first = v.sub(first[half], centre);
            let second = v.sub(second[half], centre);
            let along = v.dot(first, v.splat16(s_first), second, v.splat16(s_second));
            let across = v.dot(first, v.splat16(c_first), second, v.splat16(c_second));
            s[half] = add_part(v, level, s[half], along);
            c[half] = add_part(v, level, c[half], across);
            half += 1;
        }
    }
    let strong = [
        enough_sums(v, level, s[0], c[0]),
        enough_sums(v, level, s[1], c[1]),
    ];
    let (s, c) = (
        [
            v.narrow_rounded(s[0], level.plan.lift),
            v.narrow_rounded(s[1], level.plan.lift),
        ],
        [
            v.narrow_rounded(c[0], level.plan.lift),
            v.narrow_rounded(c[1], level.plan.lift),
        ],
    );
    octant(v, s, c, v.narrow_mask(strong), saturated)
}

/// Adds products to a sum, shifted right by the level's `drop` so that all of them fit 32 bits.
#[inline(always)]
fn add_part<V: Lanes>(
    v: V,
    level: &LevelLanes<'_, V>,
    sum: [V::D; 2],
    products: [V::D; 2],
) -> [V::D; 2] {
    if level.plan.drop == 0 {
        return [v.add32(sum[0], products[0]), v.add32(sum[1], products[1])];
    }
    [
        v.add32(sum[0], v.sar32_by(products[0], level.plan.drop)),
        v.add32(sum[1], v.sar32_by(products[1], level.plan.drop)),
    ]
}

/// Mask: S² + C² of the sums is at least the level's least power, in single precision (1e-7).
#[inline(always)]
fn enough_sums<V: Lanes>(v: V, level: &LevelLanes<'_, V>, s: [V::D; 2], c: [V::D; 2]) -> V::W {
    let below = level.below_least_sum_power;
    let (s0, s1) = (v.to_single(s[0]), v.to_single(s[1]));
    let (c0, c1) = (v.to_single(c[0]), v.to_single(c[1]));
    let power0 = v.add_single(v.mul_single(s0, s0), v.mul_single(c0, c0));
    let power1 = v.add_single(v.mul_single(s1, s1), v.mul_single(c1, c1));
    v.narrow_mask32([v.lt_single(below, power0), v.lt_single(below, power1)])
}

/// Folds the pointers of a block that is in words.
#[inline(always)]
fn octant<V: Lanes>(v: V, s: [V::W; 2], c: [V::W; 2], strong: V::B, brightest: V::B) -> Folded<V> {
    let (low, high) = (octant_words(v, s[0], c[0]), octant_words(v, s[1], c[1]));
    Folded {
        long: [low.long, high.long],
        short: [low.short, high.short],
        centred: [low.centred, high.centred],
        length: [low.length, high.length],
        sign: [low.sign, high.sign],
        axis: [low.axis, high.axis],
        strong,
        brightest,
    }
}

/// [`Folded`] of half a block.
struct OctantWords<W> {
    long: W,
    short: W,
    centred: W,
    length: W,
    sign: W,
    axis: W,
}

#[inline(always)]
fn octant_words<V: Lanes>(v: V, s: V::W, c: V::W) -> OctantWords<V::W> {
    let zero = v.splat16(0);
    let (s_down, c_down) = (v.gt(zero, s), v.gt(zero, c));
    let (s, c) = (v.abs(s), v.abs(c));
    let (length, short) = (v.max(s, c), v.min(s, c));
    let steep = v.eq(length, s);
    let backwards = v.xor(v.xor(s_down, c_down), steep);
    let half = v.and(v.pick(steep, s_down, c_down), v.splat16(i16::MIN));
    let quarter = v.and(steep, v.splat16(0x4000));
    // The least trusted modulation needs a factor of 2⁴; these three give up to 2⁵.
    let (long, short) = lift::<V, 2>(v, length, short, 1 << 13);
    let (long, short) = lift::<V, 2>(v, long, short, 1 << 13);
    let (long, short) = lift::<V, 1>(v, long, short, 1 << 14);
    OctantWords {
        long,
        short,
        centred: v.xor(v.shl::<2>(long), v.splat16(i16::MIN)),
        length,
        sign: v.or(backwards, v.splat16(1)),
        axis: v.or(half, quarter),
    }
}

/// Both times 2ᴺ where the longer is below `least`.
#[inline(always)]
fn lift<V: Lanes, const N: i32>(v: V, long: V::W, short: V::W, least: i16) -> (V::W, V::W) {
    let small = v.gt(v.splat16(least), long);
    (
        v.pick(small, v.shl::<N>(long), long),
        v.pick(small, v.shl::<N>(short), short),
    )
}
