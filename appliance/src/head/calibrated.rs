//! Measures a part with a pattern of the caller's choice, where no recipe describes the
//! measurement: for teaching and experiments.

use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::head::scan::{self, Scan};
use algo::geometry::Triangulator;
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::Decoder;
use algo::pipeline::{HeightMap, PhaseMap, Progress};
use algo::units::AbsolutePhase;
use hal::frame::Frame;
use hal::head::Head;
use std::time::Duration;

/// The share of a measurement's time in which its frames are taken.
const TAKEN: f64 = 0.7;

/// Pitch of straight fringes, projector pixels, and shifts of each of their levels.
pub const STRAIGHT_PITCH_PX: f64 = 20.0;
/// See above.
pub const STRAIGHT_SHIFTS: usize = 4;
/// Levels of straight fringes.
const STRAIGHT_LEVELS: usize = 3;

/// What is projected where nothing is known of what is seen: straight vertical fringes for a projector of so many columns and
/// rows, and what each frame shows.
///
/// # Errors
/// If the projector is too small.
pub fn straight_fringes(
    (columns, rows): (usize, usize),
) -> Result<(PhaseFunction, Vec<Shot>), MeasureError> {
    let fringes = columns as f64 / STRAIGHT_PITCH_PX;
    let function = PhaseFunction::vertical(columns, rows, fringes);
    let function = function.map_err(MeasureError::impossible)?;
    let shots = Sequence::geometric(function.range(), STRAIGHT_LEVELS, STRAIGHT_SHIFTS);
    Ok((function, shots))
}

/// A head with its calibration, in front of a part.
pub struct CalibratedHead<'a> {
    /// The devices.
    pub head: &'a mut Head,
    /// The calibration of the head.
    pub calibration: &'a Calibration,
    /// Longest wait for a device.
    pub timeout: Duration,
}

/// A measured part.
#[derive(Debug)]
pub struct Measured {
    /// Phase, modulation and trust.
    pub phases: PhaseMap,
    /// Height and σ_z.
    pub heights: HeightMap,
    /// How it was decoded.
    pub decoder: Decoder,
    /// The geometry with its phase function.
    pub triangulator: Triangulator,
    /// The frames, in the order of the sequence.
    pub frames: Vec<Frame>,
}

/// A measurement that failed.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A device failed.
    #[error(transparent)]
    Device(#[from] hal::error::Error),
    /// The pattern, the sequence or the geometry is impossible.
    #[error("{0}")]
    Impossible(String),
}

impl MeasureError {
    /// [`Self::Impossible`] of an error.
    pub fn impossible(error: impl std::fmt::Display) -> Self {
        Self::Impossible(error.to_string())
    }
}

impl CalibratedHead<'_> {
    /// Projects the shots of a phase function and measures the part in the default working range of
    /// [`Triangulator::new`]. Levels that are unwrapped about a known map take `map` (row-major),
    /// or without one the reference phase map. `progress` gets the share of the measurement that is done.
    ///
    /// # Errors
    /// If a device fails, the sequence cannot be decoded, or camera and projector do not look down
    /// at the reference plane from two different points.
    pub fn measure(
        &mut self,
        function: &PhaseFunction,
        shots: &[Shot],
        map: Option<&[AbsolutePhase]>,
        progress: Progress<'_>,
    ) -> Result<Measured, MeasureError> {
        self.measure_lit(&Illumination::default(), function, shots, map, progress)
    }

    /// As [`Self::measure`], with patterns that are illuminated and exposed in this way.
    ///
    /// # Errors
    /// As [`Self::measure`]; if the head cannot expose for so long.
    pub fn measure_lit(
        &mut self,
        illumination: &Illumination,
        function: &PhaseFunction,
        shots: &[Shot],
        map: Option<&[AbsolutePhase]>,
        progress: Progress<'_>,
    ) -> Result<Measured, MeasureError> {
        let (calibration, timeout) = (self.calibration, self.timeout);
        let triangulator = calibration.triangulator(function.clone(), None);
        let triangulator = triangulator.map_err(MeasureError::impossible)?;
        illumination.load(self.head, function, shots, calibration)?;
        let frames = scan::take_loaded(self.head, shots.len(), timeout, &|share| {
            progress(TAKEN * share);
        })?;
        let scan = Scan::new(function.range(), shots, &frames).map_err(MeasureError::impossible)?;
        let scan = scan.trusting(calibration.least_modulation());
        let reference;
        let map = match map {
            None if scan.needs_map() => {
                reference = triangulator.reference_map();
                Some(&reference[..])
            }
            map => map.filter(|_| scan.needs_map()),
        };
        let mut phases = scan.phases(map).map_err(MeasureError::impossible)?;
        let noise = scan.noise(calibration, &phases);
        let heights = scan.heights(&triangulator, Some(noise), &mut phases, &|share| {
            progress(TAKEN + (1.0 - TAKEN) * share);
        });
        Ok(Measured {
            phases,
            heights,
            decoder: scan.decoder,
            triangulator,
            frames,
        })
    }
}
