//! Why a part could not be taught.

use super::Refusal;
use crate::error::code_of;
use crate::head::calibrated::MeasureError;
use crate::station::{Square, error_code};
use algo::adaptive::AdaptError;
use std::fmt::Display;

/// A part that could not be taught.
#[derive(Debug, thiserror::Error)]
pub enum TeachError {
    /// A device failed.
    #[error("teach: {0}")]
    Device(hal::error::Error),
    /// No recipe can be made of this scene.
    #[error("teach: {0}")]
    Scene(String),
    /// Good parts would not keep the limit of the deviation.
    #[error("teach: {words}")]
    Limit {
        /// In words, with the remedy.
        words: String,
        /// Where they deviate most, if that is known.
        place: Option<Square>,
    },
    /// The geometry or the pattern is impossible.
    #[error("teach: {0}")]
    Rig(String),
    /// The head's calibration cannot be used.
    #[error("teach: {0}")]
    NotCalibrated(String),
    /// The progress callback asked for the end.
    #[error("teach: it was ended early")]
    Ended,
}

impl TeachError {
    /// [`Self::Rig`] of an error.
    pub(super) fn rig(error: impl Display) -> Self {
        Self::Rig(error.to_string())
    }

    /// The value of register ERROR_CODE.
    pub fn code(&self) -> u16 {
        match self {
            Self::Device(error) => code_of(error),
            Self::Scene(_) | Self::Limit { .. } => error_code::NOTHING_TO_TEACH,
            Self::Rig(_) => error_code::RIG,
            Self::NotCalibrated(_) => error_code::NOT_CALIBRATED,
            Self::Ended => error_code::ABORTED,
        }
    }
}

impl From<hal::error::Error> for TeachError {
    fn from(error: hal::error::Error) -> Self {
        Self::Device(error)
    }
}

impl From<MeasureError> for TeachError {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Device(error) => Self::Device(error),
            MeasureError::Impossible(error) => Self::Rig(error),
        }
    }
}

impl From<Refusal> for TeachError {
    fn from(refusal: Refusal) -> Self {
        Self::rig(refusal)
    }
}

impl From<AdaptError> for TeachError {
    fn from(error: AdaptError) -> Self {
        Self::Scene(error.to_string())
    }
}
