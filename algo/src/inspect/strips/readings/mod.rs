//! Stage 5: the planes of features, the contours in them, the joints of sections, and the readings
//! of gauges with their errors, from the sums of all strips.

mod contours;
mod deviation;
mod evaluation;
mod findings;
mod joints;
mod planes;
mod reading;
mod uncertainty;

pub use contours::{
    ContourFit, Contours, ExpectedContour, FoundFeature, GoldenSignal, Known, Levels, Lost,
    REACH_MM, SeenRim, Signal, moved,
};
pub use deviation::SquareNoise;
pub use evaluation::{Evaluation, PartFeatures, ReadingPlan};
pub use findings::{Findings, Missing, Skipped};
pub use planes::PlaneFit;
pub use uncertainty::{CalibrationUncertainty, ErrorBudget};
