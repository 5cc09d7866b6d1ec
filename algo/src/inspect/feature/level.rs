//! Mean and least-squares plane of the heights of cells, in closed form.

use super::cells::Cell;
use alloc::vec::Vec;

/// The weight of a cell: the number of its pixels as taught, so that it is the same in every
/// measurement.
pub fn weight(cell: &Cell) -> f64 {
    f64::from(cell.taught.pixels)
}

/// The mean height over the pixels as taught, mm. The weights of the cells are appended to `out`.
pub fn mean(cells: &[Cell], out: &mut Vec<f64>) -> Option<f64> {
    let all: f64 = cells.iter().map(weight).sum();
    let sum: f64 = cells.iter().map(|cell| weight(cell) * cell.height).sum();
    if all <= 0.0 {
        return None;
    }
    out.extend(cells.iter().map(|cell| weight(cell) / all));
    Some(sum / all)
}

/// The least-squares plane z = z₀ + p·(x − x₀) + q·(y − y₀) of cells; a cell's weight is the number
/// of its pixels as taught.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelPlane {
    pub centre: [f64; 3],
    pub along: f64,
    pub down: f64,
    /// Σ dx², Σ dx dy, Σ dy².
    pub squares: [f64; 3],
}

impl LevelPlane {
    /// `None` where the cells lie on a line.
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

    /// How far a cell lies above the plane along the plane's normal, mm.
    pub fn above(&self, cell: &Cell) -> f64 {
        let (dx, dy) = (
            cell.taught.x - self.centre[0],
            cell.taught.y - self.centre[1],
        );
        let rise = cell.height - self.centre[2] - self.along * dx - self.down * dy;
        rise / libm::sqrt(1.0 + self.along * self.along + self.down * self.down)
    }
}
