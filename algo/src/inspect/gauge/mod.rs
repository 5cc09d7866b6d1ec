//! What a gauge measures, and how its value and error follow from cells.
//!
//! A gauge measures features of the part ([`feature`](super::feature)). Coverage, deviation and
//! placement are worked out from pixels and from the motion, the values of all other gauges from
//! the cells of a region, or from the geometry that is fitted to them.

mod angle;
mod component;
mod coverage;
mod deviation;
mod distance;
mod extreme;
mod flatness;
mod kind;
mod mean_height;
mod out_of_tolerance;
mod peak_to_valley;
mod placement;
mod propagate;
mod reading;
mod rms_deviation;
mod step;
mod tilt;
mod unit;
mod volume;
mod z;

pub use kind::{Basis, Evidence, Facts, Kind, MAX_PLACES};
pub(super) use propagate::{Sensitive, propagate};
pub(super) use reading::MIN_SUPPORT;
pub use reading::{Found, Reading, Square};
pub use unit::Unit;

use alloc::vec::Vec;

/// The table of all kinds. A row is the file of a kind and an example; the struct's name in snake
/// case is that of the kind in recipes.
macro_rules! kinds {
    ($($file:ident: $kind:ident { $($field:ident: $value:expr),* },)*) => {
        /// Every kind of gauge, each in its own file.
        pub mod kinds {
            pub use crate::inspect::gauge::component::Component;
            pub use crate::inspect::gauge::tilt::Axis;
            $(pub use crate::inspect::gauge::$file::$kind;)*
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

            /// The same kind with the other values of the field that its unit depends on.
            pub fn others(&self) -> Vec<Self> {
                match self {
                    $(Self::$kind(kind) => kind.others().into_iter().map(Self::from).collect(),)*
                }
            }

            /// What it says of itself.
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
    step: Step {},
    flatness: Flatness { smoothing_px: 9 },
    peak_to_valley: PeakToValley { smoothing_px: 9 },
    tilt: Tilt { about: kinds::Axis::X },
    volume: Volume { above_mm: 8.0 },
    placement: Placement { component: kinds::Component::AboutZ },
    z: Z {},
    distance: Distance {},
    angle: Angle {},
}

#[cfg(test)]
mod tests;
