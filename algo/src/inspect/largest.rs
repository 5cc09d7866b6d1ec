//! What the largest deviation of a good part is expected to be, and how uncertain the largest
//! deviation of any part is.
//!
//! # Idea
//! The largest of many noisy means is not 0 on a good part, and scatters much less than one mean:
//! over 10³ independent squares of error σ it reads 3.5 σ with a scatter of 0.3 σ. On a part with a
//! defect that is far larger than that, the largest deviation is the mean over one square and has
//! the error of that mean. In between, it is the greater of two numbers: M, the largest deviation
//! by noise alone, and X, that of the place that does deviate. Where several places deviate by
//! nearly as much, as edges of a displaced part do, X is the greatest of their deviations, which
//! scatters less than each.
//!
//! # Equations
//! M has the mean e and the scatter s of [`LargestDeviation`]. X is normal with a mean m and a
//! scatter σ. Moments of their maximum (C. E. Clark, *The greatest of a finite set of random
//! variables*, Oper. Res. 9, 1961, eqs. 2 and 3), a² = σ² + s², α = (m − e)/a:
//!
//! ```text
//! E = m Φ(α) + e Φ(−α) + a φ(α)
//! E₂ = (m² + σ²) Φ(α) + (e² + s²) Φ(−α) + (m + e) a φ(α)
//! ```
//!
//! m is the one for which E is the measured value less 2 s: what noise alone reaches says nothing
//! about a defect. σ is the scatter of the greatest of the squares that were found, from the same
//! equations, one square after the other, with their measured values as means.
//!
//! # Shapes and units
//! Lengths in mm.
//!
//! # Accuracy
//! Within 35 % where noise and defect are equally large, within 10 % from twice the noise on
//! (`the_greater_of_noise_and_a_defect_scatters_as_predicted`); on parts in front of the simulated
//! head in `tests/suite/repeatability.rs`.

use super::good::{DeviationNoise, LargestDeviation};
use super::region::Region;
use super::taught::Taught;
use super::weight::Weight;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2};

/// Mean and standard deviation of the largest |deviation| of good parts, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Largest {
    /// The mean over parts and goldens.
    pub mean: f64,
    /// The standard deviation over parts and goldens.
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

/// Deviations up to so many scatters above the mean are taken as noise.
const NOISE: f64 = 2.0;
/// Halvings of the interval in which m lies: 1e-9 of it is left.
const HALVINGS: usize = 30;
/// Errors from the mean at which one of the two decides alone.
const FAR: f64 = 8.0;

impl Largest {
    /// The largest deviation of the squares about the pixels of a region, where deviations have the
    /// noise of the `taught` heights alone. Squares have `side` pixels, or the larger side that a
    /// place was taught to need. `width` is that of the frame.
    pub fn of(taught: &Taught, width: usize, region: &Region, side: usize) -> Self {
        let pixels = taught.pixels().len();
        let variance = |place| {
            let sigma = taught.sigma_mm(place) * taught.factor(place);
            (sigma * sigma) as f32
        };
        let weights: Vec<Weight> = (0..pixels)
            .map(|place| Weight::from(taught.compared(place)))
            .collect();
        let pixel: Vec<f32> = (0..pixels).map(variance).collect();
        let noise = DeviationNoise {
            width,
            pixel: &pixel,
            motion: &vec![0.0; pixels],
        };
        let mut largest = LargestDeviation::default();
        for own in taught.sides(side) {
            let [squares] = noise.of_squares(&weights, [own]);
            let mut inside = vec![f32::NAN; pixels];
            let places = region.places(width);
            for place in places.filter(|&place| taught.side(place, side) == own) {
                inside[place] = squares[place];
            }
            largest.add(LargestDeviation::new(&inside, width, own));
        }
        let (mean, scatter) = largest.mean_and_scatter();
        Self { mean, scatter }
    }

