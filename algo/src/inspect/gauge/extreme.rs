//! What gauges that are not linear in height share: the model of the error of an extreme, estimates
//! of true values, and the variance by the motion.
//!
//! Cells do not share pixels, so the errors of their means are independent; each has σ² = σ_z² /
//! side². The models need the cells' values only; `tests/suite/repeatability.rs` compares them with
//! the scatter of repeated measurements.

use super::reading::{Found, OfRim};
use crate::inspect::align::{Placed, form};
use crate::inspect::feature::{Cell, Rim};
use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2};

/// Largest less smallest value, one per cell. Its error is made of those of both ends, each the
/// largest of many noisy values, and of what an error of the motion does to the difference of the
/// two cells.
pub(super) fn range(
    cells: &[Cell],
    values: &mut [f64],
    sigma: f64,
    placed: Option<&Placed>,
) -> Option<Found> {
    let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
    let (high, low) = ((0..values.len()).max_by(by)?, (0..values.len()).min_by(by)?);
    let value = values[high] - values[low];
    let (upper, lower) = (cells[high].taught.jacobian, cells[low].taught.jacobian);
    let motion = motion(&core::array::from_fn(|i| upper[i] - lower[i]), placed);
    let top = spread_of_largest(values, sigma);
    for value in values.iter_mut() {
        *value = -*value;
    }
    let bottom = spread_of_largest(values, sigma);
    Some(Found {
        value,
        pixels: top * top + bottom * bottom,
        motion,
        lever: 2.0,
    })
}

/// Largest less smallest distance of the points of a contour from its shape. Each point is
/// uncertain by its own noise, of which the RMS is taken for all.
pub(super) fn range_of(rim: &Rim) -> Option<OfRim> {
    let count = rim.residuals.len();
    if count < 2 {
        return None;
    }
    let squares = rim.residuals.iter().map(|(_, sigma)| sigma * sigma);
    let sigma = libm::sqrt(squares.sum::<f64>() / count as f64);
    let mut values: Vec<f64> = rim.residuals.iter().map(|(off, _)| *off).collect();
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
    let top = spread_of_largest(&values, sigma);
    for value in &mut values {
        *value = -*value;
    }
    let bottom = spread_of_largest(&values, sigma);
    // By noise alone, which has all points at 0.
    let (mean, _) = largest_of(&[(0.0, count as f64)]);
    Some(OfRim {
        value: largest - smallest,
        variance: top * top + bottom * bottom,
        expected: Some(2.0 * mean * sigma),
    })
}

/// The variance that the motion's error gives a value with this derivative over the motion.
pub(super) fn motion(g: &[f64; 6], placed: Option<&Placed>) -> f64 {
    placed.map_or(0.0, |placed| form(g, &placed.covariance, g).max(0.0))
}

/// Rounds in which the scatter of values is found without values that lie more than [`CLIP`]
/// scatters off the mean.
const ROUNDS: usize = 4;
const CLIP: f64 = 3.0;
/// The largest of all values belongs to a defect, not to noise, where it lies more than this many
/// times the scatter off the mean.
const DEFECT: f64 = 5.0;

/// Estimates of true values: the measured ones, moved towards their mean until their scatter is
/// less by σ², so that the scatter that the errors make does not count twice. The values of a
/// defect stay where they are.
pub(super) struct Drawn {
    mean: f64,
    scatter: f64,
    share: f64,
}

impl Drawn {
    /// The estimates for values of which each has an error of `sigma`.
    pub fn of(values: impl Iterator<Item = f64> + Clone, sigma: f64) -> Self {
        let (mut mean, mut scatter) = (0.0, f64::INFINITY);
        for _ in 0..ROUNDS {
            let reach = CLIP * scatter;
            let inside = values.clone().filter(|x| libm::fabs(x - mean) <= reach);
            let count = (inside.clone().count() as f64).max(1.0);
            let middle = inside.clone().sum::<f64>() / count;
            let squares = inside.map(|x| (x - middle) * (x - middle)).sum::<f64>();
            (mean, scatter) = (middle, libm::sqrt(squares / count));
        }
        let noise = sigma / scatter.max(f64::MIN_POSITIVE);
        let share = libm::sqrt((1.0 - noise * noise).max(0.0));
        Self {
            mean,
            scatter,
            share,
        }
    }

    /// Whether a measured value lies more than `defect` times the scatter off the mean, and so
    /// belongs to a defect.
    pub fn is_off(&self, measured: f64, defect: f64) -> bool {
        libm::fabs(measured - self.mean) > defect * self.scatter
    }

    /// The estimate for a measured value.
    pub fn value(&self, measured: f64, defect: f64) -> f64 {
        match self.is_off(measured, defect) {
            true => measured,
            false => self.mean + (measured - self.mean) * self.share,
        }
    }
}

/// Bins per σ, and bins from the largest value down that are counted.
const BINS_PER_SIGMA: f64 = 4.0;
const BINS: usize = 40;

/// Standard deviation, over repeated measurements, of the largest of values of which each has an
/// error of `sigma`, from its distribution F(x) = Π Φ((x − mᵢ)/σ), m the true values ([`Drawn`]).
fn spread_of_largest(values: &[f64], sigma: f64) -> f64 {
    if !(sigma > 0.0) {
        return 0.0;
    }
    let drawn = Drawn::of(values.iter().copied(), sigma);
    let drawn = |value: &f64| drawn.value(*value, DEFECT);
    let top = values.iter().map(drawn).fold(f64::NEG_INFINITY, f64::max);
    let mut bins = [0.0; BINS];
    for value in values.iter().map(drawn) {
        let bin = libm::rint((top - value) / sigma * BINS_PER_SIGMA);
        if bin < BINS as f64 {
            bins[bin as usize] += 1.0;
        }
    }
    let bins = bins.iter().enumerate().filter(|(_, count)| **count > 0.0);
    let bins: heapless::Vec<(f64, f64), BINS> = bins
        .map(|(bin, count)| (bin as f64 / BINS_PER_SIGMA, *count))
        .collect();
    largest_of(&bins).1 * sigma
}

/// Mean, above the largest true value, and standard deviation of the largest of values with errors
/// of 1: so many true values lie so far below the largest.
fn largest_of(below_largest: &[(f64, f64)]) -> (f64, f64) {
    // Integrated from 4 σ below the largest to 6 σ above in intervals of σ/8; the largest of a
    // million reaches 5 σ.
    const STEP: f64 = 0.125;
    let (mut first, mut second) = (0.0, 0.0);
    for i in 0..80 {
        let x = -4.0 + STEP * (f64::from(i) + 0.5);
        let mut log = 0.0;
        for (bin, count) in below_largest {
            log += count * libm::log(below(x + bin));
        }
        let tail = 1.0 - libm::exp(log);
        first += tail * STEP;
        second += 2.0 * (x + 4.0) * tail * STEP;
    }
    let scatter = libm::sqrt((second - first * first).max(0.0));
    (first - 4.0, scatter)
}

/// Φ, the normal distribution.
pub(super) fn below(x: f64) -> f64 {
    (0.5 * libm::erfc(-x / SQRT_2)).max(f64::MIN_POSITIVE)
}

/// φ, its density.
pub(super) fn density(x: f64) -> f64 {
    libm::exp(-x * x / 2.0) / libm::sqrt(2.0 * PI)
}
