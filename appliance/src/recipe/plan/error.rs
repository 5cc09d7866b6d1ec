//! Why a recipe cannot be run on a head.

use crate::head::exposing::Exposing;

/// A recipe that cannot be run on this head.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// It was made for another calibration.
    #[error(
        "recipe {number} was made for calibration {made_for}, this head has {present}: teach it again on \
         this head"
    )]
    OtherCalibration {
        /// The recipe's number.
        number: u16,
        /// First digits of the fingerprint in the recipe.
        made_for: String,
        /// First digits of the head's.
        present: String,
    },
    /// It was taught with another exposure or gain.
    #[error(
        "recipe {number} was taught with {taught}, and the camera is set to {present}, where its noise is another: set the camera as it was, or \
         teach the recipe again"
    )]
    OtherExposing {
        /// The recipe's number.
        number: u16,
        /// What it was taught with.
        taught: Exposing,
        /// What the head is set to.
        present: Exposing,
    },
    /// Something in it does not fit.
    #[error("recipe {number}: {reason}")]
    Unfit {
        /// The recipe's number.
        number: u16,
        /// In words, with the remedy.
        reason: String,
    },
}
