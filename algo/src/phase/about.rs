//! Unwrapping about a known map Φ₀: dense levels by their beats, or a single level within half a
//! turn.
//!
//! **Idea.** Levels whose ratios are all close to 1 carry the full accuracy each, but none is
//! unambiguous. Relative to a map of about the expected phase, the differences between levels
//! (beats) vary slowly and are unambiguous over n²/2 turns either way. They unwrap each other up to
//! the finest level, and then all levels are averaged.
//!
//! **Equation.** Ratios of Towers, Towers & Jones 2003 (their optimum series): coarse r_c = 1 −
//! 1/n, middle r_m = 1 − 1/n², finest r_f = 1; the middle one may be missing. Each beat is
//! unwrapped by the one before it as by a coarser level ([`UnwrapStep`]); D = Φ − Φ₀:
//!
//! ```text
//! q_i = φ_i − frac(r_i Φ₀)                        i = c, m, f
//! slow beat  q_f − q_m = D / n²                   unambiguous within ± n²/2 turns
//! fast beat  q_f − q_c = D / n                    unwrapped by n · slow
//! D_f = k + q_f                                   unwrapped by n · fast
//! e_i = wrap(r_i D_f − q_i)                       residual of level i = c, m about the finest
//! D   = D_f − Σ p_i e_i,    p_i = N_i r_i / Σ N r²
//! ```
//!
//! The last line is the mean of D_i = D_f − e_i / r_i with weights N_i r_i². Adding one level after
//! the other to the mean would give the same fringe orders, and so the same mean. A **single**
//! level has D = wrap(q_f) / r_f: it is right only within half a turn of the map.
//!
//! **Shapes and units.** Half a block of pixels; wrapped phases and residuals in words of 1/65536
//! turn, Φ₀ and Φ in double words of 1/65536 turn.
//!
//! **Departures.** The best weights are N_i r_i² B_i²; the modulations B_i are left out, which
//! saves a quotient and a root per pixel, a fifth of the time. Dense levels have nearly the same
//! modulation: at a pitch of 8 pixels a blur of 1 pixel (σ) leaves 0.81 at r = 5/6 and 0.73 at r =
//! 1, so σ_Φ is 0.3 % above its least (`weights_without_modulations_lose_next_to_nothing`).
//!
//! **Accuracy.** Every form against the textbook in f64, and no wrong fringe order:
//! `any_shifts_depth_ratios_size_and_stride_decode_as_the_textbook_says`,
//! `no_fringe_order_slips_at_any_wrap_about_a_map`.

use super::level::Demodulated;
use super::unwrap_step::{Absolute, Turns, UnwrapStep, UnwrapStepLanes, q15, word};
use crate::pattern::{Level, Unwrapping};
use crate::simd::Lanes;

/// The plan of unwrapping about a map.
#[derive(Clone, Debug)]
pub(super) struct About {
    /// The level of the largest ratio; of dense levels it is 1.
    finest: FixedRatio,
    /// 1/r of the finest level, where that is not 1.
    scale: Option<f32>,
    /// The other levels, where there are any.
    dense: Option<Dense>,
}

/// The levels beside the finest.
#[derive(Clone, Debug)]
struct Dense {
    /// r_c = 1 − 1/n.
    coarse: FixedRatio,
    /// From the fast beat to the order of the finest level.
    fast: UnwrapStep,
    /// r_m = 1 − 1/n², and the step from the slow beat to the fast one.
    middle: Option<(FixedRatio, UnwrapStep)>,
    /// p_c and p_m (0 without a middle level). With a middle level p_c includes p_m · `mean_gain`,
    /// because the kernel takes e_m about the mean of finest and coarse level.
    weights: [f64; 2],
    /// By how much e_m about the mean of finest and coarse level is smaller than about the finest
    /// level, as a share of e_c.
    mean_gain: f64,
}

/// A level's ratio r in fixed point.
#[derive(Clone, Copy, Debug)]
struct FixedRatio {
    /// Whether r is 1.
    one: bool,
    /// Whole part of r.
    whole: i16,
    /// frac(r) in Q15, for phases.
    part: i16,
    /// frac(r) in Q16 and the remainder in Q31, for fringe orders.
    high: i16,
    low: i16,
}

