//! The largest deviation of good parts, which noise alone makes: which pixels can hold a limit, and
//! how often a good part exceeds it.
//!
//! # Idea
//! A good part deviates from golden by noise only: golden's own, the measurement's, and that of the
//! motion that is taken back. [`Measure::Deviation`](super::Measure) is the largest of the means
//! over all squares, so a limit has to be held by the tail of an extreme, not by the noise of one
//! square: among 10⁵ squares some are always 4 σ off. Where a surface is seen at a grazing angle or
//! by little light, single squares are many times as noisy as the rest and make the extreme alone:
//! their pixels get weights.
//!
//! # Equations
//! The mean over a square with n compared pixels of weights w has
//!
//! ```text
//! σ² = (Σ w² σ_p² + (Σ w)² σ_m²) / n²
//! ```
//!
//! σ_p is σ of a pixel's deviation by noise (√(golden² + measurement²)), σ_m that by the error of
//! the motion, which moves all pixels of a square together. Where the square about a pixel has a
//! higher σ than the limit allows, the pixel's weight is about the ratio of the two, else 1: with
//! weights, no square is noisier than the limit allows.
//!
//! There is a square about each pixel, so neighbours share pixels; along each axis the means
//! correlate by 1 − k/L at k pixels, L the side. Excursions of such a field above t σ come in
//! clumps, and the clumps are a Poisson process (D. Siegmund, *Approximate tail probabilities for
//! the maxima of some random fields*, Ann. Probab. 16, 1988; ν by D. Siegmund, B. Yakir, *The
//! Statistics of Gene Mapping*, 2007, 5.2):
//!
//! ```text
//! P(largest > x) = 1 − e^−Λ(x)        Λ(x) = Σ 2 φ(x/σ) σ/x θ(x/σ)²
//! θ(t) = μ²/2 · ν(μ)                  μ = t √(2/L)
//! ν(μ) = (2/μ) (Φ(μ/2) − ½) / ((μ/2) Φ(μ/2) + φ(μ/2))
//! ```
//!
//! The sum runs over the squares; Φ and φ are the normal distribution and its density (2 φ(t)/t
//! approximates its two tails). θ is the number of clumps per square along an axis, 1 where
//! excursions are so short that every square has its own. For low excursions (t of about 1) there
//! are at least as many clumps as in disjoint squares, −ln(1 − 2 Q(t)) / L² each, Q the upper tail.
//! Along an axis a run of n squares has n θ + 1 − θ clumps: the noisier end of the run counts in
//! full, which is where extremes are when the noise grows towards an edge.
//!
//! # Shapes and units
//! Maps are row-major over the camera's frame; lengths mm, variances mm².
//!
//! # Accuracy
//! Mean and scatter of the largest of simulated squares within 5 % and 20 %, its upper tail within
//! a half (`the_largest_of_simulated_squares_is_as_predicted`); on parts in front of the simulated
//! head in `tests/suite/limits.rs`.

use super::align::{Alignment, Facet, GoldenSurface};
use super::gauge::MIN_SUPPORT;
use super::table::IntegralTable;
use super::weight::Weight;
use crate::geometry::Vector;
use crate::math::{around, normal_density};
use crate::pipeline::for_each_row;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::SQRT_2;

/// The variances of each pixel's deviation on a good part, mm².
#[derive(Clone, Copy, Debug)]
pub struct DeviationNoise<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Variance by the noise of golden's and the measured height.
    pub pixel: &'a [f32],
    /// Variance by the error of the part's motion.
    pub motion: &'a [f32],
}

