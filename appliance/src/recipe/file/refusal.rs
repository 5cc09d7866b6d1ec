//! Why a recipe is refused: a sentence, and the element of its lists that is why.

use crate::head::scan::PhasesError;
use algo::frame::FrameError;
use algo::geometry::RigError;
use algo::pattern::{PhaseFunctionError, SequenceError};
use algo::phase::DecodeError;
use hal::bounds::OutOfBounds;

/// The refusal in these words, formatted.
macro_rules! refused {
    ($($words:tt)*) => {
        Err(crate::recipe::Refusal::from(format!($($words)*)))
    };
}
pub(crate) use refused;

/// A list of a recipe that people edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Features.
    Feature,
    /// Datum systems.
    Datum,
    /// Gauges.
    Gauge,
}

/// An element of a recipe's lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// In which list.
    pub part: Part,
    /// Its place there.
    pub place: usize,
    /// Its name.
    pub name: String,
}

impl Element {
    pub(crate) fn new(part: Part, place: usize, name: &str) -> Self {
        let name = name.into();
        Self { part, place, name }
    }
}

/// Why a recipe is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{words}")]
pub struct Refusal {
    /// A sentence, with the remedy.
    pub words: String,
    /// The element that is why, if one is.
    pub of: Option<Element>,
}

impl From<String> for Refusal {
    fn from(words: String) -> Self {
        Self { words, of: None }
    }
}

/// A recipe is refused in the words of these errors.
macro_rules! refuses {
    ($($error:ty,)*) => {
        $(impl From<$error> for Refusal {
            fn from(error: $error) -> Self {
                error.to_string().into()
            }
        })*
    };
}

refuses! {
    OutOfBounds,
    PhasesError,
    DecodeError,
    FrameError,
    PhaseFunctionError,
    RigError,
    SequenceError,
    std::io::Error,
}

impl From<&str> for Refusal {
    fn from(words: &str) -> Self {
        String::from(words).into()
    }
}

impl From<Refusal> for String {
    fn from(refusal: Refusal) -> Self {
        refusal.words
    }
}

impl Part {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Feature => "feature",
            Self::Datum => "datum",
            Self::Gauge => "gauge",
        }
    }
}
