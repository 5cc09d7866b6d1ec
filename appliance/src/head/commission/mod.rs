//! Commissioning: the steps from a bare head to a complete calibration. Each measures what the
//! doctor or `fringed calibrate` measures, says what is wrong and what to do, and can be repeated
//! alone; its result is kept in `commissioning.json`.
//!
//! [`Step::run`] works on the head and on the [`Commissioning`] that is kept; who owns both, and
//! who asks for steps, is decided elsewhere.

mod completing;
mod file;
mod laid;
mod outcome;
mod poses;
mod step;

pub use file::{Commissioning, FILE, Models};
pub use laid::Laid;
pub use outcome::Outcome;
pub use poses::{PoseFile, Solving, pose_name};
pub use step::{Name, Step, Subject};