impl DeviationNoise<'_> {
    /// The weights with which no mean over a square of `side` has a σ above `most`. First the
    /// middle of each square whose σ is higher gets the ratio of the two as its weight. While that
    /// is not enough, because pixels beside it are noisier, the weights of all pixels of the square
    /// are multiplied by the ratio that is left. Pixels whose weight would be below 1/16 are not
    /// compared.
    pub fn weights(&self, compared: &[bool], side: usize, most: f64) -> Vec<Weight> {
        let width = self.width.max(1);
        let rows = compared.len() / width;
        let mut weights: Vec<Weight> = compared.iter().copied().map(Weight::from).collect();
        let mut reach = 0;
        loop {
            let [sigmas] = self.of_squares(&weights, [side]);
            let mut shares = vec![1.0_f64; weights.len()];
            let ratios = sigmas.iter().map(|sigma| most / f64::from(*sigma));
            for (place, ratio) in ratios.enumerate().filter(|(_, ratio)| *ratio < 1.0) {
                let (row, column) = (place / width, place % width);
                let columns = around(column, reach, width);
                for row in around(row, reach, rows) {
                    let shares = &mut shares[row * width..][columns.clone()];
                    shares
                        .iter_mut()
                        .for_each(|share| *share = share.min(ratio));
                }
            }
            let mut quiet = true;
            for (weight, share) in weights.iter_mut().zip(shares) {
                if share < 1.0 {
                    // Rounded down, so that there is an end.
                    *weight = Weight::of_share(weight.share() * share);
                    quiet = false;
                }
            }
            if quiet {
                return weights;
            }
            reach = side / 2;
        }
    }

    /// σ of the means over the squares of each of these sides in pixels about each pixel; NaN where
    /// the pixel is not compared or too few pixels of the square are.
    pub fn of_squares<const N: usize>(
        &self,
        weights: &[Weight],
        sides: [usize; N],
    ) -> [Vec<f32>; N] {
        let width = self.width.max(1);
        // The number of compared pixels, Σ w and Σ w² σ_p².
        let sums = IntegralTable::new(width, weights.len(), |place| {
            let weight = weights[place].share();
            let variance = weight * weight * f64::from(self.pixel[place]);
            weights[place].compared().then_some([1.0, weight, variance])
        });
        sides.map(|side| {
            let least = MIN_SUPPORT * (side * side) as f64;
            let mut sigma = vec![f32::NAN; weights.len()];
            for_each_row(&mut sigma, width, |row, sigma| {
                for (column, sigma) in sigma.iter_mut().enumerate() {
                    let place = row * width + column;
                    let [pixels, weight, own] = sums.square(row, column, side);
                    if weights[place].compared() && pixels >= least {
                        let motion = weight * weight * f64::from(self.motion[place]);
                        *sigma = (libm::sqrt(own.max(0.0) + motion) / pixels) as f32;
                    }
                }
            });
            sigma
        })
    }
}

/// Variance of each pixel's deviation by the error of the motion that is found from heights with
/// the noise of `golden`; 0 where no motion is found. The motion is found inside `window` from the
/// pixels that count in full in `golden`; the variance is that of the pixels that are compared in
/// `whole`.
///
/// An error δ of the motion lifts a pixel by j·δ ([`Facet::jacobian`]), so the variance is jᵀ C j,
/// C the covariance of the motion of a part that lies as taught.
pub fn motion_variance(
    golden: GoldenSurface<'_>,
    whole: GoldenSurface<'_>,
    window: crate::pipeline::Window<'_>,
) -> Vec<f32> {
    let alignment = Alignment::new(golden, window);
    let placed = alignment.as_ref().and_then(|plan| plan.still(golden));
    let (Some(alignment), Some(placed)) = (&alignment, placed) else {
        return vec![0.0; golden.surface.height.len()];
    };
    let fitting = alignment.fitting(golden);
    of_facets(whole, |facet, point| {
        fitting.lift_variance(&placed, facet, point)
    })
}

/// Whether heights leave open how far a part is moved along some direction: a flat plate may lie anywhere in its
/// plane. Also if it has too few points for any motion.
pub fn leaves_open(golden: GoldenSurface<'_>, window: crate::pipeline::Window<'_>) -> bool {
    let alignment = Alignment::new(golden, window);
    alignment.is_none_or(|alignment| alignment.left_out.contains(&true))
}

/// The area of the surface that each compared pixel sees, mm².
pub fn areas(golden: GoldenSurface<'_>) -> Vec<f32> {
    of_facets(golden, |facet, _| {
        facet.area * facet.lift.length() / libm::fabs(facet.lift.z)
    })
}

