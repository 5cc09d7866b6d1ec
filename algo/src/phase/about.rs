//! Unwrapping about a known map Φ₀: dense levels by their beats, or a single level within half a turn.
//!
//! q_i = φ_i − frac(r_i Φ₀). With D = Φ − Φ₀ the slow beat a = q₁ − q₂ = D/n² unwraps the fast one b = q₁ − q₃ = D/n, and
//! that gives the order of level 1 (ratio 1): D₁ = k + q₁. The other levels are then a residual away from it,
//! e_i = wrap(r_i D₁ − q_i), D_i = D₁ − e_i/r_i, and D is the mean of the D_i with weights N_i r_i²: D = D₁ − Σ p_i e_i,
//! p_i = N_i r_i / Σ N r². It is the weighted mean that takes one level after the other, because the orders are the same.
//!
//! The best weights are N_i r_i² B_i², B_i the modulations. Dense levels have nearly the same: at a pitch of 8 pixels a blur of
//! 1 pixel (σ) leaves 0.81 at r = 5/6 where it leaves 0.73 at r = 1, and σ_Φ is then 0.3 % above its least
//! (`weights_without_modulations_lose_next_to_nothing`). Weights that are the same everywhere save a quotient and a root per
//! pixel, a fifth of the time.

use super::level::Demodulated;
use super::unwrap::farness;
use super::unwrap_step::{Step, StepLanes, Turns, q15, word};
use crate::pattern::{Level, Unwrapping};
use crate::simd::Lanes;

/// Levels about a map, prepared for unwrapping.
#[derive(Clone, Debug)]
pub(super) struct About {
    /// The level whose ratio is the largest: of ratio 1 where there are several.
    finest: Rated,
    /// 1/r of the finest level, where that is not 1.
    scale: Option<f32>,
    /// What the other levels add.
    dense: Option<Dense>,
}

/// Levels beside the finest.
#[derive(Clone, Debug)]
struct Dense {
    /// Of ratio 1 − 1/n.
    first: Rated,
    /// From the fast beat to the order of the finest level.
    fast: Step,
    /// Of ratio 1 − 1/n², with the step from the slow beat to the fast one.
    second: Option<(Rated, Step)>,
    /// p of the first and of the second (0 if there is none); that of the first with what the second's residual is less by.
    pull: [f64; 2],
    /// By how much the first moves the mean of the two before the second, per unit of its residual and in units of the second.
    moved: f64,
}

/// A level's ratio in the forms that words need.
#[derive(Clone, Copy, Debug)]
struct Rated {
    /// Whether the ratio is 1.
    one: bool,
    /// Whole part of r.
    whole: i16,
    /// frac(r) in Q15; in Q16; and what the latter leaves over in Q31.
    part: i16,
    high: i16,
    low: i16,
}

impl About {
    /// `None` for levels whose beats words cannot hold.
    pub fn new(unwrapping: Unwrapping, levels: &[Level]) -> Option<Self> {
        let finest = levels.len() - 1;
        let rated = |at: usize| Rated::new(levels[at].ratio);
        let part = |at: usize| levels[at].steps() as f64 * levels[at].ratio;
        let weight = |at: usize| part(at) * levels[at].ratio;
        let total = |levels: core::ops::Range<usize>| levels.map(weight).sum::<f64>();
        // Of three levels.
        let moved = part(0) * levels[1.min(finest)].ratio / (weight(0) + weight(finest));
        let dense = match unwrapping {
            Unwrapping::DenseThree { n } => Some(Dense {
                first: rated(0),
                fast: Step::new(n, n / 2.0 + 1.0, 0.0)?,
                second: Some((rated(1), Step::new(n, 0.5, 0.0)?)),
                pull: [
                    (part(0) + part(1) * moved) / total(0..3),
                    part(1) / total(0..3),
                ],
                moved,
            }),
            Unwrapping::DenseTwo { n } => Some(Dense {
                first: rated(0),
                fast: Step::new(n, 0.5, 0.0)?,
                second: None,
                pull: [part(0) / total(0..2), 0.0],
                moved: 0.0,
            }),
            Unwrapping::Single | Unwrapping::Geometric => None,
        };
        let ratio = levels[finest].ratio;
        Some(Self {
            finest: rated(finest),
            scale: (libm::fabs(ratio - 1.0) > 1e-12).then_some((1.0 / ratio) as f32),
            dense,
        })
    }
}

