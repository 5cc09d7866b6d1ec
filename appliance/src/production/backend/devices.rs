//! Real devices: which of their libraries this build has, and how they are opened.

use super::OpenedHead;
use crate::config::{Backend, Config, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::Calibration;
use hal::frame::FrameFormat;
use hal::head::Head;
use hal::lines::{OutputLine, StartLine};
use hal::model::DeviceModel;
use hal::setup::{ControllerKind, LinesSetup, TriggerSetup};
use hal::trigger::{NoTrigger, Trigger};

/// The lines that are wired.
#[derive(Default)]
pub struct Wires {
    /// In: starts a cycle.
    pub start: Option<Box<dyn StartLine>>,
    /// Out: the station is working on a job.
    pub busy: Option<Box<dyn OutputLine>>,
    /// Out: the last part passed.
    pub ok: Option<Box<dyn OutputLine>>,
    /// Out: a start would be refused for another reason than being busy.
    pub fault: Option<Box<dyn OutputLine>>,
}

/// The device libraries, and whether this build has them.
const LIBRARIES: [(&str, bool); 4] = [
    ("libcamera", cfg!(feature = "libcamera")),
    ("kms", cfg!(feature = "kms")),
    ("gpio", cfg!(feature = "gpio")),
    ("i2c", cfg!(feature = "i2c")),
];

/// Checks that this build has the device libraries that a configuration needs.
///
/// # Errors
/// What it lacks, and how to build it (78).
pub fn built_for(config: &Config) -> Result<()> {
    built_for_head(&config.head)?;
    built_for_lines(&config.lines)
}

fn built_for_head(config: &HeadConfig) -> Result<()> {
    if config.backend != Backend::Rpi {
        return Ok(());
    }
    let mut needed = vec!["libcamera", "kms"];
    needed.extend(config.trigger.line.as_ref().map(|_| "gpio"));
    let controlled = config.projector.controller != ControllerKind::None;
    needed.extend(controlled.then_some("i2c"));
    built_with("head.backend = \"rpi\"", &needed, "rpi")
}

fn built_for_lines(setup: &LinesSetup) -> Result<()> {
    let needed: &[&str] = if setup.any() { &["gpio"] } else { &[] };
    built_with("lines", needed, "gpio")
}

fn built_with(key: &str, needed: &[&str], feature: &str) -> Result<()> {
    let lacked = LIBRARIES
        .iter()
        .filter(|(library, has)| !has && needed.contains(library));
    let lacked: Vec<&str> = lacked.map(|(library, _)| *library).collect();
    if lacked.is_empty() {
        return Ok(());
    }
    let message = format!(
        "{key}: this fringed was built without {}: build it with `cargo build --release --features {feature}`",
        lacked.join(" and ")
    );
    Exit::Configuration.fail(message)
}

/// Opens camera, projector and trigger. Their calibration is nominal, so nothing may be measured
/// with it.
///
/// # Errors
/// If this build has no such devices (78), or one of them is not there (69).
pub(super) fn rpi(config: &HeadConfig) -> Result<OpenedHead> {
    built_for_head(config)?;
    let head = head(config, trigger(&config.trigger)?)?;
    let calibration = nominal(head.camera_format(), head.projector_size())?;
    Ok(OpenedHead::new(head, calibration))
}

#[cfg(all(feature = "kms", feature = "libcamera"))]
fn head(config: &HeadConfig, trigger: Box<dyn Trigger>) -> Result<Head> {
    Ok(rpi::head(config, trigger)?)
}

/// Not reached: [`built_for_head`] refuses the head in this build.
#[cfg(not(all(feature = "kms", feature = "libcamera")))]
fn head(_: &HeadConfig, _: Box<dyn Trigger>) -> Result<Head> {
    Err(uncalibrated())
}

#[cfg(feature = "gpio")]
fn trigger(setup: &TriggerSetup) -> Result<Box<dyn Trigger>> {
    let Some(line) = &setup.line else {
        return Ok(Box::new(NoTrigger));
    };
    let prepare = || {
        // What it does not get, `fringed doctor` names.
        crate::system::computing::be_prompt(crate::system::host::Host::default().isolated_core());
    };
    match hal::gpio::Pulse::open(setup, line, prepare) {
        Ok(pulse) => Ok(Box::new(pulse)),
        Err(error) => Exit::Unavailable.fail(error),
    }
}

/// Without GPIO no trigger line is configured: [`built_for_head`] refuses one.
#[cfg(not(feature = "gpio"))]
fn trigger(_: &TriggerSetup) -> Result<Box<dyn Trigger>> {
    Ok(Box::new(NoTrigger))
}

/// A placeholder until the head is calibrated: lenses and poses like those of the reference head.
/// No height may be computed with it.
pub(super) fn nominal(camera: FrameFormat, projector: (u32, u32)) -> Result<Calibration> {
    let model = |width: u32, height: u32, aside_mm: f64| DeviceModel {
        fx: 1.6 * f64::from(width),
        fy: 1.6 * f64::from(width),
        cx: 0.5 * (f64::from(width) - 1.0),
        cy: 0.5 * (f64::from(height) - 1.0),
        distortion: [0.0; 5],
        // Looking down at the plane z = 0.
        rotation: [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0],
        translation_mm: [aside_mm, 0.0, 600.0],
    };
    Calibration::new(
        (camera.width, camera.height, camera.bit_depth),
        projector,
        (
            &model(camera.width, camera.height, 0.0),
            &model(projector.0, projector.1, 250.0),
        ),
        1.0,
    )
    .map_err(Exit::Unavailable.because("open the head"))
}

/// The failure of a head without a calibration.
pub(super) fn uncalibrated() -> Failure {
    let message = "the head is not calibrated: commission it on the page, under Head, or calibrate it with `fringed calibrate`";
    Failure::new(Exit::Missing, message)
}

/// Opens the lines that are named.
///
/// # Errors
/// If this build has no lines (78), or one of them cannot be used (69).
pub fn lines(setup: &LinesSetup) -> Result<Wires> {
    built_for_lines(setup)?;
    wired(setup)
}

/// Leaves every line that the station drives at its idle level: no trigger pulse, busy and ok off,
/// fault on. All of them are tried.
///
/// # Errors
/// If this build has no lines (78), or some of them cannot be used (69).
pub fn leave_lines_idle(config: &Config) -> Result<()> {
    let mut trigger = config.head.trigger.clone();
    // Other heads do not use the trigger's line.
    trigger
        .line
        .take_if(|_| config.head.backend != Backend::Rpi);
    if trigger.line.is_some() {
        built_with("head.trigger.line", &["gpio"], "gpio")?;
    }
    built_for_lines(&config.lines)?;
    let errors = unusable(&trigger, &config.lines);
    if errors.is_empty() {
        return Ok(());
    }
    Exit::Unavailable.fail(errors.join("; "))
}

#[cfg(feature = "gpio")]
fn unusable(trigger: &TriggerSetup, lines: &LinesSetup) -> Vec<String> {
    let errors = hal::gpio::leave_idle(trigger, lines).into_iter();
    errors.map(|error| error.to_string()).collect()
}

/// Without GPIO no line is configured: [`leave_lines_idle`] refuses those that are.
#[cfg(not(feature = "gpio"))]
fn unusable(_: &TriggerSetup, _: &LinesSetup) -> Vec<String> {
    Vec::new()
}

#[cfg(feature = "gpio")]
fn wired(setup: &LinesSetup) -> Result<Wires> {
    use hal::gpio::{LineError, Output, Start};
    use hal::lines::{OutputLine, StartLine};
    let output = |name: &Option<String>, idle| -> Result<_, LineError> {
        let open = |name: &String| Output::open(&setup.chip, name, setup.outputs_active_low, idle);
        let opened = name.as_ref().map(open).transpose()?;
        Ok(opened.map(|line| -> Box<dyn OutputLine> { Box::new(line) }))
    };
    let open = || {
        let start = setup.start.as_ref();
        let start = start.map(|name| Start::open(setup, name)).transpose()?;
        Ok(Wires {
            start: start.map(|line| -> Box<dyn StartLine> { Box::new(line) }),
            busy: output(&setup.busy, false)?,
            ok: output(&setup.ok, false)?,
            // A fault until the station says otherwise.
            fault: output(&setup.fault, true)?,
        })
    };
    open().map_err(|error: LineError| Failure::new(Exit::Unavailable, error))
}

/// Without GPIO no line is configured: [`lines`] refuses those that are.
#[cfg(not(feature = "gpio"))]
fn wired(_: &LinesSetup) -> Result<Wires> {
    Ok(Wires::default())
}

/// A head of a camera through libcamera and a projector on a display connector.
#[cfg(all(feature = "kms", feature = "libcamera"))]
mod rpi {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_says_what_it_lacks_and_how_to_get_it() {
        let failure = built_with("lines", &["gpio", "nothing"], "gpio");
        if cfg!(feature = "gpio") {
            assert_eq!(failure, Ok(()));
        } else {
            let failure = failure.unwrap_err();
            let message = failure.to_string();
            assert_eq!(failure.exit, Exit::Configuration);
            assert!(message.starts_with("lines: this fringed was built without gpio: "));
            assert!(message.ends_with("--features gpio`"), "{message}");
        }
    }

    #[test]
    fn lines_are_left_idle_where_some_are_named_and_the_trigger_only_on_a_real_head() {
        let mut config = Config::default();
        assert_eq!(leave_lines_idle(&config), Ok(()));
        config.head.trigger.chip = "no such chip".into();
        config.head.trigger.line = Some("GPIO17".into());
        assert_eq!(leave_lines_idle(&config), Ok(()));
        config.head.backend = Backend::Rpi;
        let trigger = leave_lines_idle(&config).unwrap_err().to_string();
        config.lines.chip = "no such chip".into();
        config.lines.fault = Some("GPIO5".into());
        let both = leave_lines_idle(&config).unwrap_err().to_string();
        if cfg!(feature = "gpio") {
            assert!(trigger.contains("GPIO17"), "{trigger}");
            assert!(both.contains("GPIO17") && both.contains("GPIO5"), "{both}");
        } else {
            assert!(trigger.contains("built without gpio"), "{trigger}");
        }
    }

    #[test]
    fn a_head_that_runs_by_itself_needs_no_gpio() {
        let mut config = HeadConfig {
            backend: Backend::Rpi,
            ..HeadConfig::default()
        };
        let lacks =
            |config: &HeadConfig| built_for_head(config).map_err(|failure| failure.to_string());
        let free = lacks(&config);
        config.trigger.line = Some("GPIO24".into());
        let triggered = lacks(&config);
        config.projector.controller = ControllerKind::Dlpc347x;
        let controlled = lacks(&config);
        assert_eq!(
            controlled.is_err_and(|said| said.contains("i2c")),
            !cfg!(feature = "i2c")
        );
        let says_gpio = |said: Result<(), String>| said.is_err_and(|said| said.contains("gpio"));
        assert!(!says_gpio(free));
        assert_eq!(says_gpio(triggered), !cfg!(feature = "gpio"));
    }
}
