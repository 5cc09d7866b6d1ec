//! A head of a camera through libcamera and a projector on a display connector.

use crate::config::HeadConfig;
use crate::system::host::libcamera_patience;
use hal::clock::Monotonic;
#[cfg(feature = "i2c")]
use hal::dlpc347x::{Controlled, Controller, bus::Bus};
use hal::error::Error;
use hal::head::{Head, Timing};
use hal::libcamera::{LibCamera, Settings};
use hal::projector::Projector;
#[cfg(feature = "i2c")]
use hal::setup::ControllerKind;
use hal::setup::ProjectorSetup;
use hal::trigger::Trigger;
#[cfg(feature = "i2c")]
use std::time::Duration;

/// Opens camera and projector. The times between them are set later, from the calibration.
///
/// # Errors
/// The error of the device that is not there.
pub fn head(config: &HeadConfig, trigger: Box<dyn Trigger>) -> Result<Head, Error> {
    let starts = config.trigger.starts();
    let settings = Settings {
        stays_on: libcamera_patience() / 2,
        ..Settings::new(&config.camera, starts)
    };
    let camera = LibCamera::open(settings)?;
    let display = hal::kms::open(&config.projector)?;
    let clock = Monotonic::new(vec![camera.ready()?, display.descriptor()?]);
    let projector = controlled(&config.projector, Box::new(display))?;
    Ok(Head::new(
        Box::new(camera),
        projector,
        trigger,
        Box::new(clock),
        Timing::unproven(starts),
    ))
}

/// How often the controller of the projector is asked whether it still streams patterns.
#[cfg(feature = "i2c")]
const WATCHED: Duration = Duration::from_secs(1);

/// The projector, whose controller is set up for patterns if one is configured.
#[cfg(feature = "i2c")]
fn controlled(
    setup: &ProjectorSetup,
    display: Box<dyn Projector>,
) -> Result<Box<dyn Projector>, Error> {
    if setup.controller == ControllerKind::None {
        return Ok(display);
    }
    let bus = Bus::open(&setup.controller_bus)?;
    let controller = Controller::open(bus, setup.controller_address, setup.led)?;
    let projector = Controlled::new(display, controller, setup.led_current, WATCHED)?;
    Ok(Box::new(projector))
}

/// Without I²C no controller is configured: a build without it refuses one.
#[cfg(not(feature = "i2c"))]
fn controlled(
    _: &ProjectorSetup,
    display: Box<dyn Projector>,
) -> Result<Box<dyn Projector>, Error> {
    Ok(display)
}