impl About {
    /// `None` for levels whose beats do not fit words.
    pub fn new(unwrapping: Unwrapping, levels: &[Level]) -> Option<Self> {
        let finest = levels.len() - 1;
        let ratio_of = |at: usize| FixedRatio::new(levels[at].ratio);
        let part = |at: usize| levels[at].shifts() as f64 * levels[at].ratio;
        let weight = |at: usize| part(at) * levels[at].ratio;
        let total = |levels: core::ops::Range<usize>| levels.map(weight).sum::<f64>();
        // Used with three levels only.
        let mean_gain = part(0) * levels[1.min(finest)].ratio / (weight(0) + weight(finest));
        let dense = match unwrapping {
            Unwrapping::DenseThree { n } => {
                let slow = UnwrapStep::new(n, 0.5, 0.0, None)?;
                Some(Dense {
                    coarse: ratio_of(0),
                    fast: UnwrapStep::new(n, n / 2.0 + 1.0, 0.0, Some(&slow))?,
                    middle: Some((ratio_of(1), slow)),
                    weights: [
                        (part(0) + part(1) * mean_gain) / total(0..3),
                        part(1) / total(0..3),
                    ],
                    mean_gain,
                })
            }
            Unwrapping::DenseTwo { n } => Some(Dense {
                coarse: ratio_of(0),
                fast: UnwrapStep::new(n, 0.5, 0.0, None)?,
                middle: None,
                weights: [part(0) / total(0..2), 0.0],
                mean_gain: 0.0,
            }),
            Unwrapping::Single | Unwrapping::Geometric => None,
        };
        let ratio = levels[finest].ratio;
        Some(Self {
            finest: ratio_of(finest),
            scale: (libm::fabs(ratio - 1.0) > 1e-12).then_some((1.0 / ratio) as f32),
            dense,
        })
    }
}

impl FixedRatio {
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

/// [`FixedRatio`] with every constant in all lanes.
struct FixedRatioLanes<V: Lanes> {
    plan: FixedRatio,
    whole: V::W,
    part: V::W,
    high: V::W,
    low: V::W,
}

impl<V: Lanes> FixedRatioLanes<V> {
    #[inline(always)]
    fn new(v: V, plan: FixedRatio) -> Self {
        Self {
            plan,
            whole: v.splat16(plan.whole),
            part: v.splat16(plan.part),
            high: v.splat16(plan.high),
            low: v.splat16(plan.low),
        }
    }

    /// frac(r · x) in 1/65536 turn, for any ratio.
    #[inline(always)]
    fn fraction_of(&self, v: V, x: Turns<V>) -> V::W {
        if self.plan.one {
            return x.phase;
        }
        let product = self.fraction_below_one(v, x);
        if self.plan.whole == 0 {
            return product;
        }
        v.add(product, v.mul_low(x.phase, self.whole))
    }

    /// frac(r · x) in 1/65536 turn, for a ratio below 1.
    #[inline(always)]
    fn fraction_below_one(&self, v: V, x: Turns<V>) -> V::W {
        let order = x.nearest_order(v);
        let orders = v.add(v.mul_low(order, self.high), v.mul_q15(order, self.low));
        v.add(orders, v.mul_q15(x.phase, self.part))
    }
}

/// Unwrapping by a single level, with every constant in all lanes.
pub(super) struct SingleLanes<V: Lanes> {
    ratio: FixedRatioLanes<V>,
    /// 1/r, where that is not 1.
    scale: Option<V::F>,
}

/// Unwrapping by dense levels, with every constant in all lanes.
pub(super) struct DenseLanes<V: Lanes> {
    coarse: FixedRatioLanes<V>,
    fast: UnwrapStepLanes<V>,
    middle: Option<(FixedRatioLanes<V>, UnwrapStepLanes<V>)>,
    /// −p in Q14, because p_c may be above 1.
    weights: [V::W; 2],
    /// Q15.
    mean_gain: V::W,
}

/// The demodulated dense levels of a block.
#[derive(Clone, Copy)]
pub(super) struct BlockLevels<V: Lanes> {
    /// r_c = 1 − 1/n.
    pub coarse: Demodulated<V>,
    /// r_m = 1 − 1/n²; not read where there are two levels.
    pub middle: Demodulated<V>,
    /// r_f = 1.
    pub finest: Demodulated<V>,
}

/// Half a block unwrapped about a map.
pub(super) struct Unwrapped<V: Lanes> {
    /// Φ, 1/65536 turn.
    pub phase: [V::D; 2],
    /// The largest residual of the unwrapping steps and of the levels, unsigned.
    pub residual: V::W,
}

impl<V: Lanes> SingleLanes<V> {
    #[inline(always)]
    pub fn new(v: V, plan: &About) -> Self {
        let mut scale = None;
        if let Some(inverse) = plan.scale {
            scale = Some(v.splat_single(inverse));
        }
        Self {
            ratio: FixedRatioLanes::new(v, plan.finest),
            scale,
        }
    }

