//! Gauges that are not linear in height: flatness, peak-to-valley, RMS and share of deviations, with models of their errors.
//!
//! Cells do not share pixels, so the errors of their means are independent, with σ² = σ_z² / side² each. The models need the
//! cells' values only; `tests/suite/precision.rs` compares them with simulation.

use super::level::Plane;
use super::{Cell, Found};
use crate::inspect::align::{Placed, form};
use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2};

/// Peak-to-valley flatness about the least-squares plane, mm (ISO 12781-1: FLTt about LSPL). `sigma` is the error of a
/// cell's mean, mm. The plane's own error is small against a cell's and left out. `room` is for a value per cell.
pub fn flatness(
    cells: &[Cell],
    sigma: f64,
    placed: Option<&Placed>,
    room: &mut Vec<f64>,
) -> Option<Found> {
    let plane = Plane::of(cells)?;
    let slope = 1.0 + plane.along * plane.along + plane.down * plane.down;
    let heights = cells.iter().map(|cell| plane.above(cell));
    room.clear();
    room.extend(heights);
    range(cells, room, sigma / libm::sqrt(slope), placed)
}

/// The highest less the lowest cell, mm. `room` is for a value per cell.
pub fn peak_to_valley(
    cells: &[Cell],
    sigma: f64,
    placed: Option<&Placed>,
    room: &mut Vec<f64>,
) -> Option<Found> {
    room.clear();
    room.extend(cells.iter().map(|cell| cell.height));
    range(cells, room, sigma, placed)
}

/// Largest less smallest value, one per cell. Its error is made of those of both ends, each the largest of many noisy values,
/// and of what an error of the motion does to the difference of the two cells.
fn range(cells: &[Cell], values: &mut [f64], sigma: f64, placed: Option<&Placed>) -> Option<Found> {
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

/// The variance that the motion's error gives a value with this derivative over the motion.
fn motion(g: &[f64; 6], placed: Option<&Placed>) -> f64 {
    placed.map_or(0.0, |placed| form(g, &placed.covariance, g).max(0.0))
}

/// Rounds in which the scatter of values is found without those that lie more than [`CLIP`] times of it off their mean.
const ROUNDS: usize = 4;
const CLIP: f64 = 3.0;
/// The largest of all values belongs to a defect, not to noise, where it lies more than this many times the scatter off the mean.
const DEFECT: f64 = 5.0;
/// Where all are counted, any one that lies more than this many times the scatter off belongs to the rim of a defect: of noise it is one in
/// 2000.
const RIM: f64 = 3.5;

/// Estimates of true values: the measured ones, moved towards their mean until their scatter is less by σ², so that the scatter that
/// the errors make does not count twice. Those of a defect stay where they are.
struct Drawn {
    mean: f64,
    scatter: f64,
    share: f64,
}

impl Drawn {
    /// Of values with an error of `sigma` each.
    fn of(values: impl Iterator<Item = f64> + Clone, sigma: f64) -> Self {
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

    /// Whether a measured value lies more than `defect` times the scatter off the mean, and so belongs to a defect.
    fn is_off(&self, measured: f64, defect: f64) -> bool {
        libm::fabs(measured - self.mean) > defect * self.scatter
    }

    /// The estimate for a measured value.
    fn value(&self, measured: f64, defect: f64) -> f64 {
        match self.is_off(measured, defect) {
            true => measured,
            false => self.mean + (measured - self.mean) * self.share,
        }
    }
}

/// Bins per σ, and bins from the largest value down that are counted.
const BINS_PER_SIGMA: f64 = 4.0;
const BINS: usize = 40;

/// Standard deviation, over repeated measurements, of the largest of values with an error of `sigma` each, from its distribution
/// F(x) = Π Φ((x − mᵢ)/σ), m the true values ([`Drawn`]).
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
    // Integrated from 4 σ below the largest to 6 σ above in intervals of σ/8; the largest of a million reaches 5 σ.
    const STEP: f64 = 0.125;
    let (mut first, mut second) = (0.0, 0.0);
    for i in 0..80 {
        let x = -4.0 + STEP * (f64::from(i) + 0.5);
        let mut log = 0.0;
        for (bin, count) in bins.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            log += count * libm::log(below(x + bin as f64 / BINS_PER_SIGMA));
        }
        let tail = 1.0 - libm::exp(log);
        first += tail * STEP;
        second += 2.0 * (x + 4.0) * tail * STEP;
    }
    libm::sqrt((second - first * first).max(0.0)) * sigma
}

/// Φ, the normal distribution.
fn below(x: f64) -> f64 {
    (0.5 * libm::erfc(-x / SQRT_2)).max(f64::MIN_POSITIVE)
}

/// φ, its density.
fn density(x: f64) -> f64 {
    libm::exp(-x * x / 2.0) / libm::sqrt(2.0 * PI)
}