    /// The largest deviation with `factor` times the noise.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            mean: self.mean * factor,
            scatter: self.scatter * factor,
        }
    }

    /// The share of parts that stay below a limit in mm, if they are normally distributed.
    pub fn below(self, limit: f64) -> f64 {
        let scatter = self.scatter.max(f64::MIN_POSITIVE);
        0.5 * libm::erfc((self.mean - limit) / scatter / SQRT_2)
    }

    /// The error of the largest of deviations that were found in squares that share no pixel: their
    /// magnitudes and variances.
    pub(super) fn uncertain(
        self,
        largest: [f64; 2],
        others: impl IntoIterator<Item = [f64; 2]>,
    ) -> Uncertain {
        let noise = [self.mean, self.scatter * self.scatter];
        let beyond = largest[0] - NOISE * self.scatter;
        if !(beyond > self.mean && largest[1] > 0.0) {
            return Uncertain {
                variance: noise[1],
                defect: 0.0,
            };
        }
        let greatest = |greatest, next| greater(greatest, next).0;
        let [_, variance] = others.into_iter().fold(largest, greatest);
        let spread = libm::sqrt(variance + self.scatter * self.scatter);
        let (mut low, mut high) = (self.mean - FAR * spread, beyond);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            match greater([middle, variance], noise).0[0] > beyond {
                true => high = middle,
                false => low = middle,
            }
        }
        let ([_, variance], defect) = greater([high, variance], noise);
        Uncertain { variance, defect }
    }
}

/// Mean and variance of the greater of two normal numbers with these means and variances, and how
/// often the first number is the greater. At least one variance is not 0.
fn greater([m, u]: [f64; 2], [e, v]: [f64; 2]) -> ([f64; 2], f64) {
    let spread = libm::sqrt(u + v);
    let alpha = (m - e) / spread;
    let chance = 0.5 * libm::erfc(-alpha / SQRT_2);
    let both = spread * libm::exp(-alpha * alpha / 2.0) / libm::sqrt(2.0 * PI);
    // Moments about e, so that little is lost in the difference.
    let first = (m - e) * chance + both;
    let second = ((m - e) * (m - e) + u) * chance + v * (1.0 - chance) + (m - e) * both;
    ([e + first, (second - first * first).max(0.0)], chance)
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

    /// The largest of all squares, one of which is off by `defect`: mean and standard deviation
    /// over many draws.
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
            let found = noise.uncertain([value, 1.0], []);
            assert_eq!((found.variance, found.defect), (scatter * scatter, 0.0));
        }
        // A defect that noise does not reach has the error of its square, and one in between is in
        // between.
        for (defect, within) in [(4.5, 0.35), (6.0, 0.1), (9.0, 0.05)] {
            let (value, spread) = drawn(defect, &mut random);
            let found = noise.uncertain([value, 1.0], []);
            let ratio = spread / libm::sqrt(found.variance);
            assert!((ratio - 1.0).abs() < within, "{defect}: {ratio}");
        }
        assert!(noise.uncertain([9.0, 1.0], []).defect > 0.99);
        assert_eq!(Largest::default().uncertain([0.0, 0.0], []).variance, 0.0);
        let twice = noise.times(2.0).uncertain([18.0, 4.0], []);
        let once = noise.uncertain([9.0, 1.0], []);
        assert!((twice.variance / once.variance - 4.0).abs() < 1e-9);
    }

    #[test]
    fn places_that_deviate_alike_scatter_less_than_each_of_them() {
        let mut random = SplitMix64::seed_from_u64(4);
        let noise = Largest {
            mean: 3.5,
            scatter: 0.3,
        };
        // Means and errors of places: alike, a noisy one among quiet ones, and one that is far
        // above the others.
        for (places, alone) in [
            (&[[12.0, 1.0]; 4][..], false),
            (&[[12.0, 2.0], [12.0, 0.5], [11.5, 0.5]], false),
            (&[[18.0, 1.0], [12.0, 1.0], [12.0, 1.0]], true),
        ] {
            let mut draw = || {
                let draws = places
                    .iter()
                    .map(|[m, sigma]| [m + sigma * normal(&mut random), sigma * sigma]);
                let mut found: Vec<_> = draws.collect();
                found.sort_by(|a, b| b[0].total_cmp(&a[0]));
                let uncertain = noise.uncertain(found[0], found[1..].iter().copied());
                (found[0][0], uncertain.variance, found[0][1])
            };
            let draws: Vec<_> = (0..DRAWS).map(|_| draw()).collect();
            let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
                draws.iter().map(of).sum::<f64>() / DRAWS as f64
            };
            let average = mean(&|draw| draw.0);
            let scatter = libm::sqrt(mean(&|draw| (draw.0 - average) * (draw.0 - average)));
            let ratio = scatter / libm::sqrt(mean(&|draw| draw.1));
            let without = scatter / libm::sqrt(mean(&|draw| draw.2));
            std::println!("{scatter:.3}: {ratio:.3}, without the others {without:.3}");
            assert!((0.85..1.15).contains(&ratio), "{places:?}: {ratio}");
            assert_eq!((0.85..1.15).contains(&without), alone, "{without}");
        }
    }
}
