//! Stage 4, accumulate: how many pixels of a region have a height, and how uncertain that number
//! is.
//!
//! A pixel is resolved if its modulation B is at least B_min. Where B lies within its noise σ of
//! that, the pixel is resolved in one measurement and not in the next: its variance is p(1 − p),
//! p = Φ((B₀ − B_min)/σ) with the true modulation B₀. Of that only the measured B is known, which
//! scatters by σ, too. But the density of measured modulations at B_min, per σ, is φ((B₀ −
//! B_min)/σ) for every pixel. φ/√π differs from p(1 − p) by less than 0.03 everywhere and has the
//! same integral over all B₀, so the variance of the number of resolved pixels is this density over
//! √π, whether modulations are spread evenly or lie together some σ beside the threshold.
//! Modulations below B_min are not kept: the density is that of the first half σ above it,
//! extrapolated along a straight line.
//!
//! In each of L dense levels, whose pitches are nearly the same, a pixel must pass the threshold,
//! but only the finest's modulation is kept. If all levels have the same modulation, the
//! probability is pᴸ instead of p, and the same comparison of integrals gives L (E_2L − E_L)
//! instead of 1/√π = E_2 − E_1, with E_n the expected largest of n standard normal numbers. If the
//! coarser levels have some σ more modulation, it stays 1/√π. Which of both holds depends on the
//! lens, which is not known here. Their geometric mean is taken: the predicted σ is within a
//! quarter of both.
//!
//! The error of the part's motion, which moves the region by some hundredths of a pixel, is left
//! out.

use crate::frame::SampleNoise;
use crate::pattern::Unwrapping;
use crate::phase::Decoder;
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use crate::units::{Height, Modulation};

/// The modulations at which it is uncertain whether a pixel is resolved, in units of full scale
/// / 65535.
#[derive(Clone, Copy, Debug)]
pub struct Threshold {
    least: f64,
    sigma: f64,
    /// The variance that a density of one pixel per σ at the threshold makes.
    variance: f64,
    /// From here on a pixel says nothing of the density at the threshold.
    beyond: u16,
    /// Pixels whose height is this far from golden's or lower are not of the part, nm.
    behind: i32,
}

/// Width above the threshold, in σ, within which the density of modulations is taken for a straight
/// line.
const WIDTH: f64 = 0.5;
/// L (E_2L − E_L) for L levels of the same modulation: E = 0, 0.5642, 0.8463, 1.0294 and 1.2672 for
/// the largest of 1, 2, 3, 4 and 6 (Teichroew, Ann. Math. Stat. 27, 1956).
const ONE_LEVEL: f64 = 0.5642;
const TWO_LEVELS: f64 = 2.0 * (1.0294 - 0.5642);
const THREE_LEVELS: f64 = 3.0 * (1.2672 - 0.8463);
/// What one pixel of variance 1 counts: sums are whole numbers, so that the order of summation does
/// not matter.
const ONE: f64 = 1_048_576.0;

impl Threshold {
    /// Of samples with this noise.
    pub fn new(decoder: &Decoder, noise: SampleNoise) -> Self {
        let unit = f64::from(u16::MAX) / f64::from(decoder.full_scale());
        let least = decoder.least_modulation().counts(decoder.full_scale());
        let sigma = decoder.modulation_noise(noise.at(least)) * unit;
        let least = least * unit;
        Self {
            least,
            sigma,
            variance: match decoder.unwrapping() {
                Unwrapping::Geometric | Unwrapping::Single => ONE_LEVEL,
                Unwrapping::DenseTwo { .. } => libm::sqrt(ONE_LEVEL * TWO_LEVELS),
                Unwrapping::DenseThree { .. } => libm::sqrt(ONE_LEVEL * THREE_LEVELS),
            },
            // Not a number becomes 0: then no pixel is uncertain.
            beyond: (least + WIDTH * sigma) as u16,
            behind: NO_OFFSET,
        }
    }

    /// The same, where heights that lie `mm` behind golden's, or farther, are those of the part's
    /// surroundings.
    pub fn in_front_of(mut self, mm: Option<f64>) -> Self {
        self.behind = mm.map_or(NO_OFFSET, |mm| Height::from_mm(-mm).nm());
        self
    }

    /// Whether a modulation is just above the threshold; pixels that are not resolved have a
    /// modulation of 0.
    #[inline(always)]
    fn is_near(&self, modulation: Modulation) -> bool {
        modulation.to_bits().wrapping_sub(1) < self.beyond
    }

    /// What a pixel just above the threshold adds to the variance of the number of resolved pixels,
    /// in 1/[`ONE`]: the weights a + b x whose sum over a density c + d x in 0 ≤ x < [`WIDTH`] is
    /// c, times the variance of that density.
    fn variance(&self, modulation: Modulation) -> i64 {
        let x = (f64::from(modulation.to_bits()) - self.least) / (self.sigma * WIDTH);
        libm::rint(ONE * self.variance * (4.0 - 6.0 * x) / WIDTH) as i64
    }
}

/// Pixels that are looked at together: in most blocks none is near the threshold.
const BLOCK: usize = 64;

back_end_entry! {
    /// Adds the number of pixels with a height of the part to `count`.
    fn count_known [] = known(threshold: &Threshold, offsets: &[i32], count: &mut u64)
}

back_end_entry! {
    /// Adds what the pixels of a row say of the variance to `sum`.
    fn add_variances [] = variances(
        threshold: &Threshold,
        offsets: &[i32],
        modulations: &[Modulation],
        sum: &mut i64,
    )
}

#[inline(always)]
fn known<V: Lanes>(_: V, threshold: &Threshold, offsets: &[i32], count: &mut u64) {
    let mut known = 0_u32;
    // [`NO_OFFSET`] is the least of all.
    for &offset in offsets {
        known = known.wrapping_add(u32::from(offset > threshold.behind));
    }
    *count += u64::from(known);
}

#[inline(always)]
fn variances<V: Lanes>(
    _: V,
    threshold: &Threshold,
    offsets: &[i32],
    modulations: &[Modulation],
    sum: &mut i64,
) {
    for (offsets, modulations) in offsets.chunks(BLOCK).zip(modulations.chunks(BLOCK)) {
        let mut near = false;
        for &modulation in modulations {
            near |= threshold.is_near(modulation);
        }
        if !near {
            continue;
        }
        for (&offset, &modulation) in offsets.iter().zip(modulations) {
            if offset > threshold.behind && threshold.is_near(modulation) {
                *sum += threshold.variance(modulation);
            }
        }
    }
}

/// σ of the share of `pixels` pixels that are resolved, from the sum of what they say of its
/// variance: of a few pixels that may be negative by chance.
pub fn sigma(variance: i64, pixels: usize) -> f64 {
    libm::sqrt(variance.max(0) as f64 / ONE) / pixels.max(1) as f64
}
