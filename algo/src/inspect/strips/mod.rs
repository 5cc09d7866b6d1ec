//! From frames to the readings of gauges in one pass over strips of rows.
//!
//! # Idea
//! A strip works on one row at a time, so that everything stays in the processor's cache. Each row
//! goes through the stages
//!
//! 1. **decode** (`measure/decode`): frames → absolute phase Φ, modulation, trust;
//! 2. **height** (`measure/height`): Φ → height offset z − z₀ above the golden surface, on the pixel's own
//!    ray;
//! 3. **align** (`align`): takes the part's motion back by the pose field
//!    (`align/pose`): the pixel's taught coordinates, and its deviation from golden there, in height and,
//!    weighted, along golden's normal ([`normal_shares`](super::normal_shares));
//! 4. **accumulate** (`accumulate`): counts, the sums of the gauges' cells
//!    ([`feature`](super::feature)), and the square with the largest mean deviation along the normal;
//!    for the squares, the rows before this one are kept (`RecentRows`);
//! 5. **gauge** (`readings`): after all strips,
//!    the planes of features, the contours in them, readings and their errors from these sums.
//!
//! Before that, where the part's motion is wanted, some rows go through stages 1 and 2 and a few
//! points of each are kept: the motion is found from these, in the order of the rows, and where
//! they leave it open, by the picture without fringes (`production/inspection`).
//!
//! What a stage has to know beforehand is worked out once, in a plan of its own: [`golden`] (what all
//! of them count from and compare with), `PhasePlan`, `Alignment`, `Gauges`, `ReadingPlan`. A folder
//! is a stage and imports only from those before it: `golden`, `measure` (1 and 2), `align`, `pair`
//! (phases from two frames), `accumulate`, `readings`, and `production`, which knows all of them and
//! takes rows through the stages.
//!
//! # Shapes and units
//! No map of the whole frame is written, except those that are asked for (`Maps`). Strips overlap
//! by half of the largest square, so each finds all squares about its own rows. Offsets and
//! deviations are in nm.
//!
//! # Accuracy
//! All sums are whole numbers, so the findings do not depend on the number of strips or threads.
//! They are those of a comparison of whole maps:
//! `strips_find_what_the_comparison_of_whole_maps_finds`,
//! `strips_weigh_deviations_as_the_comparison_of_whole_maps_does`.

mod accumulate;
mod align;
mod golden;
mod measure;
mod pair;
mod production;
mod readings;

pub use accumulate::{Gauge, MAX_FEATURES, MAX_GAUGES, Unmeasurable};
pub use measure::Input;
pub use pair::PairBuffers;
pub use production::drawn::{Drawing, Drawn, Place, Profile};
pub use production::inspection::PairPlaced;
pub use production::plan::{Parts, Production};
pub use production::strip::{Maps, Strips};
pub use readings::CalibrationUncertainty;
pub use readings::{Findings, Missing, Skipped};
pub use readings::{FoundFeature, GoldenSignal, Levels, Lost, SeenRim, Signal};
