//! What ends a command early: a message for people and an exit code after sysexits.

use crate::station::error_code;
// For `web`, which imports nothing of `hal`.
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
    /// A port is in use or a device missing, or the processor is older than SSSE3.
    Unavailable = 69,
    /// The program itself is at fault.
    Software = 70,
    /// Output or state cannot be created.
    CannotCreate = 73,
    /// The configuration is wrong.
    Configuration = 78,
}

impl Exit {
    /// What makes a failure with this code of an error.
    pub fn failure<E: Display>(self) -> impl Fn(E) -> Failure + Copy {
        move |error| Failure::new(self, error)
    }

    /// What makes a failure with this code of an error while doing `what`, which names the file.
    pub fn because<E: Display>(self, what: impl Display) -> impl Fn(E) -> Failure {
        move |error| Failure::because(self, &what, error)
    }

    /// As [`Self::because`], with what to do about it.
    pub fn advising<E: Display>(
        self,
        what: impl Display,
        remedy: impl Display,
    ) -> impl Fn(E) -> Failure {
        move |error| Failure::because(self, &what, format!("{error}: {remedy}"))
    }

    /// A failure with this code, for whatever should have been done.
    ///
    /// # Errors
    /// Always.
    pub fn fail<T>(self, message: impl Display) -> Result<T> {
        Err(Failure::new(self, message))
    }
}

/// A command that could not be carried out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}{}{remedy}", if remedy.is_empty() { "" } else { ": " })]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// What was attempted with what, or what is wrong.
    pub problem: String,
    /// Why it failed, where that is not said yet, and what to do; empty where the problem says both.
    pub remedy: String,
    /// The error of the device that is at fault, if one is.
    pub device: Option<Error>,
}

impl Failure {
    /// A failure in words that also say what to do.
    pub fn new(exit: Exit, message: impl Display) -> Self {
        Self::because(exit, message, "")
    }

    /// `what` was attempted, with the name of the file, or is wrong; `error` and what to do about it.
    pub fn because(exit: Exit, what: impl Display, error: impl Display) -> Self {
        Self {
            exit,
            problem: what.to_string(),
            remedy: error.to_string(),
            device: None,
        }
    }
}

impl From<Failure> for String {
    fn from(failure: Failure) -> Self {
        failure.to_string()
    }
}

/// What a command comes to, unless another error is named.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

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
            ..Self::because(Exit::Unavailable, error.problem(), error.remedy())
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
        Self::new(exit, error)
    }
}
