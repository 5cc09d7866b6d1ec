//! The gauges of a production: where each measures what, and what is planned of that beforehand.

use super::coverage::Threshold;
use super::spans::hull;
use super::squares::extreme;
use crate::geometry::Vector;
use crate::inspect::align::{Alignment, GoldenSurface};
use crate::inspect::gauge::{Grid, Measure, TaughtCell, TooFine, taught_cells};
use crate::inspect::region::Region;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// A gauge: where it measures what.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    /// Where; empty for a placement.
    pub region: Region,
    /// The region that a step starts from.
    pub from: Option<Region>,
    /// What.
    pub measure: Measure,
}

/// Gauges that a recipe may have.
pub const MAX_GAUGES: usize = 64;

/// Gauges that cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unmeasurable {
    /// More than [`MAX_GAUGES`].
    #[error("{gauges} gauges where at most {MAX_GAUGES} are measured")]
    TooMany {
        /// How many.
        gauges: usize,
    },
    /// A smoothing over so many pixels that sums of heights over them could overflow.
    #[error("a smoothing over {side}x{side} pixels is too wide for the working range")]
    TooSmooth {
        /// Side of the square in pixels.
        side: usize,
    },
    /// More cells than are kept.
    #[error("{0}")]
    TooFine(TooFine),
}

/// The cells of a gauge's region.
#[derive(Debug)]
pub struct Patch {
    /// Which of the regions.
    pub region: usize,
    pub grid: Grid,
    pub taught: Vec<TaughtCell>,
}

/// The squares of one side that a gauge of deviation looks at.
#[derive(Clone, Copy, Debug)]
pub struct SquaresOf {
    /// Which gauge.
    pub gauge: usize,
    /// The side of its squares where it may be the smallest.
    pub smallest: usize,
    pub side: usize,
    /// Whether there are places with squares of another side.
    pub partly: bool,
}

/// A side of squares, and where there are some of this side: the box around their middles.
#[derive(Clone, Debug)]
pub struct Side {
    pub side: usize,
    pub rows: Range<usize>,
    pub columns: Range<usize>,
}

impl Side {
    /// The rows or columns that squares about the middles reach, of a frame with any.
    pub fn reached(&self, middles: &Range<usize>) -> Range<usize> {
        let half = self.side / 2;
        middles.start.saturating_sub(half)..middles.end + half
    }

    /// Includes another box.
    fn widen(&mut self, rows: Range<usize>, columns: Range<usize>) {
        self.rows = hull(self.rows.clone(), rows);
        self.columns = hull(self.columns.clone(), columns);
    }
}

/// All gauges, and what was planned of them.
#[derive(Debug)]
pub struct Gauges {
    pub list: Vec<Gauge>,
    /// One per gauge, then those that steps start from.
    pub regions: Vec<Region>,
    /// The cells of all gauges that are worked out from cells.
    pub patches: Vec<Patch>,
    /// Per gauge which patches are its own: one, two of a step, or none.
    pub patches_of: Vec<Range<usize>>,
    /// The squares of all gauges of deviation, gauge by gauge.
    pub squares: Vec<SquaresOf>,
    /// The sides of these squares, each once.
    pub sides: Vec<Side>,
    /// What the uncertainty of a coverage follows from.
    pub threshold: Threshold,
}

impl Gauges {
    /// Plans gauges. Deviations are at most `span_nm`; the motion of a part turns it as `alignment`
    /// says.
    pub fn new(
        list: Vec<Gauge>,
        golden: GoldenSurface<'_>,
        alignment: Option<&Alignment>,
        span_nm: f64,
        threshold: Threshold,
    ) -> Result<Self, Unmeasurable> {
        if list.len() > MAX_GAUGES {
            let gauges = list.len();
            return Err(Unmeasurable::TooMany { gauges });
        }
        let (mut squares, mut sides) = (Vec::new(), Vec::new());
        for (at, gauge) in list.iter().enumerate() {
            let Some(smallest) = gauge.measure.facts().basis.square_side() else {
                continue;
            };
            let all = golden.taught.sides(smallest);
            for &side in &all {
                if !extreme::fits(side, span_nm) {
                    return Err(Unmeasurable::TooSmooth { side });
                }
                let partly = all.len() > 1;
                squares.push(SquaresOf {
                    gauge: at,
                    smallest,
                    side,
                    partly,
                });
                let known = sides.iter().position(|known: &Side| known.side == side);
                let known = known.unwrap_or_else(|| {
                    sides.push(Side {
                        side,
                        rows: 0..0,
                        columns: 0..0,
                    });
                    sides.len() - 1
                });
                let size = (golden.surface.width, golden.surface.height.len());
                let own = |place: &usize| golden.taught.side(*place, smallest) == side;
                match partly {
                    true => (0..size.1).filter(own).for_each(|place| {
                        let (row, column) = (place / size.0, place % size.0);
                        sides[known].widen(row..row + 1, column..column + 1);
                    }),
                    false => sides[known].widen(0..size.1 / size.0.max(1), 0..size.0),
                }
            }
        }
        let about = alignment.map_or((Vector::default(), 1.0), |a| (a.centre, a.radius));
        let mut regions: Vec<Region> = list.iter().map(|gauge| gauge.region.clone()).collect();
        let (mut patches, mut patches_of) = (Vec::new(), Vec::new());
        for (at, gauge) in list.iter().enumerate() {
            let first = patches.len();
            let mut places = vec![at];
            if let Some(from) = &gauge.from {
                places.push(regions.len());
                regions.push(from.clone());
            }
            if let Some(side) = gauge.measure.facts().basis.cell_side() {
                for region in places {
                    let grid = Grid::over(&regions[region], side).map_err(Unmeasurable::TooFine)?;
                    patches.push(Patch {
                        region,
                        grid,
                        taught: taught_cells(&grid, &regions[region], golden, about),
                    });
                }
            }
            patches_of.push(first..patches.len());
        }
        Ok(Self {
            list,
            regions,
            patches,
            patches_of,
            squares,
            sides,
            threshold,
        })
    }

    /// The largest side of a square; none if there is no deviation.
    pub fn largest_side(&self) -> Option<usize> {
        self.sides.iter().map(|of| of.side).max()
    }
}
