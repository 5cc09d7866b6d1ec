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

/// Largest less smallest value, one per cell of a grid of so many columns, less what noise alone
/// adds to both ends: the largest of many noisy values is not the largest true one. Its error is
/// made of those of both ends, and of what an error of the motion does to the difference of the two
/// cells.
pub(super) fn range(
    (cells, columns): (&[Cell], usize),
    values: &mut [f64],
    sigma: f64,
    placed: Option<&Placed>,
) -> Option<Found> {
    let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
    let (high, low) = ((0..values.len()).max_by(by)?, (0..values.len()).min_by(by)?);
    let value = values[high] - values[low];
    let (upper, lower) = (cells[high].taught.jacobian, cells[low].taught.jacobian);
    let motion = motion(&core::array::from_fn(|i| upper[i] - lower[i]), placed);
    let drawn = Drawn::of(values.iter().copied(), sigma);
    let estimate = |at: usize| drawn.value(values[at], DEFECT);
    let lost = [high, low].map(|at| lost((cells, columns), estimate, at));
    let ends = Ends::of(values, sigma, |_| 1.0);
    Some(Found {
        value: (value - ends.noise).max(0.0),
        pixels: ends.variance,
        motion,
        lever: 2.0,
        unknown: libm::hypot((lost[0] + lost[1]) / libm::sqrt(3.0), ends.open),
    })
}

/// By how much a surface may reach beyond the mean of a cell at an extreme, mm, by the estimates of
/// the true values of cells. With second
/// differences d of the cells along rows and columns, the mean is d/24 below the middle on a
/// parabola, and the extreme of one that lies anywhere in the cell another d/24 on average above
/// that. At the border of the region it is half a cell farther out.
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
    let mut values: Vec<f64> = rim.residuals.iter().map(|(off, _)| *off).collect();
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
    let ends = Ends::of(&mut values, sigma, |at| rim.residuals[at].1 / sigma);
    Some(OfRim {
        value: (largest - smallest - ends.noise).max(0.0),
        variance: ends.variance,
        unknown: ends.open,
    })
}

/// What noise does to both ends of a range.
struct Ends {
    /// What it adds on average.
    noise: f64,
    /// The variance of the range.
    variance: f64,
    /// How far the former is not known, 1 σ.
    open: f64,
}

impl Ends {
    /// Of these values, which are negated; each has an error of `sigma` times `relative`.
    fn of(values: &mut [f64], sigma: f64, relative: impl Fn(usize) -> f64) -> Self {
        if !(sigma > 0.0) {
            return Self {
                noise: 0.0,
                variance: 0.0,
                open: 0.0,
            };
        }
        let drawn = Drawn::of(values.iter().copied(), sigma);
        let top = noise_of_largest(values, sigma, |at, value| {
            drawn.value(value, DEFECT * relative(at).max(1.0))
        });
        for value in values.iter_mut() {
            *value = -*value;
        }
        let bottom = noise_of_largest(values, sigma, |at, value| {
            -drawn.value(-value, DEFECT * relative(at).max(1.0))
        });
        // Where the scatter of the values is not far from that of noise, it is not known how much of
        // it the part has: the middle between this much and noise alone is taken.
        // An end that is a defect's is known.
        let noise = top.0 + bottom.0;
        let alone = largest_of(&[(0.0, values.len() as f64)]).0 * sigma;
        let all = values.iter().copied();
        let low = all.clone().fold(f64::INFINITY, f64::min);
        let high = all.fold(f64::NEG_INFINITY, f64::max);
        let left = |end: f64, of: f64| match drawn.is_off(-end, DEFECT) {
            true => 0.0,
            false => (alone - of).max(0.0),
        };
        // The values are negated: their lowest is the highest.
        let both = left(low, top.0) + left(high, bottom.0);
        let open = both * (sigma / drawn.scatter.max(sigma)) / 2.0;
        Self {
            noise: noise + open,
            // Half of it is another one in each measurement.
            variance: top.1 * top.1 + bottom.1 * bottom.1 + open * open / 2.0,
            open: open / libm::sqrt(2.0),
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

/// Mean, above the largest true value, and standard deviation, over repeated measurements, of the
/// largest of values of which each has an error of `sigma`, from its distribution F(x) = Π Φ((x −
/// mᵢ)/σ), m the true values, which `drawn` estimates.
fn noise_of_largest(values: &[f64], sigma: f64, drawn: impl Fn(usize, f64) -> f64) -> (f64, f64) {
    let all = values.iter().enumerate();
    let drawn = all.map(|(at, value)| drawn(at, *value));
    let top = drawn.clone().fold(f64::NEG_INFINITY, f64::max);
    let mut bins = [0.0; BINS];
    for value in drawn {
        let bin = libm::rint((top - value) / sigma * BINS_PER_SIGMA);
        if bin < BINS as f64 {
            bins[bin as usize] += 1.0;
        }
    }
    let bins = bins.iter().enumerate().filter(|(_, count)| **count > 0.0);
    let bins: heapless::Vec<(f64, f64), BINS> = bins
        .map(|(bin, count)| (bin as f64 / BINS_PER_SIGMA, *count))
        .collect();
    let (mean, scatter) = largest_of(&bins);
    (mean * sigma, scatter * sigma)
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