impl Rated {
    fn new(ratio: f64) -> Self {
        let fraction = ratio - libm::floor(ratio);
        let high = libm::rint(fraction * 65_536.0);
        Self {
            one: libm::fabs(ratio - 1.0) < 1e-12,
            whole: word(libm::floor(ratio)),
            part: q15(fraction),
            high: word(high),
            low: word((fraction * 65_536.0 - high) * 32_768.0),
        }
    }
}

/// A ratio with every constant in all lanes.
struct RatedLanes<V: Lanes> {
    plan: Rated,
    whole: V::W,
    part: V::W,
    high: V::W,
    low: V::W,
}

impl<V: Lanes> RatedLanes<V> {
    #[inline(always)]
    fn new(v: V, plan: Rated) -> Self {
        Self {
            plan,
            whole: v.splat16(plan.whole),
            part: v.splat16(plan.part),
            high: v.splat16(plan.high),
            low: v.splat16(plan.low),
        }
    }

    /// frac(r·x) in 1/65536 turn.
    #[inline(always)]
    fn times(&self, v: V, x: Turns<V>) -> V::W {
        if self.plan.one {
            return x.phase;
        }
        let product = self.part_times(v, x);
        if self.plan.whole == 0 {
            return product;
        }
        v.add(product, v.mul_low(x.phase, self.whole))
    }

    /// frac(r·x) of a ratio below 1.
    #[inline(always)]
    fn part_times(&self, v: V, x: Turns<V>) -> V::W {
        let order = x.nearest(v);
        let orders = v.add(v.mul_low(order, self.high), v.mul_q15(order, self.low));
        v.add(orders, v.mul_q15(x.phase, self.part))
    }
}

/// [`About`] with every constant in all lanes.
pub(super) struct AboutLanes<V: Lanes> {
    finest: RatedLanes<V>,
    scale: Option<V::F>,
    dense: Option<DenseLanes<V>>,
}

struct DenseLanes<V: Lanes> {
    first: RatedLanes<V>,
    fast: StepLanes<V>,
    second: Option<(RatedLanes<V>, StepLanes<V>)>,
    /// −p in Q14: that of the first may be above 1.
    pull: [V::W; 2],
    moved: V::W,
}

/// The levels of a block; of those that a sequence has not, nothing is looked at.
#[derive(Clone, Copy)]
pub(super) struct Around<V: Lanes> {
    /// Of ratio 1 − 1/n.
    pub first: Demodulated<V>,
    /// Of ratio 1 − 1/n².
    pub second: Demodulated<V>,
    /// Whose ratio is the largest.
    pub finest: Demodulated<V>,
}

/// Half a block unwrapped about a map.
pub(super) struct Unwrapped<V: Lanes> {
    /// Φ, 1/65536 turn.
    pub phase: [V::D; 2],
    /// The most that a step left over.
    pub left: V::W,
}

impl<V: Lanes> AboutLanes<V> {
    /// `None` where the plan is not for this number of levels.
    #[inline(always)]
    pub fn new<const LEVELS: usize>(v: V, plan: &About) -> Option<Self> {
        let mut scale = None;
        if let Some(inverse) = plan.scale {
            scale = Some(v.splat_single(inverse));
        }
        let mut dense = None;
        if LEVELS > 1 {
            let Some(plan) = &plan.dense else { return None };
            let mut second = None;
            if LEVELS > 2 {
                let Some((rated, slow)) = &plan.second else {
                    return None;
                };
                second = Some((RatedLanes::new(v, *rated), StepLanes::new(v, slow)));
            }
            dense = Some(DenseLanes {
                first: RatedLanes::new(v, plan.first),
                fast: StepLanes::new(v, &plan.fast),
                second,
                pull: [
                    v.splat16(q15(-plan.pull[0] / 2.0)),
                    v.splat16(q15(-plan.pull[1] / 2.0)),
                ],
                moved: v.splat16(q15(plan.moved)),
            });
        }
        Some(Self {
            finest: RatedLanes::new(v, plan.finest),
            scale,
            dense,
        })
    }