/// A value of the facet and point of each compared pixel; 0 in rows without any facet.
fn of_facets(golden: GoldenSurface<'_>, value: impl Fn(&Facet, Vector) -> f64 + Sync) -> Vec<f32> {
    let width = golden.surface.width;
    let mut values = vec![0.0; golden.surface.height.len()];
    for_each_row(&mut values, width, |v, row| {
        let of_pixel = |u: usize| {
            let height = golden.surface.height[v * width + u];
            if !golden.taught.compared(v * width + u) {
                return None;
            }
            let point = golden.triangulator.point(u, v, height)?;
            let seen = golden.triangulator.camera().project(point)?;
            let facet = golden.facet(point, seen)?;
            Some(value(&facet, point) as f32)
        };
        for (u, value) in row.iter_mut().enumerate() {
            *value = of_pixel(u).unwrap_or(f32::NAN);
        }
        // A facet needs a whole square of pixels: pixels beside an edge get the value of the next
        // one in the row.
        carry(row.iter_mut());
        carry(row.iter_mut().rev());
        for value in row.iter_mut().filter(|value| value.is_nan()) {
            *value = 0.0;
        }
    });
    values
}

/// Replaces each NaN by the value before it.
fn carry<'a>(values: impl Iterator<Item = &'a mut f32>) {
    let mut before = f32::NAN;
    for value in values {
        if value.is_nan() {
            *value = before;
        }
        before = *value;
    }
}

/// The distribution of the largest |deviation| of good parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LargestDeviation {
    /// The squares of each side.
    fields: Vec<DeviationField>,
}

/// The squares of one side.
#[derive(Clone, Debug, PartialEq)]
struct DeviationField {
    side: f64,
    /// How many squares have a σ in each bin ([`sigma_of`]), by the number of axes along which they
    /// are the end of a run.
    bins: [Vec<u32>; 3],
}

/// Bins per factor of two of σ, and the middle of the first, mm.
const BINS_PER_OCTAVE: f64 = 32.0;
const LEAST_SIGMA_MM: f64 = 1e-6;
/// 30 octaves: up to a metre.
const BINS: usize = 960;
/// Intervals of the numerical integrals.
const INTERVALS: usize = 600;
/// No deviation is expected beyond this many of the largest σ: the integrals end there.
const REACH: f64 = 12.0;

/// σ in the middle of a bin, mm.
fn sigma_of(bin: usize) -> f64 {
    LEAST_SIGMA_MM * libm::exp2(bin as f64 / BINS_PER_OCTAVE)
}

impl LargestDeviation {
    /// The distribution over squares of `side` pixels with these σ, mm, in a frame of `width`
    /// columns; places with NaN have no square.
    pub fn new(sigmas: &[f32], width: usize, side: usize) -> Self {
        let mut bins = [(); 3].map(|()| vec![0; BINS]);
        let width = width.max(1);
        let squares = sigmas.iter().enumerate();
        for (place, &sigma) in squares.filter(|(_, sigma)| **sigma > 0.0) {
            let octaves = libm::log2(f64::from(sigma) / LEAST_SIGMA_MM);
            let bin = libm::rint(octaves * BINS_PER_OCTAVE).clamp(0.0, (BINS - 1) as f64);
            let (row, column) = (place / width, place % width);
            let known = |inside: bool, at: usize| {
                let sigma = inside.then(|| sigmas.get(at).copied()).flatten();
                sigma.filter(|sigma| *sigma > 0.0)
            };
            let left = known(column > 0, place.wrapping_sub(1));
            let right = known(column + 1 < width, place + 1);
            let above = known(row > 0, place.wrapping_sub(width));
            let below = known(true, place + width);
            // A run has one noisier end.
            let is_end = |(a, b): (Option<f32>, Option<f32>)| match (a, b) {
                (Some(_), Some(_)) => false,
                (Some(beside), None) | (None, Some(beside)) => sigma >= beside,
                (None, None) => true,
            };
            let ends = [(left, right), (above, below)].map(is_end);
            bins[ends.into_iter().filter(|end| *end).count()][bin as usize] += 1;
        }
        let side = side.max(1) as f64;
        let fields = vec![DeviationField { side, bins }];
        Self { fields }
    }

    /// Adds the squares of another side.
    pub fn add(&mut self, other: Self) {
        self.fields.extend(other.fields);
    }

