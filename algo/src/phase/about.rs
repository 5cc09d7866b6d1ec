//! Unwrapping about a known map Φ₀: dense levels by their beats, or a single level within half a turn.
//!
//! q_i = φ_i − frac(r_i Φ₀). With D = Φ − Φ₀ the slow beat a = q₁ − q₂ = D/n² unwraps the fast one b = q₁ − q₃ = D/n, and
//! that gives the order of level 1 (ratio 1): D₁ = k + q₁. The other levels are then a residual away from it,
//! e_i = wrap(r_i D₁ − q_i), D_i = D₁ − e_i/r_i, and D is the mean of the D_i with weights N_i r_i² B_i²: one quotient per
//! pixel, D = D₁ − Σ w_i e_i/r_i / Σ w_i. It is the weighted mean that takes one level after the other, because the orders
//! are the same.

use super::level::Demodulated;
use super::unwrap::{MAX_RESIDUAL_BITS, beyond};
use crate::pattern::{Level, Unwrapping};
use crate::simd::Lanes;

/// Most levels about a map.
pub(super) const MAX_ABOUT: usize = 3;

/// Levels about a map, prepared for unwrapping.
#[derive(Clone, Debug)]
pub(super) struct About {
    /// The level whose ratio is the largest: of ratio 1 where there are several.
    finest: Rated,
    /// From the slow beat to the fast one.
    slow: Option<Beat>,
    /// From the fast beat to the order of the finest level.
    fast: Option<Beat>,
    /// The other levels in the order in which they are averaged.
    others: heapless::Vec<Other, 2>,
    /// 1/r of the finest level, where that is not 1.
    scale: Option<f32>,
    /// What each level's modulation counts for in the mean of all, Q15.
    shares: [i16; MAX_ABOUT],
    /// Σ N r², relative to the finest level's.
    weights: f32,
}

/// A level's ratio in the forms that words need.
#[derive(Clone, Copy, Debug)]
struct Rated {
    /// Place among the levels from coarse to fine.
    at: usize,
    /// Whether the ratio is 1.
    one: bool,
    /// Whole part of r.
    whole: i16,
    /// frac(r) in Q15; in Q16; and what the latter leaves over in Q31.
    part: i16,
    high: i16,
    low: i16,
    /// N r², relative to the finest.
    weight: f32,
}

#[derive(Clone, Copy, Debug)]
struct Other {
    rated: Rated,
    /// 1/r.
    inverse: f32,
    /// By how much the levels before it are expected to have moved the mean, per unit of their residual, in units of this
    /// level: with equal modulation, Q15.
    moved: i16,
}

/// From a beat x (with |x| ≤ `reach`) to n·x, whose fraction is measured.
#[derive(Clone, Copy, Debug)]
struct Beat {
    /// Whole part of n, its fraction in Q15 and in Q16.
    whole: i16,
    part_q15: i16,
    part_q16: i16,
    /// Bits of the order of x, with its sign.
    order_bits: u8,
    /// n in the fixed point of the product.
    gain: i16,
    /// Fractional bits of the product.
    bits: u8,
}

/// A number of turns: whole ones and 1/65536.
#[derive(Clone, Copy)]
struct Turns<W> {
    order: W,
    phase: W,
}