    /// Unwraps half a block (`half` 0 or 1) about `known`, Φ₀ in 1/65536 turn, and the same in turns.
    #[inline(always)]
    pub fn unwrap(
        &self,
        v: V,
        known: [V::D; 2],
        map: Turns<V>,
        levels: &Around<V>,
        half: usize,
    ) -> Unwrapped<V> {
        let finest = &levels.finest;
        match &self.dense {
            Some(dense) => dense.unwrap(v, known, map, levels, half),
            None => {
                let q1 = v.sub(finest.phase[half], self.finest.times(v, map));
                self.single(v, known, q1)
            }
        }
    }

    #[inline(always)]
    fn single(&self, v: V, known: [V::D; 2], q1: V::W) -> Unwrapped<V> {
        let mut delta = v.join(q1, v.sar::<15>(q1));
        if let Some(scale) = self.scale {
            delta = [
                v.to_whole(v.mul_single(v.to_single(delta[0]), scale)),
                v.to_whole(v.mul_single(v.to_single(delta[1]), scale)),
            ];
        }
        Unwrapped {
            phase: [v.add32(known[0], delta[0]), v.add32(known[1], delta[1])],
            // No step, so nothing is left over: whether the map is near enough is known to who made it.
            left: v.splat16(0),
        }
    }
}

impl<V: Lanes> DenseLanes<V> {
    #[inline(always)]
    fn unwrap(
        &self,
        v: V,
        known: [V::D; 2],
        map: Turns<V>,
        levels: &Around<V>,
        half: usize,
    ) -> Unwrapped<V> {
        let zero = v.splat16(0);
        // Of several levels the finest has ratio 1, the others less.
        let q1 = v.sub(levels.finest.phase[half], map.phase);
        let q3 = v.sub(levels.first.phase[half], self.first.part_times(v, map));
        let beat = v.sub(q1, q3);
        let (mut left, mut q2) = (zero, zero);
        let ahead = if let Some((rated, slow)) = &self.second {
            q2 = v.sub(levels.second.phase[half], rated.part_times(v, map));
            let slow_beat = v.sub(q1, q2);
            let [above, _] = slow.ahead_of_start(v, [slow_beat; 2]);
            let climbed;
            (climbed, left) = slow.land(v, above, beat);
            self.fast.ahead(v, [climbed; 2])[0]
        } else {
            self.fast.ahead_of_start(v, [beat; 2])[0]
        };
        let (d1, left_fast) = self.fast.land(v, ahead, q1);
        let e3 = v.sub(self.first.part_times(v, d1), q3);
        left = v.max_unsigned(left, v.max_unsigned(left_fast, farness(v, e3)));
        let mut e2 = zero;
        if let Some((rated, _)) = &self.second {
            // About the mean so far, as far as it matters for trust.
            let moved = v.mul_q15(e3, self.moved);
            e2 = v.sub(v.sub(rated.part_times(v, d1), q2), moved);
            left = v.max_unsigned(left, farness(v, e2));
        }
        let delta = v.join(d1.phase, d1.order);
        let correction = v.dot(e3, self.pull[0], e2, self.pull[1]);
        let known = [v.add32(known[0], delta[0]), v.add32(known[1], delta[1])];
        Unwrapped {
            phase: [
                v.add32(known[0], rounded(v, correction[0])),
                v.add32(known[1], rounded(v, correction[1])),
            ],
            left,
        }
    }
}

/// A double word in Q14 as a whole number, rounded to nearest.
#[inline(always)]
fn rounded<V: Lanes>(v: V, x: V::D) -> V::D {
    v.sar32_by(v.add32(x, v.splat32(1 << 13)), 14)
}
