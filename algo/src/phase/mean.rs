//! The weighted mean of dense levels, in singles: + − × of IEEE 754, so the same bits everywhere.

use super::about::Around;
use super::step::q15;
use crate::pattern::Level;
use crate::simd::Lanes;

/// What the mean of up to three levels needs: the finest, a first and perhaps a second other one.
#[derive(Clone, Debug)]
pub(super) struct Mean {
    first: Averaged,
    second: Option<Averaged>,
    /// By how much the first is expected to have moved the mean, per unit of its residual and in units of the second:
    /// with equal modulation.
    moved: f64,
    /// N r² of the finest over that of all.
    finest_share: f64,
}

/// A level beside the finest.
#[derive(Clone, Copy, Debug)]
struct Averaged {
    /// 1/r.
    inverse: f64,
    /// N r², relative to the finest's.
    weight: f64,
}

impl Mean {
    pub fn new(levels: &[Level], finest: usize, first: usize, second: Option<usize>) -> Self {
        let weight = |at: usize| levels[at].steps() as f64 * levels[at].ratio * levels[at].ratio;
        let averaged = |at: usize| Averaged {
            inverse: 1.0 / levels[at].ratio,
            weight: weight(at) / weight(finest),
        };
        let others = [Some(first), second];
        let total: f64 = 1.0
            + others
                .iter()
                .flatten()
                .map(|&at| averaged(at).weight)
                .sum::<f64>();
        let here = averaged(first);
        let share = here.weight / (1.0 + here.weight);
        Self {
            first: here,
            second: second.map(averaged),
            moved: second.map_or(0.0, |at| share * here.inverse * levels[at].ratio),
            finest_share: 1.0 / total,
        }
    }
}

/// [`Mean`] with every constant in all lanes.
pub(super) struct MeanLanes<V: Lanes> {
    first: AveragedLanes<V>,
    second: Option<AveragedLanes<V>>,
    moved: V::W,
    moved_single: V::F,
    finest_share: V::W,
    /// Σ N r², relative to the finest's.
    total: V::F,
}

struct AveragedLanes<V: Lanes> {
    weight: V::F,
    /// What its residual counts for: −weight/r.
    pull: V::F,
    /// N r² over that of all.
    share: V::W,
}

impl<V: Lanes> AveragedLanes<V> {
    #[inline(always)]
    fn new(v: V, plan: &Averaged, finest_share: f64) -> Self {
        Self {
            weight: v.splat_single(plan.weight as f32),
            pull: v.splat_single((-plan.weight * plan.inverse) as f32),
            share: v.splat16(q15(plan.weight * finest_share)),
        }
    }
}

impl<V: Lanes> MeanLanes<V> {
    #[inline(always)]
    pub fn new<const LEVELS: usize>(v: V, plan: &Mean) -> Option<Self> {
        let moved = q15(plan.moved);
        let mut second = None;
        if LEVELS > 2 {
            let Some(plan_of_second) = &plan.second else {
                return None;
            };
            second = Some(AveragedLanes::new(v, plan_of_second, plan.finest_share));
        }
        Some(Self {
            first: AveragedLanes::new(v, &plan.first, plan.finest_share),
            second,
            moved: v.splat16(moved),
            moved_single: v.splat_single(f32::from(moved) / 32_768.0),
            finest_share: v.splat16(q15(plan.finest_share)),
            total: v.splat_single((1.0 / plan.finest_share) as f32),
        })
    }

    /// By how much a residual of the first other level has moved the mean, for the second.
    #[inline(always)]
    pub fn moved(&self, v: V, e3: V::W) -> V::W {
        v.mul_q15(e3, self.moved)
    }

