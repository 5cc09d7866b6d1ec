//! A camera's noise by the light of a pixel: how it is measured, and how it is used.
//!
//! Two pictures of the same scene differ by noise alone: half the mean square of their difference
//! is the variance of a sample. As a function of the signal it is read² + gain · signal (photon
//! transfer: Janesick 1987), read noise and shot noise.

use alloc::vec::Vec;
use libm::sqrt;

/// σ of a sample by the light of its pixel, read noise and shot noise: σ² = read² + shot · I
/// (photon transfer: Janesick 1987).
///
/// The light is given by the mean signal I, or by the modulation B: both grow with the light that
/// the part returns ([`signal_by_modulation`](crate::pipeline::signal_by_modulation)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleNoise {
    /// Variance without light, counts².
    read: f64,
    /// Variance per count of light, counts.
    shot: f64,
}

impl SampleNoise {
    /// σ = `counts`, whatever the light.
    pub fn constant(counts: f64) -> Self {
        let read = counts * counts;
        Self { read, shot: 0.0 }
    }

    /// σ without light in counts, and the variance in counts² that a count of light adds.
    pub fn new(read_counts: f64, shot: f64) -> Self {
        let read = read_counts * read_counts;
        Self { read, shot }
    }

    /// σ without light, counts.
    pub fn read_counts(self) -> f64 {
        sqrt(self.read)
    }

    /// Variance in counts² that a count of light adds.
    pub fn shot(self) -> f64 {
        self.shot
    }

    /// σ in counts with so many counts of light.
    pub fn at(self, light: f64) -> f64 {
        sqrt(self.read + self.shot * light)
    }

    /// The noise as a function of another measure of the light: 0 counts of that measure are
    /// `offset` counts of the present one, and each further count is `slope` counts.
    #[must_use]
    pub fn by(self, [offset, slope]: [f64; 2]) -> Self {
        Self {
            read: self.read + self.shot * offset,
            shot: self.shot * slope,
        }
    }
}

/// Bins of signal levels between black and full scale.
const BINS: usize = 16;
/// Least number of pixels of a bin that is used: σ is then known to 3 %.
const LEAST_PIXELS: u64 = 500;
/// Bins at least this many σ from black and full scale are not clipped.
const CLEAR: f64 = 4.0;
/// Variance of rounding to counts: the least variance, also where both pictures are equal.
const ROUNDING: f64 = 1.0 / 12.0;
/// Shot noise below this many of its own σ is taken as 0.
const SIGNIFICANT: f64 = 3.0;

/// Noise at one signal level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisePoint {
    /// Mean sample, counts.
    pub level: f64,
    /// σ of one sample, counts.
    pub counts: f64,
    /// Number of pixels at this level.
    pub pixels: u64,
}

/// A camera's noise.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraNoise {
    /// σ of one sample at the requested level, counts.
    pub counts: f64,
    /// σ in the dark, counts.
    pub read_counts: f64,
    /// Shot noise: variance per signal, counts² per count.
    pub shot: f64,
    /// The levels that were fitted.
    pub points: Vec<NoisePoint>,
}

/// Sums over the pixels of each level, from pairs of pictures of the same scene.
#[derive(Clone, Debug)]
pub struct PhotonTransfer {
    full_scale: f64,
    /// Sums of the mean of a pair and of half the square of its difference, and the number of
    /// pairs.
    bins: [(f64, f64, u64); BINS],
}

impl PhotonTransfer {
    /// Empty sums for samples of 0 to `full_scale` counts.
    pub fn new(full_scale: f64) -> Self {
        Self {
            full_scale,
            bins: [(0.0, 0.0, 0); BINS],
        }
    }

    /// Adds two pictures of the same scene in counts. `levels` are the expected levels of their
    /// pixels, from other pictures, because bins chosen by the pictures' own noise would bias the
    /// variance.
    pub fn add(&mut self, first: &[f32], second: &[f32], levels: impl Iterator<Item = f64>) {
        let per_count = BINS as f64 / (self.full_scale + 1.0);
        for ((a, b), level) in first.iter().zip(second).zip(levels) {
            let (a, b) = (f64::from(*a), f64::from(*b));
            // A whole number below BINS; the cast saturates at 0.
            let bin = &mut self.bins[((level * per_count) as usize).min(BINS - 1)];
            let level = (a + b) / 2.0;
            *bin = (bin.0 + level, bin.1 + (a - b) * (a - b) / 2.0, bin.2 + 1);
        }
    }

