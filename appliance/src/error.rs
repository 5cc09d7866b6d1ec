//! What ends a command early: a message for people and an exit code after sysexits.

use crate::station::error_code;
pub use hal::bounds::shortened;
use hal::error::{DeviceKind, Error};
use std::fmt::Display;
use std::process::ExitCode;

/// Exit codes, after BSD's `sysexits.h`. The README has the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The command line is wrong.
    Usage = 64,
    /// A recording, recipe or calibration has wrong content.
    Content = 65,
    /// The named folder or file does not exist.
    Missing = 66,
    /// A port is in use or a device missing.
    Unavailable = 69,
    /// The program itself is at fault.
    Software = 70,
    /// Output or state cannot be created.
    CannotCreate = 73,
    /// The configuration is wrong.
    Configuration = 78,
}

/// A command that could not be carried out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// What was attempted with what, and the remedy.
    pub message: String,
    /// The error of the device that is at fault, if one is.
    pub device: Option<Error>,
}

impl Failure {
    /// A failure with any exit code.
    pub fn new(exit: Exit, message: impl Into<String>) -> Self {
        Self {
            exit,
            message: message.into(),
            device: None,
        }
    }

    /// `error` while doing `what`, which names the file.
    pub fn because(exit: Exit, what: impl Display, error: impl Display) -> Self {
        Self::new(exit, format!("{what}: {error}"))
    }
}

/// ERROR_CODE of a device's error.
pub fn code_of(error: &Error) -> u16 {
    match error {
        Error::Timeout { .. } => error_code::TIMEOUT,
        Error::Disconnected { device, .. } => match device {
            DeviceKind::Camera => error_code::CAMERA_LOST,
            DeviceKind::Projector => error_code::PROJECTOR_LOST,
            DeviceKind::Lines => error_code::LINES_LOST,
        },
        Error::Unsupported { .. } => error_code::UNSUPPORTED,
        Error::Protocol { .. } => error_code::PROTOCOL,
        Error::Ended { .. } => error_code::ABORTED,
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self {
            device: Some(error.clone()),
            ..Self::new(Exit::Unavailable, error.to_string())
        }
    }
}

impl From<hal::replay::RecordingError> for Failure {
    fn from(error: hal::replay::RecordingError) -> Self {
        let exit = if error.is_missing() {
            Exit::Missing
        } else {
            Exit::Content
        };
        Self::new(exit, error.to_string())
    }
}
