//! Why a recipe cannot be run on a head.
//!
//! What makes a recipe unfit (RECIPE_RESULT 5, its bytes being whole): another version of the
//! format, a value out of its bounds, manifest and arrays that do not fit each other, limits that no
//! part can keep or miss (`judging`), a part number that two recipes have, a plan that fails,
//! patterns that the projector refuses. Another calibration, camera, projector, exposure or gain is
//! RECIPE_RESULT 3. Damaged bytes are told in `store`.

use crate::head::calibration::Calibration;
use crate::head::exposing::Exposing;
use crate::recipe::rules::refused;
use crate::recipe::{Conditions, Refusal};

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
    /// It was made on a head with another camera or projector.
    #[error("recipe {number} was made on another head: {reason}: teach it again on this head")]
    OtherHead {
        /// The recipe's number.
        number: u16,
        /// What the head has else.
        reason: Refusal,
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
        /// Why, and which of its features is why, if one is.
        reason: Refusal,
    },
}

impl From<PlanError> for Refusal {
    fn from(error: PlanError) -> Self {
        let words = error.to_string();
        let of = match error {
            PlanError::Unfit { reason, .. } => reason.of,
            _ => None,
        };
        Self { words, of }
    }
}

/// Checks that camera and projector have the size that the recipe was made for.
///
/// # Errors
/// In words: which of them has not.
pub(super) fn same_devices(
    conditions: &Conditions,
    calibration: &Calibration,
) -> Result<(), Refusal> {
    let (camera, here) = (conditions.camera, calibration.frames());
    if camera != here {
        return refused!("it is for a camera of {camera:?}, this head's has {here:?}");
    }
    let (raster, here) = (conditions.raster, calibration.raster());
    match raster == here {
        true => Ok(()),
        false => refused!("it is for a projector of {raster:?}, this head's has {here:?}"),
    }
}
