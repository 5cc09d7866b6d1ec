//! How uncertain a coverage is: pixels whose modulation lies within its noise of the trusted minimum are coins.

use crate::phase::Decoder;
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
/// What one pixel of variance 1 counts: sums are whole numbers, so that their order is nothing.
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
            // A modulation is below full scale, and not a number is no noise.
            sure: (least + SURE * sigma) as u16,
        }
    }

    /// Whether a resolved pixel could as well not be.
    #[inline(always)]
    pub fn unsure(&self, modulation: Modulation) -> bool {
        modulation.to_bits() < self.sure
    }

    /// The variance of the number of resolved pixels that one resolved pixel stands for. Of p(1 − p), p = Φ(x), only x is
    /// known, with an error of its own: so it is taken about x with √2 σ, as that of
    /// [`share_outside`](crate::inspect::gauge::share_outside), and twice, for the pixel as far below the minimum of which
    /// nothing is kept.
    pub fn coin(&self, modulation: Modulation) -> u64 {
        let x = (f64::from(modulation.to_bits()) - self.least) / self.sigma;
        libm::rint(ONE * libm::exp(-x * x / 4.0) / PI) as u64
    }
}

/// σ of a share of `pixels` whose coins sum up to this.
pub(super) fn sigma(coins: u64, pixels: usize) -> f64 {
    libm::sqrt(coins as f64 / ONE) / pixels.max(1) as f64
}
