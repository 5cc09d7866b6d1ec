//! Stage 5: the planes of features, the contours in them, the joints of sections, and the readings
//! of gauges with their errors, from the sums of all strips.

pub mod contours;
pub mod deviation;
pub mod evaluation;
pub mod findings;
pub mod joints;
pub mod planes;
pub mod reading;
pub mod uncertainty;
