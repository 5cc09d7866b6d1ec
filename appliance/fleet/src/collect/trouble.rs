//! Why a question to a head failed.

use crate::answer::Wrong;
use crate::http::HttpError;

/// Why a question failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Trouble {
    /// No answer, or none that says 200.
    #[error(transparent)]
    Http(#[from] HttpError),
    /// An answer that no head gives.
    #[error(transparent)]
    Wrong(#[from] Wrong),
    /// An answer without its end.
    #[error("the answer ends in the middle of a line")]
    Cut,
}
