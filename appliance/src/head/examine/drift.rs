//! Measures whether camera and projector still stand to each other as their models say: any part under vertical and horizontal fringes.

use crate::head::calibration::Calibration;
use crate::head::scan::{self, Scan};
use algo::pattern::{PhaseFunction, Sequence};
use algo::pipeline::{Epipolar, PhaseMap};
use hal::error::Error;
use hal::head::Head;
use std::time::Duration;

/// Levels of each sequence.
const LEVELS: usize = 3;
/// Shifts of each level.
const SHIFTS: usize = 4;
/// Pitch of both patterns, projector pixels.
const PITCH: f64 = 16.0;
/// Beyond this RMS distance of projector points from their epipolar lines, projector pixels, the models are not those of the head any
/// more: a real board in poses that were not used for the calibration left 0.08 to 0.43, a camera that was turned by 0.05° leaves 1.
pub const MOST_DRIFT_PX: f64 = 0.5;

/// Compares the head with its models; `None` if too little of the frame shows fringes. The head's timing must be calibrated.
///
/// # Errors
/// Of a device, or if the projector is too small for the fringes.
pub fn drift(
    head: &mut Head,
    calibration: &Calibration,
    timeout: Duration,
) -> Result<Option<Epipolar>, Error> {
    let (columns, rows) = head.projector_size();
    let (columns, rows) = (columns as usize, rows as usize);
    let mut maps = Vec::with_capacity(2);
    for vertical in [true, false] {
        let function = match vertical {
            true => PhaseFunction::vertical(columns, rows, columns as f64 / PITCH),
            false => PhaseFunction::horizontal(columns, rows, rows as f64 / PITCH),
        };
        let small = |problem: String| {
            Error::unsupported(
                format!("fringes of {PITCH} px: {problem}, which"),
                "use a projector of more pixels",
            )
        };
        let function = function.map_err(|error| small(error.to_string()))?;
        let shots = Sequence::geometric(function.range(), LEVELS, SHIFTS);
        let taken = scan::take(head, calibration, &function, &shots, timeout, &|_| ())?;
        let map: Result<PhaseMap, String> =
            Scan::new(function.range(), &shots, &taken).and_then(|scan| scan.phases(None));
        maps.push(map.map_err(small)?);
    }
    let devices = (&calibration.camera, &calibration.projector);
    Ok(Epipolar::of(devices, [&maps[0], &maps[1]], [PITCH; 2]))
}
