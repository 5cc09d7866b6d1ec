//! What gauges that are not linear in height share: the model of the error of an extreme, estimates
//! of true values, and the variance by the motion.
//!
//! Cells do not share pixels, so the errors of their means are independent; each has σ² = σ_z² /
//! side². The models need the cells' values only; `tests/suite/repeatability.rs` compares them with
//! the scatter of repeated measurements.

use super::reading::{FoundValue, OfRim};
use crate::inspect::align::{Placed, form};
use crate::inspect::feature::{Cell, Rim};
use alloc::vec::Vec;
use core::f64::consts::SQRT_2;

/// Largest less smallest value, one per cell of a grid of so many columns, less what noise alone
/// adds to both ends: the largest of many noisy values is not the largest true one. Its error is
/// made of those of both ends, and of what an error of the motion does to the difference of the two
/// cells.
pub(super) fn range(
    (cells, columns): (&[Cell], usize),
    values: &[f64],
    sigma: f64,
    placed: Option<&Placed>,
) -> Option<FoundValue> {
    let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
    let (high, low) = ((0..values.len()).max_by(by)?, (0..values.len()).min_by(by)?);
    let value = values[high] - values[low];
    let (upper, lower) = (cells[high].taught.jacobian, cells[low].taught.jacobian);
    let motion = motion(&core::array::from_fn(|i| upper[i] - lower[i]), placed);
    let drawn = ExtremeOfNoise::of(values.iter().copied(), sigma);
    let lost = [high, low].map(|at| {
        let estimate = |at: usize| drawn.value(values[at], DEFECT);
        lost((cells, columns), estimate, at)
    });
    let noise = Noise::of(values, &drawn, sigma, |_| 1.0);
    Some(FoundValue {
        value: (value - noise.mean).max(0.0),
        pixels: noise.variance,
        motion,
        lever: 2.0,
        unknown: libm::hypot((lost[0] + lost[1]) / libm::sqrt(3.0), noise.unknown),
    })
}

/// By how much a surface may reach beyond the mean of a cell at an extreme, mm; `value` estimates the
/// true value of a cell. On a parabola with the second difference d along rows or columns, the mean
/// of a cell lies d/24 below its middle, and the vertex, anywhere in the cell, another d/24 above
/// the middle on average. At the border of the region the surface goes on for half a cell.
fn lost((cells, columns): (&[Cell], usize), value: impl Fn(usize) -> f64, at: usize) -> f64 {
    let middle = value(at);
    let row = |at: usize| at / columns.max(1);
    let beside = |to: Option<usize>, in_row: bool| {
        let to = to.filter(|&to| !in_row || row(to) == row(cells[at].at))?;
        let place = cells.binary_search_by_key(&to, |cell| cell.at).ok()?;
        Some(value(place))
    };
    let along = |step: usize, in_row: bool| {
        let place = cells[at].at;
        let before = beside(place.checked_sub(step), in_row);
        match (before, beside(Some(place + step), in_row)) {
            (Some(a), Some(b)) => libm::fabs(a + b - 2.0 * middle) / 12.0,
            (Some(only), None) | (None, Some(only)) => libm::fabs(only - middle) / 2.0,
            (None, None) => 0.0,
        }
    };
    along(1, true) + along(columns.max(1), false)
}

/// Largest less smallest distance of the points of a contour from its shape, less what noise alone
/// adds. Each point is uncertain by its own noise, of which the RMS is taken for all.
pub(super) fn range_of(rim: &Rim) -> Option<OfRim> {
    let count = rim.residuals.len();
    if count < 2 {
        return None;
    }
    let squares = rim.residuals.iter().map(|(_, sigma)| sigma * sigma);
    let sigma = libm::sqrt(squares.sum::<f64>() / count as f64);
    let values: Vec<f64> = rim.residuals.iter().map(|(off, _)| *off).collect();
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
    let drawn = ExtremeOfNoise::of(values.iter().copied(), sigma);
    let relative = |at: usize| rim.residuals[at].1 / sigma;
    let noise = Noise::of(&values, &drawn, sigma, relative);
    Some(OfRim {
        value: (largest - smallest - noise.mean).max(0.0),
        variance: noise.variance,
        unknown: noise.unknown,
    })
}

/// What noise does to a range.
#[derive(Default)]
struct Noise {
    /// What it adds on average.
    mean: f64,
    /// The variance over repeated measurements.
    variance: f64,
    /// How far `mean` is not known, and the same in every measurement, 1 σ.
    unknown: f64,
}

impl Noise {
    /// In the range of values with errors of `sigma` times `relative`, whose true values `drawn`
    /// estimates.
    ///
    /// Where they scatter hardly more than their errors, it is not known how much of the scatter is
    /// the part's. The mean is then between what the estimates say and what noise alone adds, and
    /// half of the variance of that differs from measurement to measurement.
    fn of(
        values: &[f64],
        drawn: &ExtremeOfNoise,
        sigma: f64,
        relative: impl Fn(usize) -> f64,
    ) -> Self {
        if !(sigma > 0.0) {
            return Self::default();
        }
        let defect = |at: usize| DEFECT * relative(at).max(1.0);
        let alone = largest_of(&[(0.0, values.len() as f64)]).0;
        let likely = sigma / drawn.scatter.max(sigma);
        let (mut mean, mut variance, mut open) = (0.0, 0.0, 0.0);
        for sign in [1.0, -1.0] {
            let all = values.iter().enumerate();
            let estimate = |(at, value): (usize, &f64)| sign * drawn.value(*value, defect(at));
            let (added, scatter) = noise_of_largest(all.clone().map(estimate), sigma);
            let by = |a: &(usize, &f64), b: &(usize, &f64)| (sign * a.1).total_cmp(&(sign * b.1));
            // The end that a defect makes is known.
            let is_open = |(at, value): (usize, &f64)| !drawn.is_off(*value, defect(at));
            if all.max_by(by).is_some_and(is_open) {
                open += (alone - added).max(0.0) * likely / 2.0;
            }
            mean += added;
            variance += scatter * scatter;
        }
        Self {
            mean: (mean + open) * sigma,
            variance: (variance + open * open / 2.0) * sigma * sigma,
            unknown: open * sigma / SQRT_2,
        }
    }
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
pub(super) struct ExtremeOfNoise {
    mean: f64,
    scatter: f64,
    share: f64,
}

impl ExtremeOfNoise {
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

/// Mean, above the largest of the `true_values`, and standard deviation, over repeated measurements, of
/// the largest of values of which each has an error of `sigma`, in σ, from its distribution F(x) =
/// Π Φ((x − mᵢ)/σ).
fn noise_of_largest(true_values: impl Iterator<Item = f64> + Clone, sigma: f64) -> (f64, f64) {
    let top = true_values.clone().fold(f64::NEG_INFINITY, f64::max);
    let mut bins = [0.0; BINS];
    for value in true_values {
        let bin = libm::rint((top - value) / sigma * BINS_PER_SIGMA);
        if bin < BINS as f64 {
            bins[bin as usize] += 1.0;
        }
    }
    let bins = bins.iter().enumerate().filter(|(_, count)| **count > 0.0);
    let bins: heapless::Vec<(f64, f64), BINS> = bins
        .map(|(bin, count)| (bin as f64 / BINS_PER_SIGMA, *count))
        .collect();
    largest_of(&bins)
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
