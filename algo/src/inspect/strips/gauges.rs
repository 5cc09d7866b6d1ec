//! The gauges of a production: where each measures what, and what is planned of that beforehand.

use super::coverage::Threshold;
use super::squares::extreme;
use crate::geometry::Vector;
use crate::inspect::Region;
use crate::inspect::align::{Alignment, GoldenSurface};
use crate::inspect::gauge::{Grid, Measure, TaughtCell, TooFine, taught_cells};
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
pub const MAX_GAUGES: usize = 16;

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
pub(super) struct Patch {
    /// Which of the regions.
    pub region: usize,
    pub grid: Grid,
    pub taught: Vec<TaughtCell>,
}

/// All gauges, and what was planned of them.
#[derive(Debug)]
pub(super) struct Gauges {
    pub list: Vec<Gauge>,
    /// One per gauge, then those that steps start from.
    pub regions: Vec<Region>,
    /// The cells of all gauges that are worked out from cells.
    pub patches: Vec<Patch>,
    /// Per gauge which patches are its own: one, two of a step, or none.
    pub patches_of: Vec<Range<usize>>,
    /// The sides of the squares of deviations, each once.
    pub sides: Vec<usize>,
    /// What the uncertainty of a coverage follows from.
    pub threshold: Threshold,
}

impl Gauges {
    /// Plans gauges. Deviations are at most `span_nm`; the motion of a part turns it as `alignment` says.
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
        let mut sides = Vec::new();
        for gauge in &list {
            if let Measure::Deviation { side } = gauge.measure
                && !sides.contains(&side)
            {
                if !extreme::fits(side, span_nm) {
                    return Err(Unmeasurable::TooSmooth { side });
                }
                sides.push(side);
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
            if let Some(side) = gauge.measure.cell_side() {
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
            sides,
            threshold,
        })
    }

    /// The largest side of a square; none if there is no deviation.
    pub fn largest_side(&self) -> Option<usize> {
        self.sides.iter().copied().max()
    }
}