    /// Half a block: Φ = Φ₀ + wrap(q_f) / r_f, from Φ₀ as double words (`known`) and as orders and
    /// fractions (`map`), and the level's wrapped phases.
    #[inline(always)]
    pub fn unwrap(&self, v: V, known: [V::D; 2], map: Turns<V>, phase: V::W) -> Unwrapped<V> {
        let q_f = v.sub(phase, self.ratio.fraction_of(v, map));
        let mut delta = v.join(q_f, v.sar::<15>(q_f));
        if let Some(scale) = self.scale {
            delta = [
                v.to_whole(v.mul_single(v.to_single(delta[0]), scale)),
                v.to_whole(v.mul_single(v.to_single(delta[1]), scale)),
            ];
        }
        Unwrapped {
            phase: [v.add32(known[0], delta[0]), v.add32(known[1], delta[1])],
            // A single level has no residual: that the map is near enough is ensured where the map
            // is made.
            residual: v.splat16(0),
        }
    }
}

impl<V: Lanes> DenseLanes<V> {
    /// `None` if the plan is for another number of levels.
    #[inline(always)]
    pub fn new(v: V, plan: &About, three: bool) -> Option<Self> {
        let Some(plan) = &plan.dense else { return None };
        let mut middle = None;
        if three {
            let Some((ratio, slow)) = &plan.middle else {
                return None;
            };
            middle = Some((
                FixedRatioLanes::new(v, *ratio),
                UnwrapStepLanes::new(v, slow),
            ));
        }
        Some(Self {
            coarse: FixedRatioLanes::new(v, plan.coarse),
            fast: UnwrapStepLanes::new(v, &plan.fast),
            middle,
            weights: [
                v.splat16(q15(-plan.weights[0] / 2.0)),
                v.splat16(q15(-plan.weights[1] / 2.0)),
            ],
            mean_gain: v.splat16(q15(plan.mean_gain)),
        })
    }

    /// Unwraps half a block (`half` 0 or 1) about Φ₀, given as double words (`known`) and as orders
    /// and fractions (`map`).
    #[inline(always)]
    pub fn unwrap(
        &self,
        v: V,
        known: [V::D; 2],
        map: Turns<V>,
        levels: &BlockLevels<V>,
        half: usize,
    ) -> Unwrapped<V> {
        let zero = v.splat16(0);
        // r_f is 1 and the other ratios are below 1.
        let q_f = v.sub(levels.finest.phase[half], map.phase);
        let coarse_expected = self.coarse.fraction_below_one(v, map);
        let q_c = v.sub(levels.coarse.phase[half], coarse_expected);
        let fast_beat = v.sub(q_f, q_c);
        let (mut residual, mut q_m) = (zero, zero);
        let mut fast = Absolute::from_wrapped(v, fast_beat);
        if let Some((ratio, slow)) = &self.middle {
            q_m = v.sub(levels.middle.phase[half], ratio.fraction_below_one(v, map));
            let slow_beat = Absolute::from_wrapped(v, v.sub(q_f, q_m));
            (fast, residual) = slow.unwrap(v, slow_beat, fast_beat);
        }
        let (d_f, residual_fast) = self.fast.unwrap(v, fast, q_f);
        let d_f = d_f.turns;
        let e_c = v.sub(self.coarse.fraction_below_one(v, d_f), q_c);
        residual = v.max_unsigned(residual, v.max_unsigned(residual_fast, v.abs(e_c)));
        let mut e_m = zero;
        if let Some((ratio, _)) = &self.middle {
            // About the mean of finest and coarse level, as the residual's limit asks for.
            let moved = v.mul_q15(e_c, self.mean_gain);
            e_m = v.sub(v.sub(ratio.fraction_below_one(v, d_f), q_m), moved);
            residual = v.max_unsigned(residual, v.abs(e_m));
        }
        let delta = v.join(d_f.phase, d_f.order);
        let correction = v.dot(e_c, self.weights[0], e_m, self.weights[1]);
        let known = [v.add32(known[0], delta[0]), v.add32(known[1], delta[1])];
        Unwrapped {
            phase: [
                v.add32_rounded::<14>(known[0], correction[0]),
                v.add32_rounded::<14>(known[1], correction[1]),
            ],
            residual,
        }
    }
}
