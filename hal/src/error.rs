//! Errors of devices and their kinds.

use std::fmt;
use std::time::Duration;

/// The kind of a device error: what the caller may do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// The device did not answer within the time given; the call may be repeated.
    Timeout,
    /// The device is gone; it has to be opened again.
    Disconnected,
    /// The device cannot do what was asked, now or later; the request has to change.
    Unsupported,
    /// The call is out of order, or the device gave an answer that does not fit.
    Protocol,
    /// The caller ended it early.
    Ended,
}

/// A kind of device that can be disconnected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DeviceKind {
    /// The camera.
    Camera,
    /// The projector.
    Projector,
    /// The GPIO chip of the trigger line, and of the lines to a press or another machine.
    Lines,
}

impl DeviceKind {
    /// Its name in messages.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Projector => "projector",
            Self::Lines => "GPIO chip",
        }
    }
}

/// A failed call of a device. The message says what was attempted, with what numbers, and the
/// remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// There was no answer within the time given.
    Timeout {
        /// What was attempted, with its numbers.
        attempt: String,
        /// The time given.
        timeout: Duration,
        /// What to do about it.
        remedy: String,
    },
    /// The device is gone.
    Disconnected {
        /// Which device.
        device: DeviceKind,
        /// What was attempted, with its numbers.
        attempt: String,
        /// What to do about it.
        remedy: String,
    },
    /// The device cannot do this.
    Unsupported {
        /// What was attempted, with its numbers.
        attempt: String,
        /// What to do about it.
        remedy: String,
    },
    /// The call is out of order, or the device's answer is.
    Protocol {
        /// What was attempted, with its numbers.
        attempt: String,
        /// What to do about it.
        remedy: String,
    },
    /// The caller ended it early, which is not a fault of a device.
    Ended {
        /// What was attempted.
        attempt: String,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.problem(), self.remedy())
    }
}

impl std::error::Error for Error {}

impl Error {
    /// What was attempted, and how it failed.
    #[must_use]
    pub fn problem(&self) -> String {
        match self {
            Self::Timeout {
                attempt, timeout, ..
            } => {
                let ms = timeout.as_secs_f64() * 1e3;
                format!("{attempt} did not finish within {ms} ms")
            }
            Self::Disconnected {
                device, attempt, ..
            } => format!("{attempt} failed because the {} is gone", device.word()),
            Self::Unsupported { attempt, .. } => format!("{attempt} is not supported"),
            Self::Protocol { attempt, .. } => format!("{attempt} is out of order"),
            Self::Ended { attempt } => format!("{attempt} was ended early"),
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &str {
        match self {
            Self::Timeout { remedy, .. }
            | Self::Disconnected { remedy, .. }
            | Self::Unsupported { remedy, .. }
            | Self::Protocol { remedy, .. } => remedy,
            Self::Ended { .. } => "begin it again when nothing else is to be done",
        }
    }

    /// The kind of this error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Timeout { .. } => ErrorKind::Timeout,
            Self::Disconnected { .. } => ErrorKind::Disconnected,
            Self::Unsupported { .. } => ErrorKind::Unsupported,
            Self::Protocol { .. } => ErrorKind::Protocol,
            Self::Ended { .. } => ErrorKind::Ended,
        }
    }

    /// A time-out of `attempt` after `timeout`.
    pub fn timeout(
        attempt: impl Into<String>,
        timeout: Duration,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Timeout {
            attempt: attempt.into(),
            timeout,
            remedy: remedy.into(),
        }
    }

    /// `attempt` failed because `device` is gone.
    pub fn disconnected(device: DeviceKind, attempt: impl Into<String>) -> Self {
        Self::Disconnected {
            device,
            attempt: attempt.into(),
            remedy: format!("check the {}'s cable and its power", device.word()),
        }
    }

    /// `attempt` cannot be done.
    pub fn unsupported(attempt: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Unsupported {
            attempt: attempt.into(),
            remedy: remedy.into(),
        }
    }

    /// The caller ended `attempt` early.
    pub fn ended(attempt: impl Into<String>) -> Self {
        Self::Ended {
            attempt: attempt.into(),
        }
    }

    /// `attempt` is out of order.
    pub fn protocol(attempt: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Protocol {
            attempt: attempt.into(),
            remedy: remedy.into(),
        }
    }
}