/// Root of the mean square of the deviations, mm. Var(mean d²) = (4σ² Σd² − 2nσ⁴) / n² + gᵀ C g: the scatter of d² about fixed true
/// deviations, whose squares are estimated by d² − σ², and the error of the motion, g = Σ 2dᵢ jᵢ / n.
pub fn rms(cells: &[Cell], sigma: f64, placed: Option<&Placed>) -> Option<Found> {
    if cells.is_empty() {
        return None;
    }
    let count = cells.len() as f64;
    let (mut squares, mut g) = (0.0, [0.0; 6]);
    for cell in cells {
        squares += cell.deviation * cell.deviation;
        for (sum, value) in g.iter_mut().zip(cell.taught.jacobian) {
            *sum += 2.0 * cell.deviation * value / count;
        }
    }
    let variance = sigma * sigma;
    // At least what noise alone gives.
    let least = 2.0 * count * variance * variance;
    let own = (4.0 * variance * squares - least).max(least) / (count * count);
    let value = libm::sqrt(squares / count);
    let slope = 2.0 * value.max(sigma).max(f64::MIN_POSITIVE);
    Some(Found {
        value,
        pixels: own / (slope * slope),
        motion: motion(&g, placed) / (slope * slope),
        lever: 1.0,
    })
}

/// Cells further than this many σ from the tolerance lie on the same side of it in every measurement.
const SURE: f64 = 8.0;

/// Share of the cells that deviate by more than `tolerance` mm. A cell of true deviation m lies outside with
/// p = Q((T − m)/σ) + Q((T + m)/σ), Q the upper tail of the normal distribution, so σ² = Σ p(1 − p) / n² + gᵀ C g: the error of the motion
/// moves all cells together, g = Σ p′ j / n. True deviations are drawn as [`Drawn`]; those of the rim of a defect, whose true ones
/// scatter more than those of the rest, by themselves. `columns` are those of the grid; `room` is for a value per cell.
pub fn share_outside(
    (cells, columns): (&[Cell], usize),
    sigma: f64,
    tolerance: f64,
    placed: Option<&Placed>,
    room: &mut Vec<f64>,
) -> Option<Found> {
    if cells.is_empty() {
        return None;
    }
    let count = cells.len() as f64;
    let sizes = cells.iter().map(|cell| libm::fabs(cell.deviation));
    let outside = sizes.filter(|size| *size > tolerance).count() as f64;
    let drawn = Drawn::of(cells.iter().map(|cell| cell.deviation), sigma);
    mark_beside(
        (cells, columns),
        |cell| drawn.is_off(cell.deviation, RIM),
        room,
    );
    let rim = cells.iter().zip(&*room);
    let rim = rim.filter(|(cell, mark)| **mark > 0.0 && !drawn.is_off(cell.deviation, RIM));
    let rim = Drawn::of(rim.map(|(cell, _)| cell.deviation), sigma);
    let (mut variance, mut lever, mut g) = (0.0, 0.0, [0.0; 6]);
    for (cell, mark) in cells.iter().zip(&*room) {
        let m = match drawn.is_off(cell.deviation, RIM) || *mark == 0.0 {
            true => drawn.value(cell.deviation, RIM),
            false => rim.value(cell.deviation, RIM),
        };
        let [upper, lower] = [(tolerance - m) / sigma, (tolerance + m) / sigma];
        if libm::fabs(upper).min(libm::fabs(lower)) < SURE {
            let p = below(-upper) + below(-lower);
            variance += (p * (1.0 - p)).max(0.0);
            let slope = (density(upper) - density(lower)) / (sigma * count);
            lever += libm::fabs(slope);
            for (g, j) in g.iter_mut().zip(cell.taught.jacobian) {
                *g += slope * j;
            }
        }
    }
    Some(Found {
        value: outside / count,
        pixels: variance / (count * count),
        motion: motion(&g, placed),
        lever,
    })
}

/// Marks by 1, of all others by 0, the cells that have one of a defect beside them, in a grid of so many columns.
fn mark_beside(
    (cells, columns): (&[Cell], usize),
    is_defect: impl Fn(&Cell) -> bool,
    marks: &mut Vec<f64>,
) {
    marks.clear();
    marks.resize(cells.len(), 0.0);
    let row = |at: usize| at / columns;
    for defect in cells.iter().filter(|cell| is_defect(cell)) {
        for middle in [
            defect.at.wrapping_sub(columns),
            defect.at,
            defect.at + columns,
        ] {
            let first = cells.partition_point(|cell| cell.at + 1 < middle);
            let near = cells[first..].iter().zip(&mut marks[first..]);
            near.take_while(|(cell, _)| cell.at <= middle + 1)
                .filter(|(cell, _)| row(cell.at) == row(middle))
                .for_each(|(_, mark)| *mark = 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beside_a_defect_is_marked_and_rows_do_not_wrap() {
        let deviating = [0, 14, 23];
        // Six columns; cell 7 was not measured.
        let cells = (0..24).filter(|at| *at != 7).map(|at| Cell {
            at,
            pixels: 25.0,
            height: 0.0,
            deviation: if deviating.contains(&at) { 1.0 } else { 0.0 },
            taught: Default::default(),
        });
        let cells: Vec<Cell> = cells.collect();
        let mut marks = Vec::new();
        mark_beside((&cells, 6), |cell| cell.deviation > 0.5, &mut marks);
        let marked = cells.iter().zip(&marks).filter(|(_, mark)| **mark == 1.0);
        let marked: Vec<usize> = marked.map(|(cell, _)| cell.at).collect();
        let expected = [0, 1, 6, 8, 9, 13, 14, 15, 16, 17, 19, 20, 21, 22, 23];
        assert_eq!(marked, expected);
    }
}
