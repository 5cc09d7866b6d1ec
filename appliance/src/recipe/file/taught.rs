//! What a recipe's file says of how it was taught: the models of the head, the fixed against the
//! adaptive pattern, good parts as predicted, and gauges as they were tried.

use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::station::Unit;
use algo::pattern::MAX_FRAMES;
use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use hal::bounded;
use hal::bounds::{Fields, MAX_SIGMA_MM};
use hal::model::{DeviceModel, PlaneModel};
use std::ops::RangeInclusive;

bounded! {
    /// The geometry of a head.
    pub struct ModelsFile {
        /// The camera.
        pub camera: DeviceModel,
        /// The projector.
        pub projector: DeviceModel,
        /// What the measured reference plane is off the models; `None` where heights go by the
        /// models.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub plane: Option<PlaneModel> = Fields,
    }
}

impl ModelsFile {
    /// Those of a calibration.
    pub fn of(calibration: &Calibration) -> Self {
        Self {
            camera: seam::device_model(&calibration.camera),
            projector: seam::device_model(&calibration.projector),
            plane: calibration.plane_by().cloned(),
        }
    }
}

bounded! {
    /// Both measurements.
    pub struct ComparisonFile {
        /// With straight, equidistant fringes.
        pub fixed: QualityFile = Fields,
        /// With the part's adaptive pattern.
        pub adaptive: QualityFile = Fields,
    }

    /// Noise and coverage of one measurement.
    #[derive(Copy)]
    pub struct QualityFile {
        /// Frames of the sequence.
        pub frames: usize = 1..=MAX_FRAMES,
        /// Predicted σ_z from the measured modulation, RMS over the pixels that both resolve, mm.
        pub sigma_mm: f64 = 0.0..=MAX_SIGMA_MM,
        /// Share of the frame that is resolved.
        pub coverage: f64 = 0.0..=1.0,
    }
}

/// A measurement with so many frames.
type MeasuredWith<'a> = (usize, &'a PhaseMap, &'a HeightMap);

impl ComparisonFile {
    /// Compares a measurement with the fixed pattern and one with the adaptive pattern.
    pub fn of(fixed: MeasuredWith<'_>, adaptive: MeasuredWith<'_>) -> Self {
        let resolved =
            |(_, phases, _): MeasuredWith<'_>, at: usize| phases.trust[at] == Trust::Resolved;
        let both: Vec<usize> = (0..fixed.1.trust.len())
            .filter(|&at| resolved(fixed, at) && resolved(adaptive, at))
            .collect();
        let quality = |(frames, phases, heights): MeasuredWith<'_>| {
            let squares = both.iter().map(|&at| f64::from(heights.sigma[at]).powi(2));
            QualityFile {
                frames,
                sigma_mm: (squares.sum::<f64>() / both.len().max(1) as f64).sqrt(),
                coverage: phases.count(Trust::Resolved) as f64 / phases.trust.len().max(1) as f64,
            }
        };
        Self {
            fixed: quality(fixed),
            adaptive: quality(adaptive),
        }
    }
}

/// Bounds of a deviation in the file, mm.
fn length() -> RangeInclusive<f64> {
    0.0..=Unit::Length.range()[1]
}

bounded! {
    /// The deviation of good parts, as predicted when the part was taught.
    #[derive(Copy, Default)]
    pub struct GoodPartsFile {
        /// The limit that was asked for, ± mm.
        pub tolerance_mm: f64 = length(),
        /// The limit that was set, ± mm: the same, but in recipes of versions that widened it.
        pub limit_mm: f64 = length(),
        /// The largest deviation of a good part that lies as taught: mean and standard deviation
        /// over parts and goldens, mm.
        pub largest_mm: f64 = length(),
        /// See above.
        pub scatter_mm: f64 = length(),
        /// Share of such parts that exceed the limit.
        pub beyond: f64 = 0.0..=1.0,
        /// Share of the pixels that are too noisy for the limit to be compared at all.
        pub left_out: f64 = 0.0..=1.0,
        /// Share of the surface, by its area, that is too noisy for the limit, and so counts with
        /// less weight.
        pub weighed: f64 = 0.0..=1.0,
        /// The least of these weights; 1 where there are none.
        pub least_weight: f64 = 1.0 / 256.0..=1.0,
        /// The side of the squares that these figures are of, pixels.
        pub smoothing_px: usize = 1..=usize::from(u16::MAX),
        /// The largest side of the squares about pixels where squares of `smoothing_px` would be
        /// too noisy; 0 if there are no such pixels.
        pub wider_px: usize = 0..=usize::from(u8::MAX),
        /// Share of the compared pixels with squares larger than `smoothing_px`.
        pub wider: f64 = 0.0..=1.0,
        /// Diameter of a dent that is seen at nine tenths of its depth in squares of `smoothing_px`
        /// where the part faces the camera, mm; 0 if not known. U says nothing of narrower ones.
        pub dent_mm: f64 = length(),
        /// The largest deviation of good parts that lie anywhere within the placement tolerance:
        /// median and spread, mm; 0 if it was not tried.
        pub displaced_mm: f64 = length(),
        /// See above.
        pub displaced_scatter_mm: f64 = length(),
    }
}

bounded! {
    /// How a gauge judges good parts that lie anywhere within the placement tolerance.
    pub struct TriedFile {
        /// Its name.
        pub gauge: String,
        /// The share of good parts that the gauge would let pass, as predicted from those that were
        /// tried.
        pub passes: f64 = 0.0..=1.0,
    }
}

impl TriedFile {
    /// In words.
    pub fn words(&self, tolerance_mm: f64) -> String {
        // More is not known from a few parts that were tried.
        let percent = (self.passes * 100.0).min(99.99);
        format!(
            "{} would pass {percent:.2} % of good parts that lie anywhere within {tolerance_mm} mm",
            self.gauge
        )
    }
}