    /// Λ(x): the mean number of clumps of squares that deviate by more than `limit` mm, above 0.
    fn clumps(&self, limit: f64) -> f64 {
        let mut clumps = 0.0;
        for DeviationField { side, bins } in &self.fields {
            for (ends, bins) in bins.iter().enumerate() {
                let bins = bins.iter().enumerate();
                for (bin, &count) in bins.filter(|(_, count)| **count > 0) {
                    let t = limit / sigma_of(bin);
                    clumps += f64::from(count) * clumps_per_square(t, *side, 2 - ends as i32);
                }
            }
        }
        clumps
    }

    /// The share of good parts whose largest deviation is more than `limit` mm.
    pub fn beyond(&self, limit: f64) -> f64 {
        -libm::expm1(-self.clumps(limit))
    }

    /// The limit that at most this share of good parts exceeds, mm; 0 if there is no square.
    pub fn limit(&self, beyond: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.top());
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            match self.beyond(middle) > beyond {
                true => low = middle,
                false => high = middle,
            }
        }
        high
    }

    /// Mean and standard deviation of the largest |deviation| over good parts and goldens, mm.
    pub fn mean_and_scatter(&self) -> (f64, f64) {
        let step = self.top() / INTERVALS as f64;
        let (mut first, mut second) = (0.0, 0.0);
        for i in 0..INTERVALS {
            let x = (i as f64 + 0.5) * step;
            let tail = self.beyond(x);
            first += tail * step;
            second += 2.0 * x * tail * step;
        }
        (first, libm::sqrt((second - first * first).max(0.0)))
    }

    /// The largest deviation that is expected, mm.
    fn top(&self) -> f64 {
        let largest = |bins: &Vec<u32>| bins.iter().rposition(|count| *count > 0);
        let bins = self.fields.iter().flat_map(|field| &field.bins);
        let largest = bins.filter_map(largest).max();
        largest.map_or(0.0, |bin| REACH * sigma_of(bin))
    }
}