impl About {
    pub fn new(unwrapping: Unwrapping, levels: &[Level]) -> Self {
        let finest = levels.len() - 1;
        let (n, order): (f64, &[usize]) = match unwrapping {
            Unwrapping::DenseThree { n } => (n, &[0, 1]),
            Unwrapping::DenseTwo { n } => (n, &[0]),
            Unwrapping::Single | Unwrapping::Geometric => (1.0, &[]),
        };
        let weight = |at: usize| levels[at].steps() as f64 * levels[at].ratio * levels[at].ratio;
        let rated = |at: usize| Rated::new(at, levels[at].ratio, weight(at) / weight(finest));
        let fast_reach = match unwrapping {
            Unwrapping::DenseThree { .. } => n / 2.0 + 1.0,
            _ => 0.5,
        };
        let three = matches!(unwrapping, Unwrapping::DenseThree { .. });
        // Equal modulation: the first of the others has moved the mean by −e·(w/W)/r.
        let mut others = heapless::Vec::new();
        for (place, &at) in order.iter().enumerate() {
            let moved = if place == 0 {
                0.0
            } else {
                let first = order[0];
                let share = weight(first) / (weight(finest) + weight(first));
                share / levels[first].ratio * levels[at].ratio
            };
            // Two others at most.
            let _ = others.push(Other {
                rated: rated(at),
                inverse: (1.0 / levels[at].ratio) as f32,
                moved: q15(moved),
            });
        }
        let total: f64 = (0..levels.len()).map(weight).sum();
        let mut shares = [0; MAX_ABOUT];
        for (at, share) in shares.iter_mut().enumerate().take(levels.len()) {
            *share = q15(weight(at) / total);
        }
        let ratio = levels[finest].ratio;
        Self {
            finest: rated(finest),
            slow: three.then(|| Beat::new(n, 0.5)),
            fast: (!order.is_empty()).then(|| Beat::new(n, fast_reach)),
            others,
            scale: (libm::fabs(ratio - 1.0) > 1e-12).then_some((1.0 / ratio) as f32),
            shares,
            weights: (total / weight(finest)) as f32,
        }
    }
}

/// In Q15, at most 32767.
fn q15(x: f64) -> i16 {
    libm::rint(x * 32_768.0).clamp(-32_767.0, 32_767.0) as i16
}

/// The low 16 bits of the number next to x.
fn word(x: f64) -> i16 {
    libm::rint(x) as i64 as i16
}

impl Rated {
    fn new(at: usize, ratio: f64, weight: f64) -> Self {
        let fraction = ratio - libm::floor(ratio);
        let high = libm::rint(fraction * 65_536.0);
        Self {
            at,
            one: libm::fabs(ratio - 1.0) < 1e-12,
            whole: word(libm::floor(ratio)),
            part: q15(fraction),
            high: word(high),
            low: word((fraction * 65_536.0 - high) * 32_768.0),
            weight: weight as f32,
        }
    }

    /// frac(r·x) in 1/65536 turn, for |x's phase| ≤ ½.
    #[inline(always)]
    fn times<V: Lanes>(&self, v: V, x: Turns<V::W>) -> V::W {
        if self.one {
            return x.phase;
        }
        let orders = v.add(
            v.mul_low(x.order, v.splat16(self.high)),
            v.mul_q15(x.order, v.splat16(self.low)),
        );
        let product = v.add(orders, v.mul_q15(x.phase, v.splat16(self.part)));
        if self.whole == 0 {
            product
        } else {
            v.add(product, v.mul_low(x.phase, v.splat16(self.whole)))
        }
    }
}

impl Beat {
    fn new(n: f64, reach: f64) -> Self {
        // Enough that |order| ≤ reach + ½ fits with its sign; none for a beat within half a turn.
        let order_bits = if reach <= 0.5 {
            0
        } else {
            libm::ceil(libm::log2(2.0 * (reach + 0.5))) as u8
        };
        let range = libm::pow(2.0, f64::from(order_bits));
        let fits = 32_767.0 / (n * (reach + 0.5) + 1.0);
        // The product is taken by Q15, so its gain is n · range / 2 at the product's fractional bits.
        let gain_fits = 32_767.0 / (n * range / 2.0);
        let bits = libm::floor(libm::log2(fits.min(gain_fits)));
        let part = n - libm::floor(n);
        Self {
            whole: word(libm::floor(n)),
            part_q15: q15(part),
            part_q16: word(part * 65_536.0),
            order_bits,
            gain: word(n * range / 2.0 * libm::pow(2.0, bits)),
            bits: bits as u8,
        }
    }

