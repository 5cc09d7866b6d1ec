//! What was measured in each cell of a region, and the mean and least-squares plane of their heights,
//! in closed form.

use super::taught::TaughtCell;
use alloc::vec::Vec;

/// A region with fewer than this share of the pixels that it had as taught has no cells.
const MIN_SHARE: f64 = 0.5;

/// Sums over the pixels of a cell. Whole numbers, so that the order of summation does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    /// Pixels.
    pub count: i64,
    /// Σ of deviations from golden, nm.
    pub deviation: i64,
}

impl Sum {
    /// Adds another's pixels.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.deviation += other.deviation;
    }
}

/// The means of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its number in the [`Grid`](super::Grid).
    pub at: usize,
    /// Pixels whose noise makes its error.
    pub pixels: f64,
    /// Height, mm: as taught plus the mean deviation, so that it does not depend on which pixels of
    /// the cell were measured.
    pub height: f64,
    /// Deviation from golden in height, mm.
    pub deviation: f64,
    /// The cell as taught.
    pub taught: TaughtCell,
}

/// Appends the cells of a region to `out`; none if less than half of the pixels that it had as
/// taught were measured. With `least`, only cells with at least so many measured pixels. Without,
/// all cells that it had as taught: one without a measured pixel gets the mean deviation of the
/// others.
pub fn cells(sums: &[Sum], taught: &[TaughtCell], least: Option<i64>, out: &mut Vec<Cell>) {
    let had: u64 = taught.iter().map(|cell| u64::from(cell.pixels)).sum();
    let has: i64 = sums.iter().map(|sum| sum.count).sum();
    if has == 0 || (has as f64) < MIN_SHARE * had as f64 {
        return;
    }
    let all: i64 = sums.iter().map(|sum| sum.deviation).sum();
    let mean = all as f64 / has as f64;
    let pairs = sums.iter().zip(taught).enumerate();
    let pairs = pairs.filter(|(_, (sum, taught))| {
        taught.pixels > 0 && least.is_none_or(|least| sum.count >= least)
    });
    out.extend(pairs.map(|(at, (sum, &taught))| {
        let (pixels, nm) = match sum.count {
            0 => (f64::from(taught.pixels), mean),
            count => (count as f64, sum.deviation as f64 / count as f64),
        };
        let deviation = nm * 1e-6;
        Cell {
            at,
            pixels,
            height: taught.height + deviation,
            deviation,
            taught,
        }
    }));
}

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
