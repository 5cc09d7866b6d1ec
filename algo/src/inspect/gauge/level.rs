//! Gauges that are linear in height: mean, tilt, volume. Their errors follow exactly from those of the pixels.

use super::{Axis, Cell};
use crate::inspect::align::{Placed, form};
use alloc::vec::Vec;

/// A value and how it changes with the mean height of each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// The value.
    pub value: f64,
    /// Its derivatives.
    pub weights: Vec<f64>,
}

impl Linear {
    /// Error of the value (1 σ): σ² = Σ wᵢ² σ_z² / nᵢ + gᵀ C g, n a cell's pixels, `variance` σ_z² of one of them,
    /// g = Σ wᵢ jᵢ how the value follows the motion and C the motion's covariance. That the pixels of the motion are some of
    /// the gauge's is left out: they are one in some dozens.
    pub fn sigma(&self, cells: &[Cell<'_>], variance: f64, placed: Option<&Placed>) -> f64 {
        self.sigma_of(cells, |_| variance, placed)
    }

    /// The same with a variance per cell.
    pub fn sigma_of(
        &self,
        cells: &[Cell<'_>],
        variance: impl Fn(usize) -> f64,
        placed: Option<&Placed>,
    ) -> f64 {
        let pairs = || self.weights.iter().zip(cells);
        let each = |(at, (w, cell)): (usize, (&f64, &Cell<'_>))| w * w * variance(at) / cell.pixels;
        let pixels: f64 = pairs().enumerate().map(each).sum();
        let motion = placed.map_or(0.0, |placed| {
            let mut g = [0.0; 6];
            for (w, cell) in pairs() {
                for (g, row) in g.iter_mut().zip(cell.taught.row) {
                    *g += w * row;
                }
            }
            form(&g, &placed.covariance, &g)
        });
        libm::sqrt(pixels + motion.max(0.0))
    }
}

/// What a cell counts: as much as it had pixels when it was taught, so that it is always the same.
fn weight(cell: &Cell<'_>) -> f64 {
    f64::from(cell.taught.pixels)
}

/// The mean height, mm; each pixel as taught counts the same.
pub fn mean(cells: &[Cell<'_>]) -> Option<Linear> {
    let all: f64 = cells.iter().map(weight).sum();
    let sum: f64 = cells.iter().map(|cell| weight(cell) * cell.height).sum();
    (all > 0.0).then(|| Linear {
        value: sum / all,
        weights: cells.iter().map(|cell| weight(cell) / all).collect(),
    })
}

/// A mean less another; the second one's cells behind the first one's.
pub fn step(mut of: Linear, from: Linear) -> Linear {
    of.value -= from.value;
    of.weights
        .extend(from.weights.into_iter().map(|weight| -weight));
    of
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
    pub fn of(cells: &[Cell<'_>]) -> Option<Self> {
        let pixels: f64 = cells.iter().map(|cell| weight(cell)).sum();
        let mean = |value: fn(&Cell<'_>) -> f64| {
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
    pub fn above(&self, cell: &Cell<'_>) -> f64 {
        let (dx, dy) = (
            cell.taught.x - self.centre[0],
            cell.taught.y - self.centre[1],
        );
        let rise = cell.height - self.centre[2] - self.along * dx - self.down * dy;
        rise / libm::sqrt(1.0 + self.along * self.along + self.down * self.down)
    }
}

/// The angle of the least-squares plane about an axis, degrees, right-handed.
pub fn tilt(cells: &[Cell<'_>], about: Axis) -> Option<Linear> {
    let plane = Plane::of(cells)?;
    let [xx, xy, yy] = plane.squares;
    let determinant = xx * yy - xy * xy;
    // Turned about +x, what lies at +y rises; turned about +y, what lies at +x sinks.
    let (slope, sign) = match about {
        Axis::X => (plane.down, 1.0_f64),
        Axis::Y => (plane.along, -1.0),
    };
    let degrees = f64::to_degrees(sign) / (1.0 + slope * slope);
    let change = |cell: &Cell<'_>| {
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
    Some(Linear {
        value: (sign * libm::atan(slope)).to_degrees(),
        weights: cells.iter().map(change).collect(),
    })
}

/// The volume between the surface and the plane z = `above`, mm³: each cell's area in x and y as taught times its height.
pub fn volume(cells: &[Cell<'_>], above: f64) -> Option<Linear> {
    let each = |cell: &Cell<'_>| cell.taught.area * (cell.height - above);
    (!cells.is_empty()).then(|| Linear {
        value: cells.iter().map(each).sum(),
        weights: cells.iter().map(|cell| cell.taught.area).collect(),
    })
}
