//! What noise alone makes of the largest deviation: where a limit can be held, and how often a good part exceeds it.
//!
//! # Idea
//! A good part deviates from golden by noise only: golden's own, the measurement's, and that of the motion that is taken back.
//! [`Measure::Deviation`](super::Measure) averages over squares and takes the largest of all their means, so it is judged by
//! the tail of an extreme, not by the noise of one square: among 10⁵ squares some are always 4 σ off. Where a surface is seen
//! at a grazing angle or by little light, single squares are many times as noisy as the rest and decide the extreme alone.
//!
//! # Equations
//! The mean over a square with n compared pixels has
//!
//! ```text
//! σ² = Σ σ_p² / n² + σ_m²
//! ```
//!
//! σ_p of a pixel's deviation (√(golden² + measurement²)), σ_m of what an error of the motion does to it: that moves all
//! pixels of a square together. There is a square about each pixel, so neighbours share pixels; along each axis the means
//! correlate by 1 − k/L at k pixels, L the side. Excursions of such a field above t σ come in clumps, and the clumps are
//! a Poisson process (D. Siegmund, *Approximate tail probabilities for the maxima of some random fields*, Ann. Probab. 16,
//! 1988; ν by D. Siegmund, B. Yakir, *The Statistics of Gene Mapping*, 2007, 5.2):
//!
//! ```text
//! P(largest > x) = 1 − e^−Λ(x)        Λ(x) = Σ 2 φ(x/σ) σ/x θ(x/σ)²
//! θ(t) = μ²/2 · ν(μ)                  μ = t √(2/L)
//! ν(μ) = (2/μ) (Φ(μ/2) − ½) / ((μ/2) Φ(μ/2) + φ(μ/2))
//! ```
//!
//! The sum runs over the squares, Φ and φ are the normal distribution and its density (2 φ(t)/t is its two tails), and θ is the number of clumps per square along an axis:
//! 1 where excursions are so short that every square has its own. Where excursions are not high (t of about 1) there are at least
//! as many as in squares side by side, −ln(1 − 2 Q(t)) / L² each. Along an axis the first square of a run of n has a clump of its own
//! (n θ + 1 − θ in all): its noisier end, which is where extremes are when the noise grows towards an edge.
//!
//! # Shapes and units
//! Maps are row-major over the camera's frame; lengths mm, variances mm².
//!
//! # Accuracy
//! Mean and scatter of the largest of simulated squares within 5 % and 20 %, its upper tail within a half
//! (`the_largest_of_simulated_squares_is_as_predicted`); on parts in front of the simulated head in `tests/suite/limits.rs`.

use super::align::{Alignment, GoldenSurface};
use super::deviation::MIN_SUPPORT;
use crate::pipeline::for_each_row;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2};

/// What a pixel's deviation varies by on a good part.
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
    /// σ of the mean over the square of `side` pixels about each pixel; NaN where the pixel is not compared, or too few around it
    /// are.
    pub fn of_squares(&self, compared: &[bool], side: usize) -> Vec<f32> {
        let width = self.width.max(1);
        let squares = Squares::new(self, compared, side);
        let mut sigma = vec![f32::NAN; compared.len()];
        for_each_row(&mut sigma, width, |row, sigma| {
            for (column, sigma) in sigma.iter_mut().enumerate() {
                let place = row * width + column;
                if let (true, Some((pixels, own))) = (compared[place], squares.at(row, column)) {
                    let mean = own / (pixels * pixels);
                    *sigma = libm::sqrt(mean + f64::from(self.motion[place])) as f32;
                }
            }
        });
        sigma
    }

    /// Stops comparing pixels until no mean over a square of `side` has a σ above `most`: about each square that has, its middle
    /// if that is noisier than the square, so that the quiet side of an edge stays; where none is, all of them. A pixel that
    /// is left out counts in no other square either. Answers with the σ of the squares that are left.
    pub fn leave_out(&self, compared: &mut [bool], side: usize, most: f64) -> Vec<f32> {
        let width = self.width.max(1);
        loop {
            let sigma = self.of_squares(compared, side);
            let too_noisy = |place: &usize| f64::from(sigma[*place]) > most;
            let failing: Vec<usize> = (0..sigma.len()).filter(too_noisy).collect();
            if failing.is_empty() {
                return sigma;
            }
            let squares = Squares::new(self, compared, side);
            let noisier = |place: &usize| {
                let square = squares.at(place / width, place % width);
                square.is_some_and(|(pixels, own)| f64::from(self.pixel[*place]) * pixels >= own)
            };
            let noisiest: Vec<usize> = failing.iter().copied().filter(noisier).collect();
            let out = if noisiest.is_empty() {
                failing
            } else {
                noisiest
            };
            for place in out {
                compared[place] = false;
            }
        }
    }
}

