//! How likely a pixel is trusted in one measurement.

use super::Sequence;
use crate::trust::LeastModulation;
use alloc::vec::Vec;

impl Sequence {
    /// How likely all levels are trusted in one measurement of a pixel, by the modulation that a
    /// sine has there. It is in counts of samples with this full scale, and so is `noise`, σ of a
    /// sample. A level's modulation has σ_B = σ √(2 / N).
    pub fn chance_of_trust(
        &self,
        least: LeastModulation,
        (noise, full_scale): (f64, u16),
    ) -> impl Fn(f64) -> f64 {
        let least = least.counts(full_scale);
        let levels = self.levels().iter().map(|level| {
            let sharpness = libm::sqrt(level.shifts() as f64) / 2.0 / noise;
            (level.waveform.fundamental(), sharpness)
        });
        let levels: Vec<_> = levels.collect();
        move |modulation| {
            let trusted = |&(fundamental, sharpness): &(f64, f64)| {
                0.5 * libm::erfc((least - modulation * fundamental) * sharpness)
            };
            levels.iter().map(trusted).product()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Shot;

    #[test]
    fn a_pixel_at_the_least_modulation_is_trusted_by_half_of_the_measurements_of_each_level() {
        let least = LeastModulation::default();
        let chance = |levels: &[f64], modulation| {
            let shots: Vec<_> = levels.iter().flat_map(|&r| Shot::level(r, 8)).collect();
            let sequence = Sequence::from_frames(&shots).unwrap();
            sequence.chance_of_trust(least, (2.0, 255))(modulation)
        };
        assert!((chance(&[1.0], 16.0) - 0.5).abs() < 1e-12);
        assert!((chance(&[0.75, 0.9375, 1.0], 16.0) - 0.125).abs() < 1e-12);
        // σ_B of eight shifts is half of a sample's.
        assert!((chance(&[1.0], 17.0) - 0.8413).abs() < 1e-4);
        assert!(chance(&[1.0], 40.0) > 1.0 - 1e-12);
    }
}