    /// The number of turns next to n·x whose fraction is `measured`, and whether it is too far from it.
    #[inline(always)]
    fn climb<V: Lanes>(&self, v: V, x: Turns<V::W>, measured: V::W) -> (Turns<V::W>, V::W) {
        let fraction = v.add(
            v.mul_low(x.phase, v.splat16(self.whole)),
            v.mul_q15(x.phase, v.splat16(self.part_q15)),
        );
        let (fraction, product) = if self.order_bits == 0 {
            (fraction, x.phase)
        } else {
            let part = v.mul_low(x.order, v.splat16(self.part_q16));
            let high = v.shl_by(x.order, 16 - self.order_bits);
            (
                v.add(fraction, part),
                v.add(high, v.sar_by(x.phase, self.order_bits)),
            )
        };
        let doubtful = beyond(v, v.sub(fraction, measured), MAX_RESIDUAL_BITS);
        let half = (1_i16 << self.bits) >> 1;
        let turns = v.add(v.mul_q15(product, v.splat16(self.gain)), v.splat16(half));
        let turns = v.sub(turns, v.sar_by(measured, 16 - self.bits));
        let order = v.sar_by(turns, self.bits);
        let phase = measured;
        (Turns { order, phase }, doubtful)
    }
}

/// Half a block of what is known beforehand.
#[derive(Clone, Copy)]
pub(super) struct Known<V: Lanes> {
    /// Φ₀, 1/65536 turn.
    pub map: [V::D; 2],
}

/// Half a block unwrapped about a map.
pub(super) struct Unwrapped<V: Lanes> {
    /// Φ, 1/65536 turn.
    pub phase: [V::D; 2],
    /// The modulation that stands for all levels: their mean with weights N r².
    pub modulation: V::W,
    /// Mask: a step left too much over.
    pub doubtful: V::W,
}

impl About {
    /// Unwraps half a block (`half` 0 or 1).
    #[inline(always)]
    pub fn unwrap<V: Lanes>(
        &self,
        v: V,
        known: Known<V>,
        levels: &[Demodulated<V>],
        half: usize,
    ) -> Unwrapped<V> {
        // The phase part of Φ₀ as −½…½ turn.
        let (phase, order) = v.split(known.map);
        let order = v.sub(order, v.sar::<15>(phase));
        let map = Turns { order, phase };
        let finest = &levels[self.finest.at];
        let q1 = v.sub(finest.phase[half], self.finest.times(v, map));
        let Some(fast) = &self.fast else {
            return self.single(v, known, q1, finest.modulation[half]);
        };
        let Some((first, rest)) = self.others.split_first() else {
            return self.single(v, known, q1, finest.modulation[half]);
        };
        let q3 = v.sub(
            levels[first.rated.at].phase[half],
            first.rated.times(v, map),
        );
        let b = v.sub(q1, q3);
        let zero = v.splat16(0);
        let mut beat = Turns {
            order: zero,
            phase: b,
        };
        let mut doubtful = zero;
        let mut q2 = zero;
        if let (Some(slow), Some(second)) = (&self.slow, rest.first()) {
            q2 = v.sub(
                levels[second.rated.at].phase[half],
                second.rated.times(v, map),
            );
            let a = Turns {
                order: zero,
                phase: v.sub(q1, q2),
            };
            (beat, doubtful) = slow.climb(v, a, b);
        }
        let (d1, off) = fast.climb(v, beat, q1);
        doubtful = v.or(doubtful, off);
        let e3 = v.sub(first.rated.times(v, d1), q3);
        doubtful = v.or(doubtful, beyond(v, e3, MAX_RESIDUAL_BITS));
        let mut e2 = zero;
        if let Some(second) = rest.first() {
            // About the mean so far, as far as it matters for trust.
            let moved = v.mul_q15(e3, v.splat16(second.moved));
            e2 = v.sub(v.sub(second.rated.times(v, d1), q2), moved);
            doubtful = v.or(doubtful, beyond(v, e2, MAX_RESIDUAL_BITS));
        }
        let (correction, modulation) = self.mean(v, levels, half, e3, e2);
        // d1.phase is signed here.
        let whole = v.add(d1.order, v.sar::<15>(d1.phase));
        let delta = v.join(d1.phase, whole);
        Unwrapped {
            phase: [
                v.add32(v.add32(known.map[0], delta[0]), correction[0]),
                v.add32(v.add32(known.map[1], delta[1]), correction[1]),
            ],
            modulation,
            doubtful,
        }
    }