/// How many pixels of a square are compared, and the sum of their variances, from integral tables of (width + 1) × (rows + 1).
struct Squares {
    width: usize,
    rows: usize,
    side: usize,
    count: Vec<u32>,
    variance: Vec<f64>,
}

impl Squares {
    fn new(noise: &DeviationNoise<'_>, compared: &[bool], side: usize) -> Self {
        let width = noise.width.max(1);
        let rows = compared.len() / width;
        let stride = width + 1;
        let mut count = vec![0_u32; stride * (rows + 1)];
        let mut variance = vec![0.0_f64; stride * (rows + 1)];
        for row in 0..rows {
            let (mut pixels, mut sum) = (0, 0.0);
            for column in 0..width {
                let place = row * width + column;
                if compared[place] {
                    pixels += 1;
                    sum += f64::from(noise.pixel[place]);
                }
                let (here, above) = ((row + 1) * stride + column + 1, row * stride + column + 1);
                count[here] = count[above] + pixels;
                variance[here] = variance[above] + sum;
            }
        }
        Self {
            width,
            rows,
            side,
            count,
            variance,
        }
    }

    /// Of the square about a pixel; none if too few are compared.
    fn at(&self, row: usize, column: usize) -> Option<(f64, f64)> {
        let (stride, half) = (self.width + 1, self.side / 2);
        let (top, bottom) = (row.saturating_sub(half), (row + half + 1).min(self.rows));
        let (left, right) = (
            column.saturating_sub(half),
            (column + half + 1).min(self.width),
        );
        let corners = [
            bottom * stride + right,
            top * stride + left,
            bottom * stride + left,
            top * stride + right,
        ];
        let [a, b, c, d] = corners.map(|at| self.count[at]);
        let pixels = f64::from(a + b - c - d);
        let [a, b, c, d] = corners.map(|at| self.variance[at]);
        let least = MIN_SUPPORT * (self.side * self.side) as f64;
        (pixels >= least).then(|| (pixels, (a + b - c - d).max(0.0)))
    }
}

/// Variance of each pixel's deviation by the errors of the motion of golden and of a part, as far as both are found from
/// heights with the noise of golden; 0 where no motion is found. `window` is where the part is looked at.
///
/// An error δ of the motion lifts a pixel by j·δ ([`Fitting::row`](super::align::Fitting::row)), so it is 2 jᵀ C j with the covariance C of
/// the motion of a part that lies as taught.
pub fn motion_variance(golden: GoldenSurface<'_>, window: crate::pipeline::Window<'_>) -> Vec<f32> {
    let width = golden.surface.width;
    let mut variance = vec![0.0; golden.surface.height.len()];
    let Some(alignment) = Alignment::new(golden, window) else {
        return variance;
    };
    let Some(placed) = alignment.still(golden) else {
        return variance;
    };
    let fitting = alignment.fitting(golden);
    for_each_row(&mut variance, width, |v, row| {
        let of_pixel = |u: usize| {
            let height = golden.surface.height[v * width + u];
            if !golden.taught.compared(v * width + u) {
                return None;
            }
            let point = golden.triangulator.point(u, v, height)?;
            let facet = golden.facet(point, (u as f64, v as f64))?;
            Some(2.0 * fitting.lift_variance(&placed, facet.lift, point))
        };
        for (u, variance) in row.iter_mut().enumerate() {
            *variance = of_pixel(u).map_or(f32::NAN, |variance| variance as f32);
        }
        // Next to an edge no normal is known: as beside it.
        carry(row.iter_mut());
        carry(row.iter_mut().rev());
        for variance in row.iter_mut().filter(|variance| variance.is_nan()) {
            *variance = 0.0;
        }
    });
    variance
}

/// Gives what is not a number the value before it.
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
#[derive(Clone, Debug, PartialEq)]
pub struct LargestDeviation {
    side: f64,
    /// How many squares have a σ in each bin, see [`sigma_of`]; by the number of axes along which they are the end of a run.
    bins: [Vec<u32>; 3],
}

/// Bins per factor of two of σ, and the middle of the first, mm.
const BINS_PER_OCTAVE: f64 = 32.0;
const LEAST_SIGMA_MM: f64 = 1e-6;
/// 30 octaves: up to a metre.
const BINS: usize = 960;
/// Steps of the numerical integrals, over this many of the largest σ.
const STEPS: usize = 600;
const REACH: f64 = 12.0;

