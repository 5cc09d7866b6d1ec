//! The light of a part's patterns when frames are exposed for longer: where the camera would
//! saturate, there is less of it.

use super::adaptive::Preliminary;
use super::golden::Naming;
use crate::head::calibrated::{MeasuredPart, STRAIGHT_SHIFTS};
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use algo::adaptive::ProjectorMap;
use algo::adaptive::amplitude::{Received, amplitude, reach};
use hal::frame::{Frame, Samples};

/// Samples may reach this share of full scale, less their noise: a part that lies differently
/// reflects a little more.
const MOST: f64 = 0.9;
/// Noise that a sample may have beyond that, in σ.
const NOISE_SIGMAS: f64 = 4.0;

impl Preliminary {
    /// The light for a part that was measured with these fringes, in one exposure of their whole
    /// light.
    pub(super) fn illumination(
        &self,
        part: &MeasuredPart,
        calibration: &Calibration,
        naming: &Naming,
    ) -> Illumination {
        let exposures = naming.exposures;
        // The coarsest level, which blur weakens least.
        let shifts: [&Frame; STRAIGHT_SHIFTS] = std::array::from_fn(|shift| &part.frames[shift]);
        let format = shifts[0].format();
        let full_scale = f64::from(format.full_scale());
        let most = MOST - NOISE_SIGMAS * calibration.noise_counts / full_scale;
        let (width, rows) = (format.width as usize, format.height as usize);
        let wanted = (0..width * rows).map(|pixel| {
            let at = pixel / width * format.stride + pixel % width;
            let received = Received::of(shifts.map(|frame| sample(frame, at) / full_scale));
            received.share(exposures, most)
        });
        let wanted: Vec<f64> = wanted.collect();
        let map = ProjectorMap::from_heights(&part.triangulator, &part.heights);
        let (columns, rows) = (self.function.columns(), self.function.rows());
        let tolerance = naming.placement_tolerance_mm;
        let reach = reach(&part.triangulator, &part.heights, tolerance);
        Illumination {
            exposures,
            amplitude: amplitude(&map, &wanted, columns, rows, reach),
        }
    }
}

fn sample(frame: &Frame, at: usize) -> f64 {
    match frame.samples() {
        Samples::Eight(samples) => samples[at].into(),
        Samples::Sixteen(samples) => samples[at].into(),
    }
}
