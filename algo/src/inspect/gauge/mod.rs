//! What a gauge measures, and how its value and error follow from cells.
//!
//! A region is divided into square cells of pixels in golden's frame. A strip adds each measured pixel to the cell that holds its
//! taught coordinates. The height of a cell is its taught height plus its pixels' mean deviation, so on a slope too it does not
//! depend on which of them were measured. The values of all gauges but coverage, deviation and placement are worked out from
//! these heights and deviations.

mod cells;
mod extreme;
mod level;
mod taught;

pub use cells::{Cell, Grid, Sum, TooFine, cells};
pub use extreme::{flatness, peak_to_valley, rms, share_outside};
pub use level::{Weights, found, mean, step, tilt, volume};
pub use taught::TaughtCell;
pub(super) use taught::taught_cells;

/// A mean over a square needs at least this share of its pixels.
pub(super) const MIN_SUPPORT: f64 = 0.5;

/// What a gauge found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The value in mm or as a share.
    pub value: f64,
    /// Its error over repeated measurements of the same part, 1 σ, where the noise is known. Golden's own noise adds the same error
    /// every time and is not in it.
    pub sigma: Option<f64>,
    /// What its magnitude is expected to be on a good part with this noise: of a deviation, which is an extreme, and so not 0.
    pub expected: Option<f64>,
    /// What is the same in every measurement and so not in σ, 1 σ: the effect of golden's noise and of the calibration's error.
    pub systematic: f64,
    /// Where the value is, of a deviation.
    pub square: Option<Square>,
}

/// A square of camera pixels of the measured frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// The column of its middle.
    pub column: usize,
    /// The row of its middle.
    pub row: usize,
    /// Pixels along each side.
    pub side: usize,
}

/// A value with the parts of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The value.
    pub value: f64,
    /// Variance by the noise of its pixels.
    pub pixels: f64,
    /// Variance by the error of the part's motion.
    pub motion: f64,
    /// By how much errors of all heights of 1 mm, each with the sign that does most, change the value.
    pub lever: f64,
}

/// The axes that a plane may be tilted about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// x.
    X,
    /// y.
    Y,
}

/// What a gauge measures. Heights are z of the part after its motion was taken back; `side` is that of the squares that
/// are averaged over, in camera pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measure {
    /// The mean weighted deviation from golden along its normal of largest magnitude, positive outwards, of the squares of `side` pixels about
    /// every pixel, mm (profile of a surface, ISO 1101:2017): single noisy pixels do not decide. Squares of which less than half can be compared do not count.
    Deviation {
        /// Odd; 1 = single pixels.
        side: usize,
    },
    /// The root of the mean square of the cells' deviations from golden along its normal, mm.
    RmsDeviation {
        /// Of the cells.
        side: usize,
    },
    /// The share of the cells that deviate from golden along its normal by more than a tolerance.
    OutOfTolerance {
        /// Of the cells.
        side: usize,
        /// In mm.
        tolerance: f64,
    },
    /// The share of the region that has a height.
    Coverage,
    /// The mean height, mm.
    MeanHeight,
    /// The mean height less that of a second region, mm.
    Step,
    /// The distance between the two planes parallel to the least-squares plane that enclose all cells, mm: peak-to-valley
    /// flatness deviation FLTt about the reference plane LSPL of ISO 12781-1.
    Flatness {
        /// Of the cells.
        side: usize,
    },
    /// The highest less the lowest cell, mm.
    PeakToValley {
        /// Of the cells.
        side: usize,
    },
    /// The angle of the least-squares plane about an axis, degrees, right-handed; 0 is parallel to the plane z = 0.
    Tilt(Axis),
    /// The volume between the surface and the plane z = `above`, mm³, negative below it.
    Volume {
        /// In mm.
        above: f64,
    },
    /// A component of the part's motion: 0 to 2 shift along x, y, z, mm; 3 to 5 turn about x, y, z, degrees.
    Placement(usize),
}

impl Measure {
    /// The side of its cells, if it is worked out from cells; 0 if the grid may choose it.
    pub(super) fn cell_side(&self) -> Option<usize> {
        match *self {
            Self::RmsDeviation { side }
            | Self::OutOfTolerance { side, .. }
            | Self::Flatness { side }
            | Self::PeakToValley { side } => Some(side.max(1)),
            Self::MeanHeight | Self::Step | Self::Tilt(_) | Self::Volume { .. } => Some(0),
            Self::Deviation { .. } | Self::Coverage | Self::Placement(_) => None,
        }
    }
}

#[cfg(test)]
mod tests;
