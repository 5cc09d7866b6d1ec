//! What a gauge measures, and how its value and error follow from cells.
//!
//! A gauge measures features of the part ([`feature`](super::feature)). Coverage, deviation and
//! placement are worked out from pixels and from the motion, the values of all other gauges from
//! the cells of a region, or from the geometry that is fitted to them.

mod angle;
mod coverage;
mod datum;
mod deviation;
mod diameter;
mod distance;
mod extreme;
mod flatness;
mod flush;
mod found;
mod gap;
mod kind;
mod length;
mod mean_height;
mod out_of_tolerance;
mod parameter;
mod peak_to_valley;
mod placement;
mod position;
mod propagate;
mod radius;
mod reading;
mod region;
mod rms_deviation;
mod roundness;
mod step;
mod straightness;
mod tilt;
mod unit;
mod volume;
mod width;
mod x;
mod y;
mod z;

pub use datum::makes_datum;
pub use kind::{Basis, Declared, Evidence, Facts, Kind, MAX_PLACES};
pub use parameter::{Domain, Parameter, Value};
pub(super) use propagate::{Characteristic, MAX_DATUMS, Propagated, Sensitive, SensitivePlane};
pub(super) use reading::MIN_SUPPORT;
pub(super) use reading::OfRim;
pub use reading::{FoundValue, Reading, Square};
pub use unit::Unit;

use crate::inspect::feature::{FeatureKind, Geometry};
use alloc::vec::Vec;

/// The table of all kinds. A row is the file of a kind and an example, whose parameters are the
/// defaults; the struct's name in snake
/// case is that of the kind in recipes.
macro_rules! kinds {
    ($($file:ident: $kind:ident { $($field:ident: $value:expr),* },)*) => {
        /// Every kind of gauge, each in its own file.
        pub mod kinds {
            pub use crate::inspect::gauge::kind::Component;
            pub use crate::inspect::gauge::radius::Side;
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

            /// Its name in recipes.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => stringify!($file),)*
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
    x: X {},
    y: Y {},
    z: Z {},
    position: Position { nominal: [0.0, 0.0] },
    diameter: Diameter {},
    length: Length {},
    width: Width {},
    distance: Distance {},
    angle: Angle {},
    roundness: Roundness {},
    straightness: Straightness {},
    found: Found {},
    gap: Gap {},
    flush: Flush {},
    radius: Radius { side: kinds::Side::Left },
}

impl Measure {
    /// Whether it has a value of features of these kinds, as many as it takes.
    pub fn measures(&self, of: &[FeatureKind]) -> bool {
        let has_value = |of: Vec<Geometry>| self.kind().value(&of).is_some();
        self.facts().basis != Basis::Geometry || Geometry::examples(of).is_some_and(has_value)
    }

    /// What teaching proposes for the shape of the whole part, over squares of so many pixels.
    pub fn of_shape(smoothing_px: usize) -> Self {
        kinds::Deviation { smoothing_px }.into()
    }

    /// What teaching proposes for how much of a region is seen.
    pub fn of_seen() -> Self {
        kinds::Coverage {}.into()
    }
}

#[cfg(test)]
mod tests;
