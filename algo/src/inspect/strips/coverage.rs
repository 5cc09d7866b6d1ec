//! How uncertain a coverage is: pixels whose modulation lies within its noise of the trusted minimum are coins.

use crate::phase::Decoder;
use crate::pipeline::NO_RISE;
use crate::simd::{Lanes, back_end_entry};
use crate::units::Modulation;
use core::f64::consts::PI;

/// Where pixels come and go with the noise. Modulations are in units of full scale / 65535.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threshold {
    least: f64,
    sigma: f64,
    /// From here on they stay.
    sure: u16,
}

/// Farther above the minimum than this many σ a pixel is no coin: e⁻¹⁶.
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
            // Not a number is no noise.
            sure: (least + SURE * sigma) as u16,
        }
    }

    /// Whether a resolved pixel could as well not be. Others have no modulation.
    #[inline(always)]
    fn unsure(&self, modulation: Modulation) -> bool {
        modulation.to_bits().wrapping_sub(1) < self.sure
    }

    /// The variance of the number of resolved pixels that one resolved pixel stands for. Of p(1 − p), p = Φ(x), only x is
    /// known, with an error of its own: so it is taken about x with √2 σ, as that of
    /// [`share_outside`](crate::inspect::gauge::share_outside), and twice, for the pixel as far below the minimum of which
    /// nothing is kept.
    fn coin(&self, modulation: Modulation) -> u64 {
        let x = (f64::from(modulation.to_bits()) - self.least) / self.sigma;
        libm::rint(ONE * libm::exp(-x * x / 4.0) / PI) as u64
    }
}

/// Pixels that are looked at together: mostly there is no coin among them.
const BLOCK: usize = 64;

back_end_entry! {
    /// Adds what the coins of a row count.
    fn add_coins [] = coins(
        threshold: &Threshold,
        rises: &[i32],
        modulations: &[Modulation],
        sum: &mut u64,
    )
}

#[inline(always)]
fn coins<V: Lanes>(
    _: V,
    threshold: &Threshold,
    rises: &[i32],
    modulations: &[Modulation],
    sum: &mut u64,
) {
    for (rises, modulations) in rises.chunks(BLOCK).zip(modulations.chunks(BLOCK)) {
        let mut unsure = false;
        for &modulation in modulations {
            unsure |= threshold.unsure(modulation);
        }
        if !unsure {
            continue;
        }
        for (&rise, &modulation) in rises.iter().zip(modulations) {
            if rise != NO_RISE && threshold.unsure(modulation) {
                *sum += threshold.coin(modulation);
            }
        }
    }
}

/// σ of a share of `pixels` whose coins sum up to this.
pub(super) fn sigma(coins: u64, pixels: usize) -> f64 {
    libm::sqrt(coins as f64 / ONE) / pixels.max(1) as f64
}