/// σ in the middle of a bin, mm.
fn sigma_of(bin: usize) -> f64 {
    LEAST_SIGMA_MM * libm::exp2(bin as f64 / BINS_PER_OCTAVE)
}

impl LargestDeviation {
    /// Of squares of `side` pixels with these σ, mm, in a frame of `width` columns; those that are not a number are no squares.
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
            // Of a run's two ends the noisier counts.
            let is_end = |(a, b): (Option<f32>, Option<f32>)| match (a, b) {
                (Some(_), Some(_)) => false,
                (Some(beside), None) | (None, Some(beside)) => sigma >= beside,
                (None, None) => true,
            };
            let ends = [(left, right), (above, below)].map(is_end);
            bins[ends.into_iter().filter(|end| *end).count()][bin as usize] += 1;
        }
        let side = side.max(1) as f64;
        Self { side, bins }
    }

    /// Λ(x): the mean number of clumps of squares that deviate by more than `limit` mm, above 0.
    fn clumps(&self, limit: f64) -> f64 {
        let mut clumps = 0.0;
        for (ends, bins) in self.bins.iter().enumerate() {
            let bins = bins.iter().enumerate();
            for (bin, &count) in bins.filter(|(_, count)| **count > 0) {
                let t = limit / sigma_of(bin);
                clumps += f64::from(count) * clumps_per_square(t, self.side, 2 - ends as i32);
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
        let step = self.top() / STEPS as f64;
        let (mut first, mut second) = (0.0, 0.0);
        for i in 0..STEPS {
            let x = (i as f64 + 0.5) * step;
            let tail = self.beyond(x);
            first += tail * step;
            second += 2.0 * x * tail * step;
        }
        (first, libm::sqrt((second - first * first).max(0.0)))
    }

    /// What no deviation reaches.
    fn top(&self) -> f64 {
        let largest = |bins: &Vec<u32>| bins.iter().rposition(|count| *count > 0);
        let largest = self.bins.iter().filter_map(largest).max();
        largest.map_or(0.0, |bin| REACH * sigma_of(bin))
    }
}

/// Clumps above t > 0 of a square of `side` pixels that lies inside its run along so many `axes`: 2 φ(t)/t θ(t) for each of them, and
/// at least those of one independent square in side².
fn clumps_per_square(t: f64, side: f64, axes: i32) -> f64 {
    let half = t * libm::sqrt(2.0 / side) / 2.0;
    let below = 0.5 * libm::erfc(-half / SQRT_2);
    let nu = (below - 0.5) / half / (half * below + density(half));
    let theta = (2.0 * half * half * nu).min(1.0);
    let independent = -libm::log(libm::erf(t / SQRT_2)) / (side * side);
    let theta = (0..axes).fold(1.0, |product, _| product * theta);
    (2.0 * density(t) / t * theta).max(independent)
}

/// φ, the normal density.
fn density(t: f64) -> f64 {
    libm::exp(-t * t / 2.0) / libm::sqrt(2.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let mut sigmas = noise.of_squares(&[true; WIDTH * WIDTH], SIDE);
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
    fn what_is_too_noisy_is_left_out_and_what_is_left_is_quiet_enough() {
        const WIDTH: usize = 40;
        let pixel: Vec<f32> = (0..WIDTH * WIDTH)
            .map(|place| if place % WIDTH < 6 { 1.0 } else { 0.01 })
            .collect();
        let motion = vec![1e-5; WIDTH * WIDTH];
        let noise = DeviationNoise {
            width: WIDTH,
            pixel: &pixel,
            motion: &motion,
        };
        let mut compared = vec![true; WIDTH * WIDTH];
        // A whole quiet square has √(0.01 / 81 + 1e-5) = 0.0116 mm.
        let quiet = noise.of_squares(&compared, SIDE)[20 * WIDTH + 20];
        assert!((f64::from(quiet) - 0.011_55).abs() < 1e-5, "{quiet}");
        let sigma = noise.leave_out(&mut compared, SIDE, 0.02);
        assert!(sigma.iter().all(|sigma| sigma.is_nan() || *sigma <= 0.02));
        assert!(compared[20 * WIDTH + 20] && !compared[20 * WIDTH + 2]);
        let kept = compared.iter().filter(|on| **on).count();
        // The noisy columns, and next to nothing beside them: in corners squares have too few pixels to be judged.
        assert!((33 * WIDTH..=34 * WIDTH + 32).contains(&kept), "{kept}");
        assert!(LargestDeviation::new(&[], WIDTH, SIDE).limit(1e-6) == 0.0);
    }
}