    #[inline(always)]
    fn single<V: Lanes>(&self, v: V, known: Known<V>, q1: V::W, modulation: V::W) -> Unwrapped<V> {
        let mut delta = v.join(q1, v.sar::<15>(q1));
        if let Some(scale) = self.scale {
            let scale = v.splat_single(scale);
            delta = [
                v.to_whole(v.mul_single(v.to_single(delta[0]), scale)),
                v.to_whole(v.mul_single(v.to_single(delta[1]), scale)),
            ];
        }
        Unwrapped {
            phase: [
                v.add32(known.map[0], delta[0]),
                v.add32(known.map[1], delta[1]),
            ],
            modulation,
            // No step, so nothing is left over: whether the map is near enough is known to who made it.
            doubtful: v.splat16(0),
        }
    }

    /// −Σ w_i e_i/r_i / Σ w_i over the levels beside the finest, in 1/65536 turn, and √(Σ N r² B² / Σ N r²).
    #[inline(always)]
    fn mean<V: Lanes>(
        &self,
        v: V,
        levels: &[Demodulated<V>],
        half: usize,
        e3: V::W,
        e2: V::W,
    ) -> ([V::D; 2], V::W) {
        let zero = v.splat16(0);
        let first = &self.others[0];
        let second = self.others.get(1);
        let (b1, b3) = (
            levels[self.finest.at].modulation[half],
            levels[first.rated.at].modulation[half],
        );
        let mut mean = v.add(
            v.mul_q15(b1, v.splat16(self.shares[self.finest.at])),
            v.mul_q15(b3, v.splat16(self.shares[first.rated.at])),
        );
        let (b1, b3) = (v.join(b1, zero), v.join(b3, zero));
        let e3_wide = v.join(e3, v.sar::<15>(e3));
        let (mut b2, mut e2_wide) = (b3, e3_wide);
        if let Some(second) = second {
            let b = levels[second.rated.at].modulation[half];
            let share = v.splat16(self.shares[second.rated.at]);
            mean = v.add(mean, v.mul_q15(b, share));
            b2 = v.join(b, zero);
            e2_wide = v.join(e2, v.sar::<15>(e2));
        }
        let mean = v.join(mean, zero);
        let mut correction = [v.splat32(0); 2];
        let mut modulation = [v.splat32(0); 2];
        let mut quarter = 0;
        while quarter < 2 {
            let e3 = v.to_single(e3_wide[quarter]);
            let w1 = square(v, b1[quarter]);
            let w3 = v.mul_single(square(v, b3[quarter]), v.splat_single(first.rated.weight));
            let mut total = v.add_single(w1, w3);
            let mut sum = v.mul_single(v.mul_single(w3, e3), v.splat_single(first.inverse));
            if let Some(second) = second {
                let weight = v.splat_single(second.rated.weight);
                let w2 = v.mul_single(square(v, b2[quarter]), weight);
                let moved = v.splat_single(f32::from(second.moved) / 32_768.0);
                // e₂ about D₁, not about the mean so far.
                let e2 = v.add_single(v.to_single(e2_wide[quarter]), v.mul_single(e3, moved));
                let e2 = v.mul_single(e2, v.splat_single(second.inverse));
                total = v.add_single(total, w2);
                sum = v.add_single(sum, v.mul_single(w2, e2));
            }
            let inverse = reciprocal(v, total);
            let zero = v.splat_single(0.0);
            let off = v.sub_single(zero, v.mul_single(sum, inverse));
            correction[quarter] = v.to_whole(off);
            let inverse = v.mul_single(inverse, v.splat_single(self.weights));
            modulation[quarter] = v.to_whole(root(v, v.to_single(mean[quarter]), inverse));
            quarter += 1;
        }
        (correction, v.narrow_rounded(modulation, 0))
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
