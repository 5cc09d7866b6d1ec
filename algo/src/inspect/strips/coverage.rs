//! Stage 4, accumulate: how many pixels of a region have a height, and how uncertain that number is.
//!
//! A pixel is resolved if its modulation B is at least B_min. Where B lies within its noise σ of that, the pixel is resolved in one
//! measurement and not in the next: its variance is p(1 − p) with p = Φ((B − B_min)/σ). Only the measured B is known, so p(1 − p) is
//! averaged over its error: e^(−x²/4)/(2π), x = (B − B_min)/σ, has the same integral over all B, σ/√π. It counts twice, for the pixel
//! as far below B_min, whose modulation is not kept. The error of the part's motion, which moves the region by some hundredths of a
//! pixel, is left out.

use crate::phase::Decoder;
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use crate::units::Modulation;
use core::f64::consts::PI;

/// The modulations at which it is uncertain whether a pixel is resolved, in units of full scale / 65535.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threshold {
    least: f64,
    sigma: f64,
    /// From here on a pixel is resolved in every measurement.
    sure: u16,
}

/// A pixel is sure to be resolved from this many σ above the threshold: e⁻¹⁶ is left of its variance.
const SURE: f64 = 8.0;
/// What one pixel of variance 1 counts: sums are whole numbers, so that the order of summation does not matter.
const ONE: f64 = 1_048_576.0;

impl Threshold {
    /// Of samples with this noise, in counts.
    pub fn new(decoder: &Decoder, noise_counts: f64) -> Self {
        let unit = f64::from(u16::MAX) / f64::from(decoder.full_scale());
        let least = decoder.least_modulation() * unit;
        let sigma = decoder.modulation_noise(noise_counts) * unit;
        Self {
            least,
            sigma,
            // Not a number becomes 0: then no pixel is uncertain.
            sure: (least + SURE * sigma) as u16,
        }
    }

    /// Whether a resolved pixel could as well not be; pixels that are not resolved have a modulation of 0.
    #[inline(always)]
    fn is_uncertain(&self, modulation: Modulation) -> bool {
        modulation.to_bits().wrapping_sub(1) < self.sure
    }

    /// The variance that a resolved pixel adds to the number of resolved pixels, in 1/[`ONE`].
    fn variance(&self, modulation: Modulation) -> u64 {
        let x = (f64::from(modulation.to_bits()) - self.least) / self.sigma;
        libm::rint(ONE * libm::exp(-x * x / 4.0) / PI) as u64
    }
}

/// Pixels that are looked at together: in most blocks none is uncertain.
const BLOCK: usize = 64;

back_end_entry! {
    /// Adds the number of pixels with a height to `count`.
    fn count_known [] = known(offsets: &[i32], count: &mut u64)
}

back_end_entry! {
    /// Adds the variances of the uncertain pixels of a row to `sum`.
    fn add_variances [] = variances(
        threshold: &Threshold,
        offsets: &[i32],
        modulations: &[Modulation],
        sum: &mut u64,
    )
}

#[inline(always)]
fn known<V: Lanes>(_: V, offsets: &[i32], count: &mut u64) {
    let mut known = 0_u32;
    for &offset in offsets {
        known = known.wrapping_add(u32::from(offset != NO_OFFSET));
    }
    *count += u64::from(known);
}

#[inline(always)]
fn variances<V: Lanes>(
    _: V,
    threshold: &Threshold,
    offsets: &[i32],
    modulations: &[Modulation],
    sum: &mut u64,
) {
    for (offsets, modulations) in offsets.chunks(BLOCK).zip(modulations.chunks(BLOCK)) {
        let mut uncertain = false;
        for &modulation in modulations {
            uncertain |= threshold.is_uncertain(modulation);
        }
        if !uncertain {
            continue;
        }
        for (&offset, &modulation) in offsets.iter().zip(modulations) {
            if offset != NO_OFFSET && threshold.is_uncertain(modulation) {
                *sum += threshold.variance(modulation);
            }
        }
    }
}

/// σ of the share of `pixels` pixels that are resolved, from the sum of their variances.
pub(super) fn sigma(variance: u64, pixels: usize) -> f64 {
    libm::sqrt(variance as f64 / ONE) / pixels.max(1) as f64
}
