//! From frames to the readings of gauges in one pass over strips of rows.
//!
//! # Idea
//! A strip works on one row at a time, so that everything stays in the processor's cache. Each row
//! goes through the stages
//!
//! 1. **decode** (`decode`): frames → absolute phase Φ, modulation, trust;
//! 2. **height** (`height`): Φ → height offset z − z₀ above the golden surface, on the pixel's own
//!    ray;
//! 3. **align** (`coordinates`, `displaced`): takes the part's motion back by the pose field
//!    (`pose`): the pixel's taught coordinates, and its deviation from golden there, in height and,
//!    weighted, along golden's normal ([`normal_shares`](super::normal_shares));
//! 4. **accumulate** (`counts`, `coverage`, `squares`): counts, the sums of the gauges' cells
//!    ([`feature`](super::feature)), and the square with the largest mean deviation along the normal;
//!    for the squares, the rows before this one are kept (`recent`);
//! 5. **gauge** (`fits`, `bend`, `contours`, `findings`, `geometric`, `deviation`, `uncertainty`): after all strips,
//!    the planes of features, the contours in them, readings and their errors from these sums.
//!
//! Before that, where the part's motion is wanted, some rows go through stages 1 and 2 and a few
//! points of each are kept: the motion is found from these, in the order of the rows, and where
//! they leave it open, by the picture without fringes (`steer`).
//!
//! What a stage has to know beforehand is worked out once, in a plan of its own: `Golden` (what all
//! of them count from and compare with), `PhasePlan`, `Alignment`, `Gauges`, `ErrorBudget`. All
//! plans together are [`Production`]; only these files know all of them: `strip` and `inspection`,
//! which take rows through the stages, `sections` for the points of a row, `findings` and `geometric`
//! for the sums of all strips, `steer`, `pair` and `rendered` for phases from elsewhere.
//!
//! # Shapes and units
//! No map of the whole frame is written, except those that are asked for (`maps`). Strips overlap
//! by half of the largest square, so each finds all squares about its own rows. Offsets and
//! deviations are in nm.
//!
//! # Accuracy
//! All sums are whole numbers, so the findings do not depend on the number of strips or threads.
//! They are those of a comparison of whole maps:
//! `strips_find_what_the_comparison_of_whole_maps_finds`,
//! `strips_weigh_deviations_as_the_comparison_of_whole_maps_does`.

mod bend;
mod contours;
mod coordinates;
mod counts;
mod coverage;
mod decode;
mod deviation;
mod displaced;
mod drawn;
mod findings;
mod fits;
mod gauges;
mod geometric;
mod golden;
mod ground;
mod height;
mod inspection;
mod maps;
mod near;
mod pair;
mod plan;
mod pose;
mod recent;
mod rendered;
mod sections;
mod spans;
mod square_means;
mod squares;
mod steer;
mod strip;
mod uncertainty;

pub use contours::{FoundFeature, GoldenSignal, Levels, Lost, SeenRim, Signal};
pub use decode::Input;
pub use drawn::{Drawing, Drawn, Place, Profile};
pub use findings::{Findings, Missing, Skipped};
pub use gauges::{Gauge, MAX_FEATURES, MAX_GAUGES, Unmeasurable};
pub use maps::Maps;
pub use pair::{PairBuffers, PairPlaced};
pub use plan::{Parts, Production};
pub use strip::Strips;
pub use uncertainty::CalibrationError;
