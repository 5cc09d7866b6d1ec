//! Real devices: what this build has of their libraries, and how they are opened.

use super::Opened;
use crate::config::{Backend, Config, HeadConfig};
use crate::error::{Exit, Failure};
use crate::lines::Wires;
use hal::setup::LinesSetup;

/// The libraries of devices, and whether this build has them.
const LIBRARIES: [(&str, bool); 3] = [
    ("libcamera", false),
    ("kms", false),
    ("gpio", cfg!(feature = "gpio")),
];

/// Whether this build has what a configuration needs.
///
/// # Errors
/// What it lacks, and how it is built with it (78).
pub fn built_for(config: &Config) -> Result<(), Failure> {
    built_for_head(&config.head)?;
    built_for_lines(&config.lines)
}

fn built_for_head(config: &HeadConfig) -> Result<(), Failure> {
    let needed: &[&str] = match (config.backend, &config.trigger.line) {
        (Backend::Sim | Backend::Replay, _) => &[],
        (Backend::Rpi, None) => &["libcamera", "kms"],
        (Backend::Rpi, Some(_)) => &["libcamera", "kms", "gpio"],
    };
    built_with("head.backend = \"rpi\"", needed, "rpi")
}

fn built_for_lines(setup: &LinesSetup) -> Result<(), Failure> {
    let needed: &[&str] = if setup.any() { &["gpio"] } else { &[] };
    built_with("lines", needed, "gpio")
}

fn built_with(key: &str, needed: &[&str], feature: &str) -> Result<(), Failure> {
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
    Err(Failure::new(Exit::Configuration, message))
}

/// Opens camera, projector and trigger.
///
/// # Errors
/// If this build has no such devices, or one of them is not there.
pub(super) fn rpi(config: &HeadConfig) -> Result<Opened, Failure> {
    built_for_head(config)?;
    Err(uncalibrated())
}

/// The failure of a head of which nothing is known yet.
pub(super) fn uncalibrated() -> Failure {
    let message = "the head is not calibrated: calibrate it with `fringed calibrate`";
    Failure::new(Exit::Missing, message)
}

/// Opens the lines that are named.
///
/// # Errors
/// If this build has no lines (78), or one of them cannot be used (69).
pub fn lines(setup: &LinesSetup) -> Result<Wires, Failure> {
    built_for_lines(setup)?;
    wired(setup)
}

#[cfg(feature = "gpio")]
fn wired(setup: &LinesSetup) -> Result<Wires, Failure> {
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
            // Without a station nothing is measured.
            fault: output(&setup.fault, true)?,
        })
    };
    open().map_err(|error: LineError| Failure::new(Exit::Unavailable, error.to_string()))
}

/// None is named: [`lines`] has refused those that are.
#[cfg(not(feature = "gpio"))]
fn wired(_: &LinesSetup) -> Result<Wires, Failure> {
    Ok(Wires::default())
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
            let Failure { exit, message } = failure.unwrap_err();
            assert_eq!(exit, Exit::Configuration);
            assert!(message.starts_with("lines: this fringed was built without gpio: "));
            assert!(message.ends_with("--features gpio`"), "{message}");
        }
    }

    #[test]
    fn a_head_that_runs_by_itself_needs_no_gpio() {
        let mut config = HeadConfig {
            backend: Backend::Rpi,
            ..HeadConfig::default()
        };
        let lacks = |config: &HeadConfig| built_for_head(config).map_err(|failure| failure.message);
        let free = lacks(&config);
        config.trigger.line = Some("GPIO24".into());
        let triggered = lacks(&config);
        let says_gpio = |said: Result<(), String>| said.is_err_and(|said| said.contains("gpio"));
        assert!(!says_gpio(free));
        assert_eq!(says_gpio(triggered), !cfg!(feature = "gpio"));
    }
}
