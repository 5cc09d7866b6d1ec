//! Whether a pixel is resolved, and if not, the first reason.
//!
//! A level is too dark below the [`LeastModulation`] of its decoder: 4.3 σ of a sample and at least
//! 4 counts of 255, or 16 where σ is not known. The pixel is `Dark` if its coarsest level is too
//! dark, and has `LowModulation` if only a finer one is.

/// σ of a sample over the least modulation that is trusted. It decides how rare wrong fringe orders
/// are: uniform noise of ±2.5 % of full scale (Peng & Gupta 2008), σ = 3.68 of 255 counts, gives 16
/// counts.
pub const NOISE_OVER_LEAST: f64 = 0.23;

/// Largest rounding residual of an unwrapping step, in turns: the fringe order of a larger one would
/// be a guess.
pub(crate) const MAX_RESIDUAL: f64 = 0.40;

/// The least modulation that is trusted, in counts of an 8-bit sample; scales with full scale.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct LeastModulation(f64);

impl LeastModulation {
    /// The lowest and the highest least modulation that can be decoded with: below, rounding to
    /// whole counts is not like noise any more; and no modulation is above half of full scale.
    pub const BOUNDS: [f64; 2] = [4.0, 127.5];

    /// The least modulation of so many counts of an 8-bit sample; `None` out of [`Self::BOUNDS`].
    pub fn new(counts: f64) -> Option<Self> {
        let [low, high] = Self::BOUNDS;
        (low..=high).contains(&counts).then_some(Self(counts))
    }

    /// The least modulation for samples of so many bits with σ = `noise` counts: σ /
    /// [`NOISE_OVER_LEAST`] = 4.3 σ, within [`Self::BOUNDS`]; the default if σ is not a number.
    pub fn of_noise(noise: f64, bit_depth: u8) -> Self {
        let full_scale = (1_u32 << bit_depth.min(16)) - 1;
        let counts = noise * 255.0 / f64::from(full_scale) / NOISE_OVER_LEAST;
        let [low, high] = Self::BOUNDS;
        Self::new(counts.clamp(low, high)).unwrap_or_default()
    }

    /// In counts of an 8-bit sample.
    pub fn eight_bit(self) -> f64 {
        self.0
    }

    /// In counts of samples with this full scale.
    pub fn counts(self, full_scale: u16) -> f64 {
        self.0 * f64::from(full_scale) / 255.0
    }
}

/// 16 counts, where the noise is not known.
impl Default for LeastModulation {
    fn default() -> Self {
        Self(16.0)
    }
}

/// Whether a pixel is resolved, or the first reason why it is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Trust {
    /// Phase (and height) are valid.
    Resolved = 0,
    /// The coarsest level's modulation is below the least that is trusted ([`LeastModulation`]):
    /// the pixel sees none of the pattern.
    #[default]
    Dark = 1,
    /// A finer level's modulation is below the least that is trusted: its fringes are not resolved.
    LowModulation = 2,
    /// Samples are at full scale, and the others give no phase that is trusted.
    Saturated = 3,
    /// The residual of an unwrapping step is above 0.40 turn: the fringe order would be a guess.
    Residual = 4,
    /// No height in the working range has this phase, or more than one has.
    OutOfRange = 5,
    /// The map that the levels are unwrapped about has no phase here, so the pixel was not decoded.
    Unexpected = 6,
    /// Light changes so steeply beside the pixel that its phase may be that of its brighter side.
    LightEdge = 7,
}

impl Trust {
    /// Every reason for rejecting a pixel. A pixel has the first that applies.
    pub const REASONS: [Self; 7] = [
        Self::Unexpected,
        Self::Dark,
        Self::LowModulation,
        Self::Saturated,
        Self::Residual,
        Self::LightEdge,
        Self::OutOfRange,
    ];

    /// The largest number of a variant that blocks of pixels get.
    pub(crate) const LAST: u8 = Self::Unexpected as u8;

    /// The word for reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Resolved => "resolved",
            Self::Dark => "dark",
            Self::LowModulation => "low_modulation",
            Self::Saturated => "saturated",
            Self::Residual => "residual",
            Self::OutOfRange => "out_of_range",
            Self::Unexpected => "unexpected",
            Self::LightEdge => "light_edge",
        }
    }

    /// Whether the phase is valid (the height may still be out of range).
    pub fn has_phase(self) -> bool {
        matches!(self, Self::Resolved | Self::OutOfRange)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_modulation_is_four_sigma_and_a_third_and_never_below_four_counts() {
        let of = |noise, bits| LeastModulation::of_noise(noise, bits).eight_bit();
        assert!((of(1.2, 8) - 5.2).abs() < 0.02);
        // Uniform noise of ±2.5 %.
        assert!((of(0.025 * 255.0 / libm::sqrt(3.0), 8) - 16.0).abs() < 0.01);
        assert_eq!((of(0.3, 8), of(0.9, 8)), (4.0, 4.0));
        assert_eq!(of(50.0, 8), 127.5);
        // The same share of full scale at any depth.
        assert!((of(1.2 * 257.0, 16) - of(1.2, 8)).abs() < 1e-9);
        assert_eq!(of(f64::NAN, 8), 16.0);
        assert_eq!(LeastModulation::default().counts(65_535), 16.0 * 257.0);
        assert_eq!(LeastModulation::new(3.9), None);
        assert_eq!(LeastModulation::new(f64::NAN), None);
    }
}
