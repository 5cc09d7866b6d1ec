//! A head of a camera through libcamera and a projector on a display connector.

use crate::config::HeadConfig;
use hal::camera::Starts;
use hal::clock::Monotonic;
use hal::error::Error;
use hal::head::{Head, Timing};
use hal::libcamera::{LibCamera, Settings};
use hal::trigger::Trigger;

/// Refreshes that each pattern stays in view: an exposure of one whole refresh fits two from wherever it starts.
const HOLD: u32 = 2;

/// Opens camera and projector. The delays between them are set later, from the calibration.
///
/// # Errors
/// That of the device that is not there.
pub fn head(config: &HeadConfig, trigger: Box<dyn Trigger>) -> Result<Head, Error> {
    let starts = match config.trigger.line {
        Some(_) => Starts::OnTrigger,
        None => Starts::ByItself,
    };
    let camera = LibCamera::open(Settings::new(&config.camera, starts))?;
    let projector = hal::kms::open(&config.projector)?;
    let clock = Monotonic::new(vec![camera.ready()?, projector.descriptor()?]);
    let timing = Timing {
        hold: HOLD,
        ..Timing::default()
    };
    Ok(Head::new(
        Box::new(camera),
        Box::new(projector),
        trigger,
        Box::new(clock),
        timing,
    ))
}
