//! What a gauge measures, and how its value and error follow from cells.
//!
//! A region is divided into square cells of pixels in golden's frame. A strip adds each measured
//! pixel to the cell that holds its taught coordinates. The height of a cell is its taught height
//! plus its pixels' mean deviation, so on a slope too it does not depend on which pixels of the
//! cell were measured. The values of all gauges but coverage, deviation and placement are worked
//! out from these heights and deviations.

mod cells;
mod coverage;
mod deviation;
mod extreme;
mod flatness;
mod kind;
mod level;
mod mean_height;
mod out_of_tolerance;
mod peak_to_valley;
mod placement;
mod rms_deviation;
mod step;
mod taught;
mod tilt;
mod unit;
mod volume;

pub use cells::{Cell, Grid, Sum, TooFine, cells};
pub use kind::{Basis, Evidence, Facts, Kind};
pub use taught::TaughtCell;
pub(super) use taught::taught_cells;
pub use unit::Unit;

use alloc::vec::Vec;

/// A mean over a square needs at least this share of its pixels.
pub(super) const MIN_SUPPORT: f64 = 0.5;

/// What a gauge found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The value in mm or as a share.
    pub value: f64,
    /// Its error over repeated measurements of the same part, 1 σ, where the noise is known.
    /// Golden's own noise adds the same error every time and is not in it.
    pub sigma: Option<f64>,
    /// Of a deviation, the magnitude that is expected on a good part with this noise: as an extreme
    /// it is not 0.
    pub expected: Option<f64>,
    /// The error that is the same in every measurement, and so not in σ (1 σ): the effect of
    /// golden's noise and of the calibration's error.
    pub systematic: f64,
    /// Of a deviation, the square that the value is the mean of.
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
    /// By how much errors of all heights of 1 mm, each with the sign that does most, change the
    /// value.
    pub lever: f64,
}

/// The table of all kinds. A row is the file of a kind and an example; the struct's name in snake
/// case is that of the kind in recipes.
macro_rules! kinds {
    ($($file:ident: $kind:ident { $($field:ident: $value:expr),* },)*) => {
        /// Every kind of gauge, each in its own file.
        pub mod kinds {
            pub use super::placement::Component;
            pub use super::tilt::Axis;
            $(pub use super::$file::$kind;)*
        }

        /// What a gauge measures. Heights are z of the part after its motion was taken back.
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(
            feature = "serde",
            derive(serde::Serialize, serde::Deserialize),
            serde(tag = "kind", rename_all = "snake_case")
        )]
        pub enum Measure {
            $(#[doc = concat!("See [`", stringify!($kind), "`](kinds::", stringify!($kind), ").")]
            $kind(kinds::$kind),)*
        }

        impl Measure {
            /// An example of every kind.
            pub fn examples() -> Vec<Self> {
                Vec::from([$(kinds::$kind { $($field: $value),* }.into(),)*])
            }

            /// What the gauge says of itself.
            pub fn facts(&self) -> Facts {
                self.kind().facts()
            }

            /// Its kind.
            pub fn kind(&self) -> &dyn Kind {
                match self {
                    $(Self::$kind(kind) => kind,)*
                }
            }
        }

        $(impl From<kinds::$kind> for Measure {
            fn from(kind: kinds::$kind) -> Self {
                Self::$kind(kind)
            }
        })*
    };
}

kinds! {
    deviation: Deviation { smoothing_px: 9 },
    rms_deviation: RmsDeviation { smoothing_px: 9 },
    out_of_tolerance: OutOfTolerance { smoothing_px: 9, tolerance_mm: 0.1 },
    coverage: Coverage {},
    mean_height: MeanHeight {},
    step: Step { from: "other".into() },
    flatness: Flatness { smoothing_px: 9 },
    peak_to_valley: PeakToValley { smoothing_px: 9 },
    tilt: Tilt { about: kinds::Axis::X },
    volume: Volume { above_mm: 8.0 },
    placement: Placement { component: kinds::Component::AboutZ },
}

#[cfg(test)]
mod tests;
