//! Gauges that are linear in height: mean, tilt, volume. Their errors follow exactly from those of the pixels.

use super::{Axis, Cell, Found};
use crate::inspect::align::{Placed, form};
use alloc::vec::Vec;

/// How a value changes with the mean height of each cell: its derivatives.
pub type Weights = Vec<f64>;

/// The error of a value with these weights: σ² = Σ wᵢ² σ_z² / nᵢ + gᵀ C g. n are a cell's pixels, `variance` gives σ_z² of a single pixel
/// of each cell, g = Σ wᵢ jᵢ is the derivative of the value over the motion, j a cell's Jacobian, and C the motion's covariance. The
/// two terms are taken as independent: the pixels that the motion is found from are one in some dozens of the gauge's.
pub fn found(
    value: f64,
    weights: &[f64],
    cells: &[Cell],
    variance: impl Fn(usize) -> f64,
    placed: Option<&Placed>,
) -> Found {
    let pairs = || weights.iter().zip(cells);
    let each = |(at, (w, cell)): (usize, (&f64, &Cell))| w * w * variance(at) / cell.pixels;
    let pixels: f64 = pairs().enumerate().map(each).sum();
    let motion = placed.map_or(0.0, |placed| {
        let mut g = [0.0; 6];
        for (w, cell) in pairs() {
            for (g, j) in g.iter_mut().zip(cell.taught.jacobian) {
                *g += w * j;
            }
        }
        form(&g, &placed.covariance, &g)
    });
    Found {
        value,
        pixels,
        motion: motion.max(0.0),
        lever: weights.iter().copied().map(libm::fabs).sum(),
    }
}

/// The weight of a cell: its pixels as taught, so that it is the same in every measurement.
fn weight(cell: &Cell) -> f64 {
    f64::from(cell.taught.pixels)
}

/// The mean height over the pixels as taught, mm. Its weights are appended to `out`.
pub fn mean(cells: &[Cell], out: &mut Weights) -> Option<f64> {
    let all: f64 = cells.iter().map(weight).sum();
    let sum: f64 = cells.iter().map(|cell| weight(cell) * cell.height).sum();
    if all <= 0.0 {
        return None;
    }
    out.extend(cells.iter().map(|cell| weight(cell) / all));
    Some(sum / all)
}

/// The mean of cells less that of others, mm; the weights of the others behind those of the first.
pub fn step(of: &[Cell], from: &[Cell], out: &mut Weights) -> Option<f64> {
    let value = mean(of, out)? - mean(from, out)?;
    for weight in out.iter_mut().rev().take(from.len()) {
        *weight = -*weight;
    }
    Some(value)
}

/// The least-squares plane z = z₀ + p·(x − x₀) + q·(y − y₀) of cells, each weighing as its pixels as taught.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    centre: [f64; 3],
    pub along: f64,
    pub down: f64,
    /// Σ dx², Σ dx dy, Σ dy².
    squares: [f64; 3],
}

impl Plane {
    /// None where the cells lie on a line.
    pub fn of(cells: &[Cell]) -> Option<Self> {
        let pixels: f64 = cells.iter().map(weight).sum();
        let mean = |value: fn(&Cell) -> f64| {
            cells
                .iter()
                .map(|cell| weight(cell) * value(cell))
                .sum::<f64>()
                / pixels
        };
        let centre = [
            mean(|c| c.taught.x),
            mean(|c| c.taught.y),
            mean(|c| c.height),
        ];
        let (mut squares, mut right) = ([0.0; 3], [0.0; 2]);
        for cell in cells {
            let (dx, dy, dz) = (
                cell.taught.x - centre[0],
                cell.taught.y - centre[1],
                cell.height - centre[2],
            );
            squares[0] += weight(cell) * dx * dx;
            squares[1] += weight(cell) * dx * dy;
            squares[2] += weight(cell) * dy * dy;
            right[0] += weight(cell) * dx * dz;
            right[1] += weight(cell) * dy * dz;
        }
        let [xx, xy, yy] = squares;
        let determinant = xx * yy - xy * xy;
        (determinant > 1e-9 * (xx + yy) * (xx + yy)).then(|| Self {
            centre,
            along: (yy * right[0] - xy * right[1]) / determinant,
            down: (xx * right[1] - xy * right[0]) / determinant,
            squares,
        })
    }

    /// How far a cell lies above it along its normal, mm.
    pub fn above(&self, cell: &Cell) -> f64 {
        let (dx, dy) = (
            cell.taught.x - self.centre[0],
            cell.taught.y - self.centre[1],
        );
        let rise = cell.height - self.centre[2] - self.along * dx - self.down * dy;
        rise / libm::sqrt(1.0 + self.along * self.along + self.down * self.down)
    }
}

/// The angle of the least-squares plane about an axis, degrees, right-handed. Its weights are appended to `out`.
pub fn tilt(cells: &[Cell], about: Axis, out: &mut Weights) -> Option<f64> {
    let plane = Plane::of(cells)?;
    let [xx, xy, yy] = plane.squares;
    let determinant = xx * yy - xy * xy;
    // Turned about +x, what lies at +y rises; turned about +y, what lies at +x sinks.
    let (slope, sign) = match about {
        Axis::X => (plane.down, 1.0_f64),
        Axis::Y => (plane.along, -1.0),
    };
    let degrees = f64::to_degrees(sign) / (1.0 + slope * slope);
    let change = |cell: &Cell| {
        let (dx, dy) = (
            cell.taught.x - plane.centre[0],
            cell.taught.y - plane.centre[1],
        );
        let lever = match about {
            Axis::X => xx * dy - xy * dx,
            Axis::Y => yy * dx - xy * dy,
        };
        degrees * weight(cell) * lever / determinant
    };
    out.extend(cells.iter().map(change));
    Some((sign * libm::atan(slope)).to_degrees())
}

/// The volume between the surface and the plane z = `above`, mm³: each cell's area in x and y as taught times its height.
/// Its weights are appended to `out`.
pub fn volume(cells: &[Cell], above: f64, out: &mut Weights) -> Option<f64> {
    let each = |cell: &Cell| cell.taught.area * (cell.height - above);
    out.extend(cells.iter().map(|cell| cell.taught.area));
    (!cells.is_empty()).then(|| cells.iter().map(each).sum())
}
