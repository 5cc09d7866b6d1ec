//! What the largest deviation of a good part is expected to be, and how uncertain the largest deviation of any part is.
//!
//! # Idea
//! The largest of many noisy means is not 0 on a good part, and scatters much less than one of them: over 10³ independent squares of
//! error σ it reads 3.5 σ with a scatter of 0.3 σ. On a part with a defect that is far larger than that, it is the mean over one
//! square and has its error. In between, the largest deviation is the greater of two: that of noise alone, M, and that of one
//! place that does deviate, X.
//!
//! # Equations
//! M has the mean e and the scatter s of [`LargestDeviation`]. X is normal with a mean m and the error σ of the square. Moments of their
//! maximum (C. E. Clark, *The greatest of a finite set of random variables*, Oper. Res. 9, 1961, eqs. 2 and 3), a² = σ² + s²,
//! α = (m − e)/a:
//!
//! ```text
//! E = m Φ(α) + e Φ(−α) + a φ(α)
//! E₂ = (m² + σ²) Φ(α) + (e² + s²) Φ(−α) + (m + e) a φ(α)
//! ```
//!
//! m is the one for which E is the measured value less 2 s: what noise alone reaches says nothing about a defect.
//!
//! # Shapes and units
//! Lengths in mm.
//!
//! # Accuracy
//! Within 35 % where noise and defect are equally large, within 10 % from twice the noise on
//! (`the_greater_of_noise_and_a_defect_scatters_as_predicted`); on parts in front of the simulated head in `tests/suite/repeatability.rs`.

use super::good::{DeviationNoise, LargestDeviation};
use super::{Region, Taught, Weight};
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2};

/// Mean and standard deviation of the largest |deviation| of good parts, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Largest {
    /// Over parts and goldens.
    pub mean: f64,
    /// See above.
    pub scatter: f64,
}

/// The error of a largest deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Uncertain {
    /// Variance over repeated measurements, mm².
    pub variance: f64,
    /// How sure it is that the deviation is that of one place, not of noise: 0 to 1.
    pub defect: f64,
}

/// So many scatters above the mean are taken as noise.
const NOISE: f64 = 2.0;
/// Halvings of the interval in which m lies: 1e-9 of it is left.
const HALVINGS: usize = 30;
/// Errors from the mean at which one of the two decides alone.
const FAR: f64 = 8.0;

impl Largest {
    /// Of the squares of `side` pixels about the pixels of a region, where deviations have the noise of the `taught` heights alone;
    /// with `times` the noise it is [`Self::times`] as large. `width` is that of the frame.
    pub fn of(taught: &Taught, width: usize, region: &Region, side: usize) -> Self {
        let pixels = taught.pixels().len();
        let variance = |place| {
            let sigma = taught.sigma_mm(place);
            (sigma * sigma) as f32
        };
        let weight = |place| match taught.compared(place) {
            true => taught.weight(place),
            false => Weight::NONE,
        };
        let weights: Vec<Weight> = (0..pixels).map(weight).collect();
        let pixel: Vec<f32> = (0..pixels).map(variance).collect();
        let noise = DeviationNoise {
            width,
            pixel: &pixel,
            motion: &vec![0.0; pixels],
        };
        let squares = noise.of_squares(&weights, side);
        let mut inside = vec![f32::NAN; pixels];
        for place in region.places(width) {
            inside[place] = squares[place];
        }
        let (mean, scatter) = LargestDeviation::new(&inside, width, side).mean_and_scatter();
        Self { mean, scatter }
    }

    /// With so many times the noise.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            mean: self.mean * factor,
            scatter: self.scatter * factor,
        }
    }

    /// The error of a largest deviation of magnitude `value` that was found in a square of error `sigma`.
    pub(super) fn uncertain(self, value: f64, sigma: f64) -> Uncertain {
        let spread = libm::sqrt(sigma * sigma + self.scatter * self.scatter);
        let beyond = value - NOISE * self.scatter;
        if !(beyond > self.mean && spread > 0.0) {
            let variance = self.scatter * self.scatter;
            return Uncertain {
                variance,
                defect: 0.0,
            };
        }
        let (mut low, mut high) = (self.mean - FAR * spread, beyond);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            match self.greater(middle, sigma, spread).0 > beyond {
                true => high = middle,
                false => low = middle,
            }
        }
        let (_, variance, defect) = self.greater(high, sigma, spread);
        Uncertain { variance, defect }
    }

    /// Mean and variance of the greater of noise and a defect of mean `m`, and how often it is the defect.
    fn greater(self, m: f64, sigma: f64, spread: f64) -> (f64, f64, f64) {
        let Self { mean: e, scatter } = self;
        let alpha = (m - e) / spread;
        let defect = 0.5 * libm::erfc(-alpha / SQRT_2);
        let both = spread * libm::exp(-alpha * alpha / 2.0) / libm::sqrt(2.0 * PI);
        // About e, so that little is lost in the difference.
        let first = (m - e) * defect + both;
        let second = ((m - e) * (m - e) + sigma * sigma) * defect
            + scatter * scatter * (1.0 - defect)
            + (m - e) * both;
        (e + first, (second - first * first).max(0.0), defect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    /// Independent squares of error 1.
    const SQUARES: usize = 1000;
    const DRAWS: usize = 4000;

    fn normal(random: &mut SplitMix64) -> f64 {
        // Box and Muller, 1958.
        let mut share = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        libm::sqrt(-2.0 * libm::log(1.0 - share())) * libm::cos(2.0 * PI * share())
    }

    /// The largest of all squares, one of which is off by `defect`: mean and standard deviation over many draws.
    fn drawn(defect: f64, random: &mut SplitMix64) -> (f64, f64) {
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..DRAWS {
            let rest = (1..SQUARES).map(|_| libm::fabs(normal(random)));
            let rest = rest.fold(0.0, f64::max);
            let largest = rest.max(libm::fabs(defect + normal(random)));
            sum += largest;
            squares += largest * largest;
        }
        let mean = sum / DRAWS as f64;
        (mean, libm::sqrt(squares / DRAWS as f64 - mean * mean))
    }

    #[test]
    fn the_greater_of_noise_and_a_defect_scatters_as_predicted() {
        let mut random = SplitMix64::seed_from_u64(3);
        let (mean, scatter) = drawn(0.0, &mut random);
        let noise = Largest { mean, scatter };
        // Noise alone, as far as it reaches, has its own scatter.
        for value in [0.9 * mean, mean, mean + 2.0 * scatter] {
            let found = noise.uncertain(value, 1.0);
            assert_eq!((found.variance, found.defect), (scatter * scatter, 0.0));
        }
        // A defect that noise does not reach has the error of its square, and one in between is in between.
        for (defect, within) in [(4.5, 0.35), (6.0, 0.1), (9.0, 0.05)] {
            let (value, spread) = drawn(defect, &mut random);
            let found = noise.uncertain(value, 1.0);
            let ratio = spread / libm::sqrt(found.variance);
            assert!((ratio - 1.0).abs() < within, "{defect}: {ratio}");
        }
        assert!(noise.uncertain(9.0, 1.0).defect > 0.99);
        assert_eq!(Largest::default().uncertain(0.0, 0.0).variance, 0.0);
        let twice = noise.times(2.0).uncertain(18.0, 2.0);
        let once = noise.uncertain(9.0, 1.0);
        assert!((twice.variance / once.variance - 4.0).abs() < 1e-9);
    }
}