/// Clumps above t > 0 of a square of `side` pixels that lies inside its run along so many `axes`: 2
/// φ(t)/t times θ(t) for each of these axes, and at least as many as if one square in side² were
/// independent.
fn clumps_per_square(t: f64, side: f64, axes: i32) -> f64 {
    let half = t * libm::sqrt(2.0 / side) / 2.0;
    let below = 0.5 * libm::erfc(-half / SQRT_2);
    let nu = (below - 0.5) / half / (half * below + normal_density(half));
    let theta = (2.0 * half * half * nu).min(1.0);
    let independent = -libm::log(libm::erf(t / SQRT_2)) / (side * side);
    let theta = (0..axes).fold(1.0, |product, _| product * theta);
    (2.0 * normal_density(t) / t * theta).max(independent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    const SIDE: usize = 9;

    /// Normal numbers from a fixed seed.
    struct Normal(SplitMix64);

    impl Normal {
        fn uniform(&mut self) -> f64 {
            (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn next(&mut self) -> f64 {
            // Box and Muller, 1958.
            let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
            radius * libm::cos(2.0 * PI * self.uniform())
        }
    }

    /// The largest |mean| of squares of one draw of noise.
    fn largest(width: usize, sigma: &[f64], random: &mut Normal) -> f64 {
        let rows = sigma.len() / width;
        let mut table = vec![0.0; (width + 1) * (rows + 1)];
        for row in 0..rows {
            let mut sum = 0.0;
            for column in 0..width {
                sum += sigma[row * width + column] * random.next();
                let here = (row + 1) * (width + 1) + column + 1;
                table[here] = table[here - width - 1] + sum;
            }
        }
        let mut most = 0.0_f64;
        for row in SIDE..=rows {
            for column in SIDE..=width {
                let at = |row: usize, column: usize| table[row * (width + 1) + column];
                let sum = at(row, column) + at(row - SIDE, column - SIDE)
                    - at(row, column - SIDE)
                    - at(row - SIDE, column);
                most = most.max(sum.abs());
            }
        }
        most / (SIDE * SIDE) as f64
    }

    #[test]
    fn the_largest_of_simulated_squares_is_as_predicted() {
        const WIDTH: usize = 96;
        const DRAWS: usize = 1500;
        let even = vec![0.05; WIDTH * WIDTH];
        // A quarter of the frame gets three times as noisy towards its edge.
        let steep = |place: usize| match place % WIDTH {
            column @ 72.. => 0.05 * (1.0 + 2.0 * (column - 72) as f64 / 24.0),
            _ => 0.05,
        };
        let uneven: Vec<f64> = (0..WIDTH * WIDTH).map(steep).collect();
        for sigma in [even, uneven] {
            let pixel: Vec<f32> = sigma.iter().map(|s| (s * s) as f32).collect();
            let noise = DeviationNoise {
                width: WIDTH,
                pixel: &pixel,
                motion: &vec![0.0; WIDTH * WIDTH],
            };
            let [mut sigmas] = noise.of_squares(&[Weight::FULL; WIDTH * WIDTH], [SIDE]);
            // Whole squares, as drawn.
            let half = SIDE / 2;
            let whole = half..WIDTH - half;
            for (place, sigma) in sigmas.iter_mut().enumerate() {
                if !(whole.contains(&(place % WIDTH)) && whole.contains(&(place / WIDTH))) {
                    *sigma = f32::NAN;
                }
            }
            let predicted = LargestDeviation::new(&sigmas, WIDTH, SIDE);
            let mut random = Normal(SplitMix64::seed_from_u64(5));
            let drawn: Vec<f64> = (0..DRAWS)
                .map(|_| largest(WIDTH, &sigma, &mut random))
                .collect();
            let mean = drawn.iter().sum::<f64>() / DRAWS as f64;
            let variance = drawn.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
            let scatter = libm::sqrt(variance / (DRAWS - 1) as f64);
            let (expected, spread) = predicted.mean_and_scatter();
            assert!((expected / mean - 1.0).abs() < 0.05, "{expected} {mean}");
            assert!((spread / scatter - 1.0).abs() < 0.20, "{spread} {scatter}");
            // A limit that one of fifty exceeds: 30 of the draws, which scatter by 5.5.
            let limit = predicted.limit(0.02);
            assert!((predicted.beyond(limit) - 0.02).abs() < 1e-9);
            let beyond = drawn.iter().filter(|x| **x > limit).count();
            assert!((17..=49).contains(&beyond), "{beyond}");
        }
    }

    #[test]
    fn what_is_too_noisy_counts_with_a_weight_that_makes_it_quiet_enough() {
        const WIDTH: usize = 40;
        const MOST: f64 = 0.02;
        // Columns that get nine times as noisy towards the edge, and one that no weight makes
        // quiet.
        let pixel: Vec<f32> = (0..WIDTH * WIDTH)
            .map(|place| match place % WIDTH {
                0 => 900.0,
                column @ 1..8 => 0.01 * (9 - column) as f32 * (9 - column) as f32,
                _ => 0.01,
            })
            .collect();
        let motion = vec![1e-5; WIDTH * WIDTH];
        let noise = DeviationNoise {
            width: WIDTH,
            pixel: &pixel,
            motion: &motion,
        };
        let compared = |place: usize| !place.is_multiple_of(WIDTH) || place / WIDTH < WIDTH / 2;
        let compared: Vec<bool> = (0..WIDTH * WIDTH).map(compared).collect();
        let weights = noise.weights(&compared, SIDE, MOST);
        let row = |row: usize| &weights[row * WIDTH..(row + 1) * WIDTH];
        let [upper, lower] = [row(10), row(30)];
        // Beside what is far too noisy squares are as well.
        assert!(upper[..5].iter().all(|weight| !weight.compared()));
        assert!(!lower[0].compared());
        assert!(lower[1..7].iter().all(|weight| weight.partial()));
        assert!(lower[1].bits() < lower[6].bits());
        assert!(lower[20..].iter().all(|weight| *weight == Weight::FULL));
        let [sigmas] = noise.of_squares(&weights, [SIDE]);
        // A whole quiet square has √(0.01 / 81 + 1e-5) = 0.0116 mm.
        let quiet = f64::from(sigmas[20 * WIDTH + 20]);
        assert!((quiet - 0.011_55).abs() < 1e-5, "{quiet}");
        let known = sigmas.iter().filter(|sigma| !sigma.is_nan());
        let largest = known.copied().fold(0.0, f32::max);
        let expected = 0.85 * MOST..1.000_001 * MOST;
        assert!(expected.contains(&f64::from(largest)), "{largest}");
        assert!(LargestDeviation::new(&[], WIDTH, SIDE).limit(1e-6) == 0.0);
    }
}
