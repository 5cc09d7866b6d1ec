//! The square cells that a region is divided into, as they were taught: place, size, and how their
//! heights change with a motion of the part.

use crate::geometry::Vector;
use crate::inspect::align::GoldenSurface;
use crate::inspect::region::Region;
use alloc::vec;
use alloc::vec::Vec;

/// A cell as taught.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaughtCell {
    /// Number of pixels that are compared.
    pub pixels: u32,
    /// Their mean height, mm.
    pub height: f64,
    /// Their mean x, mm.
    pub x: f64,
    /// Their mean y, mm.
    pub y: f64,
    /// Their area in x and y, mm².
    pub area: f64,
    /// −∂z/∂x, the derivative of the cell's height over the components x of the motion that is
    /// taken back: shifts in mm, turns as the way of a point at the radius in mm
    /// ([`Facet::jacobian`](crate::inspect::align::Facet::jacobian)).
    pub jacobian: [f64; 6],
    /// Σ of the variances of its pixels' heights, mm².
    pub variance: f64,
    /// The share of a height difference that lies along the normal
    /// ([`normal_shares`](crate::inspect::normal_shares)).
    pub normal: f64,
    /// Their mean ray: how far a point moves along x and y that becomes 1 mm higher on it.
    pub ray: [f64; 2],
}

impl TaughtCell {
    /// The same cell, with deviations along the normal instead of in height.
    #[must_use]
    pub fn along_normal(mut self) -> Self {
        self.jacobian = self.jacobian.map(|value| value * self.normal);
        self.variance *= self.normal * self.normal;
        self
    }
}

/// How many facets of a cell are averaged in each direction.
const FACETS: usize = 4;

/// The cells of a region; turns are `about` this centre, as ways at this radius.
pub fn taught_cells(
    grid: &Grid,
    region: &Region,
    golden: GoldenSurface<'_>,
    about: (Vector, f64),
) -> Vec<TaughtCell> {
    let width = golden.surface.width;
    let mut cells = vec![TaughtCell::default(); grid.len()];
    let mut facets = vec![0.0; grid.len()];
    let stride = (grid.side() / FACETS).max(1);
    for (v, columns) in region.spans() {
        for u in columns.clone() {
            let place = v * width + u;
            if !golden.taught.compared(place) {
                continue;
            }
            let at = grid.cell(u as i32, *v as i32);
            let cell = &mut cells[at];
            cell.pixels += 1;
            let sigma = golden.taught.sigma_mm(place);
            cell.variance += sigma * sigma;
            let height = golden.surface.height[place];
            let Some(point) = golden.triangulator.point(u, *v, height) else {
                continue;
            };
            cell.height += point.z;
            cell.x += point.x;
            cell.y += point.y;
            let ray = golden.triangulator.higher(point, 1.0) - point;
            cell.ray = [cell.ray[0] + ray.x, cell.ray[1] + ray.y];
            if u % stride != 0 || v % stride != 0 {
                continue;
            }
            let seen = golden.triangulator.camera().project(point);
            if let Some(facet) = seen.and_then(|seen| golden.facet(point, seen)) {
                let jacobian = facet.jacobian(point, about);
                for (sum, value) in cell.jacobian.iter_mut().zip(jacobian) {
                    *sum += value;
                }
                cell.area += facet.area;
                cell.normal += facet.normal_share();
                facets[at] += 1.0;
            }
        }
    }
    let all: f64 = facets.iter().sum();
    let total = cells.iter().map(|cell| cell.area).sum::<f64>();
    // A cell without a facet is taken to be flat, with pixels as large as those of the other cells.
    let (mean, flat) = (total / all.max(1.0), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    for (cell, facets) in cells.iter_mut().zip(facets) {
        let pixels = f64::from(cell.pixels);
        let each = 1.0 / pixels.max(1.0);
        (cell.height, cell.x, cell.y) = (cell.height * each, cell.x * each, cell.y * each);
        cell.ray = cell.ray.map(|sum| sum * each);
        if facets > 0.0 {
            cell.jacobian = cell.jacobian.map(|sum| sum / facets);
            cell.area *= pixels / facets;
            cell.normal /= facets;
        } else {
            cell.jacobian = flat;
            cell.area = pixels * mean;
            cell.normal = 1.0;
        }
    }
    cells
}

/// The cells of a region, over the box around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    left: usize,
    top: usize,
    side: usize,
    columns: usize,
    rows: usize,
}

/// A region with more cells than there are buffers for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{cells} squares of {side}x{side} pixels where at most {MAX_CELLS} are kept: smooth over more pixels or make the \
     region smaller"
)]
pub struct TooFine {
    /// Side of a cell in pixels.
    pub side: usize,
    /// How many there would be.
    pub cells: usize,
}

/// Cells of a region: 3 MB.
const MAX_CELLS: usize = 1 << 16;
/// A gauge that leaves the side of its cells to the grid has about so many.
const CELLS: usize = 1024;
/// A cell with fewer than this share of its square's pixels is left out, if the gauge asks for a
/// side.
const MIN_SUPPORT: f64 = 0.5;
/// Least side of such cells in pixels.
const MIN_SIDE: usize = 4;

impl Grid {
    /// Over a region's pixels; with a side of 0 the grid chooses one.
    ///
    /// # Errors
    /// If there are too many cells.
    pub fn over(region: &Region, side: usize) -> Result<Self, TooFine> {
        let (across, down) = region.bounds();
        let (width, height) = (across.len(), down.len());
        let side = match side {
            0 => {
                let side = libm::ceil(libm::sqrt((width * height) as f64 / CELLS as f64));
                (side as usize).max(MIN_SIDE)
            }
            side => side,
        };
        let (columns, rows) = (width.div_ceil(side).max(1), height.div_ceil(side).max(1));
        let cells = columns.saturating_mul(rows);
        if cells > MAX_CELLS {
            return Err(TooFine { side, cells });
        }
        Ok(Self {
            left: across.start,
            top: down.start,
            side,
            columns,
            rows,
        })
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Side of a cell in pixels.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Cells of a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The least number of measured pixels of a cell.
    pub fn least(&self) -> i64 {
        let side = self.side as f64;
        libm::ceil(MIN_SUPPORT * side * side) as i64
    }

    /// The middle of the square of a cell, in pixels of golden's frame.
    pub fn middle(&self, cell: usize) -> [f64; 2] {
        let half = (self.side - 1) as f64 / 2.0;
        let (along, down) = (cell % self.columns, cell / self.columns);
        [
            (self.left + along * self.side) as f64 + half,
            (self.top + down * self.side) as f64 + half,
        ]
    }

    /// The cell of a pixel of golden's frame; the nearest one for pixels beside the box.
    #[inline(always)]
    pub fn cell(&self, u: i32, v: i32) -> usize {
        let along = (u.max(self.left as i32) as usize - self.left) / self.side;
        let down = (v.max(self.top as i32) as usize - self.top) / self.side;
        down.min(self.rows - 1) * self.columns + along.min(self.columns - 1)
    }
}
