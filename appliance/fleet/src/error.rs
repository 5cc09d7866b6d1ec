//! What ends a command early: a message for people and an exit code after sysexits.

use std::fmt::Display;
use std::process::ExitCode;

/// Exit codes, after BSD's `sysexits.h`; the same as those of `fringed`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The command line is wrong.
    Usage = 64,
    /// An answer or a database has wrong content.
    Content = 65,
    /// The named folder or file does not exist.
    Missing = 66,
    /// A head or a store cannot be reached, or a port is in use.
    Unavailable = 69,
    /// The program itself is at fault.
    Software = 70,
    /// Output cannot be created.
    CannotCreate = 73,
    /// `fleet.toml` is wrong.
    Configuration = 78,
}

impl Exit {
    /// What makes a failure with this code of an error while doing `what`.
    pub fn because<E: Display>(self, what: impl Display) -> impl Fn(E) -> Failure {
        move |error| Failure::new(self, format!("{what}: {error}"))
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
#[error("{message}")]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// What was attempted with what, why it failed, and what to do.
    pub message: String,
}

impl Failure {
    /// A failure in words that also say what to do.
    pub fn new(exit: Exit, message: impl Display) -> Self {
        Self {
            exit,
            message: message.to_string(),
        }
    }
}

/// What a command comes to, unless another error is named.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