    /// −Σ w_i e_i/r_i / Σ w_i with w = N r² B² over the levels beside the finest, in 1/65536 turn, and
    /// √(Σ N r² B² / Σ N r²).
    #[inline(always)]
    pub fn of(
        &self,
        v: V,
        levels: &Around<V>,
        half: usize,
        e3: V::W,
        e2: V::W,
    ) -> ([V::D; 2], V::W) {
        let zero = v.splat16(0);
        let b1 = levels.finest.modulation[half];
        let b3 = levels.first.modulation[half];
        let mut mean = v.add(
            v.mul_q15(b1, self.finest_share),
            v.mul_q15(b3, self.first.share),
        );
        let (b1, b3) = (v.join(b1, zero), v.join(b3, zero));
        let e3 = v.join(e3, v.sar::<15>(e3));
        let (mut b2, mut e2_wide) = (b3, e3);
        if let Some(second) = &self.second {
            let b = levels.second.modulation[half];
            mean = v.add(mean, v.mul_q15(b, second.share));
            b2 = v.join(b, zero);
            e2_wide = v.join(e2, v.sar::<15>(e2));
        }
        let mean = v.join(mean, zero);
        let low = self.quarter(v, [b1[0], b3[0], b2[0]], e3[0], e2_wide[0], mean[0]);
        let high = self.quarter(v, [b1[1], b3[1], b2[1]], e3[1], e2_wide[1], mean[1]);
        ([low.0, high.0], v.narrow_rounded([low.1, high.1], 0))
    }

    #[inline(always)]
    fn quarter(
        &self,
        v: V,
        [b1, b3, b2]: [V::D; 3],
        e3: V::D,
        e2: V::D,
        mean: V::D,
    ) -> (V::D, V::D) {
        let e3 = v.to_single(e3);
        let square3 = square(v, b3);
        let mut total = v.add_single(square(v, b1), v.mul_single(square3, self.first.weight));
        let mut sum = v.mul_single(v.mul_single(square3, e3), self.first.pull);
        if let Some(second) = &self.second {
            let square2 = square(v, b2);
            // The residual about D₁, not about the mean so far.
            let e2 = v.add_single(v.to_single(e2), v.mul_single(e3, self.moved_single));
            total = v.add_single(total, v.mul_single(square2, second.weight));
            sum = v.add_single(sum, v.mul_single(v.mul_single(square2, e2), second.pull));
        }
        let inverse = reciprocal(v, total);
        let correction = v.to_whole(v.mul_single(sum, inverse));
        let inverse = v.mul_single(inverse, self.total);
        (correction, v.to_whole(root(v, v.to_single(mean), inverse)))
    }
}

#[inline(always)]
fn square<V: Lanes>(v: V, x: V::D) -> V::F {
    let x = v.to_single(x);
    v.mul_single(x, x)
}

/// The root of a mean square from the mean x and 1/(mean square): two steps of the third order, x (15 − 10 s + 3 s²)/8 with
/// s = x²/(mean square). A mean a third too small, the most that three levels of any modulation make it, leaves 4e-3.
#[inline(always)]
fn root<V: Lanes>(v: V, mean: V::F, inverse: V::F) -> V::F {
    let x = root_step(v, mean, inverse);
    root_step(v, x, inverse)
}

#[inline(always)]
fn root_step<V: Lanes>(v: V, x: V::F, inverse: V::F) -> V::F {
    let share = v.mul_single(v.mul_single(x, x), inverse);
    let step = v.mul_single(share, v.splat_single(0.375));
    let step = v.mul_single(share, v.sub_single(v.splat_single(1.25), step));
    v.mul_single(x, v.sub_single(v.splat_single(1.875), step))
}

/// 1/x of a positive x, relative error 3e-4: two Newton steps from the exponent and mantissa taken as one number.
#[inline(always)]
fn reciprocal<V: Lanes>(v: V, x: V::F) -> V::F {
    // Blinn, "Floating-point tricks", IEEE CG&A 17(4), 1997: the bits of 1/x are nearly a constant less those of x.
    const START: i32 = 0x7EF3_11C7;
    let two = v.splat_single(2.0);
    let y = v.with_bits(v.sub32(v.splat32(START), v.bits(x)));
    let y = v.mul_single(y, v.sub_single(two, v.mul_single(x, y)));
    v.mul_single(y, v.sub_single(two, v.mul_single(x, y)))
}
