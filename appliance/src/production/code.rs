//! ERROR_CODE of what goes wrong in the measuring task; `docs/operations.md` has the table.

use crate::recipe::teach::TeachError;
use crate::station::error_code;
use hal::error::{Device, Error};

pub(super) const CAMERA_LOST: u16 = 101;
pub(super) const UNSUPPORTED: u16 = 102;
pub(super) const PROJECTOR_LOST: u16 = 201;
pub(super) const TIMEOUT: u16 = 301;
pub(super) const PROTOCOL: u16 = 302;
pub(super) const LINES_LOST: u16 = 303;
pub(super) const NOTHING_TO_TEACH: u16 = 401;
pub(super) const RIG: u16 = 501;
pub(super) const NOT_CALIBRATED: u16 = 502;
pub(super) const NOT_STORED: u16 = 601;

/// ERROR_CODE of a device's error.
pub(crate) fn code_of(error: &Error) -> u16 {
    match error {
        Error::Timeout { .. } => TIMEOUT,
        Error::Disconnected { device, .. } => match device {
            Device::Camera => CAMERA_LOST,
            Device::Projector => PROJECTOR_LOST,
            Device::Lines => LINES_LOST,
        },
        Error::Unsupported { .. } => UNSUPPORTED,
        Error::Protocol { .. } => PROTOCOL,
    }
}

pub(super) fn code_of_teaching(error: &TeachError) -> u16 {
    match error {
        TeachError::Device(error) => code_of(error),
        TeachError::Scene(_) => NOTHING_TO_TEACH,
        TeachError::Rig(_) => RIG,
        TeachError::NotCalibrated(_) => NOT_CALIBRATED,
        TeachError::Ended => error_code::ABORTED,
    }
}
