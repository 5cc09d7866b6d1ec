//! Measurements of a head: the doctor judges them, calibration stores them.
//!
//! Pictures are taken long after each flip ([`Lit`], [`pictures`]), so their measurements need no
//! timing. The measurements of time itself need no calibration: what the camera's stamps mark
//! ([`Stamps`]), how soon it can be triggered again ([`pace`]), and when the light of a flip comes
//! ([`Delay`]).

mod content;
mod contrast;
mod delay;
mod drift;
mod first_light;
mod noise;
mod pace;
mod pictures;
mod plate;
mod response;
mod stamps;

pub use content::{MOST_BY_CONTENT, by_content};
pub use contrast::{PITCHES, by_pitch, contrast};
pub use delay::Delay;
pub use drift::{CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX};
pub use first_light::{LONGEST_DARK, first_light};
pub use noise::noise;
pub use pace::{Spaced, pace};
pub use pictures::{
    LEAST_BRIGHT, LEAST_LIT, Lit, MOST_SATURATED, SETTLE, load_black_and_white, median, picture,
    pictures,
};
pub use plate::{PITCH as PLATE_PITCH, ReferencePlane, plate};
pub use response::{lights, response};
pub use stamps::{MOST_LATE, Stamps};

use hal::head::Head;
use std::time::Duration;

/// Longest wait for flips and frames beyond their planned time.
pub const PATIENCE: Duration = Duration::from_millis(500);

/// How many refreshes of the projector a time takes, rounded up.
pub fn refreshes(head: &Head, time: Duration) -> u32 {
    let whole = time.as_nanos().div_ceil(head.refresh().as_nanos().max(1));
    u32::try_from(whole).unwrap_or(u32::MAX)
}
