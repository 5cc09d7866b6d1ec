//! What can be measured on a head: the doctor judges it, calibration keeps it.
//!
//! Every measurement takes its pictures long after each flip ([`Lit`], [`pictures`]), but for the two that are about time
//! itself: what the camera's stamps mark ([`Stamps`]), and when a flip's light comes ([`Delay`]). Those need no calibration.

mod contrast;
mod delay;
mod noise;
mod pictures;
mod plate;
mod response;
mod stamps;

pub use contrast::{PITCHES, contrast};
pub use delay::Delay;
pub use noise::noise;
pub use pictures::{LEAST_BRIGHT, LEAST_LIT, Lit, MOST_SATURATED, SETTLE, counts, pictures};
pub use plate::{PITCH as PLATE_PITCH, PlateError, plate};
pub use response::{lights, response};
pub use stamps::Stamps;

use std::time::Duration;

/// Longest wait beyond the plan for flips and frames that do not come.
pub const PATIENCE: Duration = Duration::from_millis(500);