    /// The noise, with σ at `level`; `None` if too few pixels are clear of black and full scale.
    pub fn noise(&self, level: f64) -> Option<CameraNoise> {
        let point = |(levels, squares, pixels): &(f64, f64, u64)| NoisePoint {
            level: levels / *pixels as f64,
            counts: sqrt((squares / *pixels as f64).max(ROUNDING)),
            pixels: *pixels,
        };
        let enough = self.bins.iter().filter(|bin| bin.2 >= LEAST_PIXELS);
        let points: Vec<NoisePoint> = enough.map(point).collect();
        let half_bin = (self.full_scale + 1.0) / BINS as f64 / 2.0;
        let clear = |point: &&NoisePoint| {
            let margin = CLEAR * point.counts + half_bin;
            (margin..=self.full_scale - margin).contains(&point.level)
        };
        let points: Vec<NoisePoint> = points.iter().filter(clear).copied().collect();
        let (read, shot) = fit(&points)?;
        let sigma = |level: f64| sqrt((read + shot * level).max(ROUNDING));
        Some(CameraNoise {
            counts: sigma(level),
            read_counts: sigma(0.0),
            shot,
            points,
        })
    }
}

/// Read noise (variance) and shot noise (per count), by least squares with weights 1/(2σ⁴/n), the
/// variance of a variance from n pairs. Where the read noise's variance would be negative it is 0; without
/// significant shot noise: the mean variance and 0.
fn fit(points: &[NoisePoint]) -> Option<(f64, f64)> {
    let (mut w, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for point in points {
        let variance = point.counts * point.counts;
        let weight = point.pixels as f64 / (2.0 * variance * variance);
        w += weight;
        x += weight * point.level;
        y += weight * variance;
        xx += weight * point.level * point.level;
        xy += weight * point.level * variance;
    }
    if !(w > 0.0) {
        return None;
    }
    let (spread, mean) = (xx - x * x / w, y / w);
    let shot = (xy - x * y / w) / spread;
    let read = mean - shot * x / w;
    let significant = shot * sqrt(spread) > SIGNIFICANT;
    Some(match (significant, read > 0.0) {
        (true, true) => (read, shot),
        (true, false) => (0.0, xy / xx),
        (false, _) => (mean, 0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    #[test]
    fn the_variance_grows_with_the_light() {
        let noise = SampleNoise::new(0.5, 0.04);
        assert_eq!(noise.at(0.0), 0.5);
        assert!((noise.at(100.0) - sqrt(4.25)).abs() < 1e-12);
        assert_eq!(noise.by([0.0, 0.5]).at(200.0), noise.at(100.0));
        assert_eq!(noise.by([20.0, 2.0]).at(40.0), noise.at(100.0));
        assert_eq!(SampleNoise::constant(2.0).at(77.0), 2.0);
    }

    /// A uniform number of mean 0 and variance 1.
    fn uniform(random: &mut SplitMix64) -> f64 {
        ((random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12_f64.sqrt()
    }

    #[test]
    fn read_and_shot_noise_are_told_apart() {
        let mut random = SplitMix64::seed_from_u64(5);
        for (read, shot) in [(2.0_f64, 0.05), (3.0, 0.0), (1.0, 0.2)] {
            let mut sums = PhotonTransfer::new(1023.0);
            for level in (40..980).step_by(20) {
                let sigma = (read * read + shot * f64::from(level)).sqrt();
                let mut picture = || -> Vec<f32> {
                    (0..4000)
                        .map(|_| (f64::from(level) + sigma * uniform(&mut random)).round() as f32)
                        .collect()
                };
                let (first, second) = (picture(), picture());
                sums.add(&first, &second, core::iter::repeat(f64::from(level)));
            }
            let noise = sums.noise(400.0).unwrap();
            let true_at = |level: f64| (read * read + shot * level + ROUNDING).sqrt();
            // 188,000 pixels over 12 levels: 1 % and less of σ.
            assert!(
                (noise.counts / true_at(400.0) - 1.0).abs() < 0.01,
                "{noise:?}"
            );
            assert!(
                (noise.read_counts / true_at(0.0) - 1.0).abs() < 0.1,
                "{noise:?}"
            );
            assert!((noise.shot - shot).abs() < 0.05 * shot + 1e-9, "{noise:?}");
        }
    }

    #[test]
    fn a_camera_without_noise_still_rounds() {
        let mut sums = PhotonTransfer::new(255.0);
        sums.add(&[100.0; 4000], &[100.0; 4000], core::iter::repeat(100.0));
        let noise = sums.noise(100.0).unwrap();
        assert!((noise.counts - ROUNDING.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_camera_that_sees_black_or_white_only_tells_no_noise() {
        let mut sums = PhotonTransfer::new(255.0);
        sums.add(&[0.0; 4000], &[0.0; 4000], core::iter::repeat(0.0));
        sums.add(&[255.0; 4000], &[255.0; 4000], core::iter::repeat(255.0));
        assert_eq!(sums.noise(100.0), None);
    }
}
