//! Measures what stands in front of a calibrated head where no recipe describes the measurement: a part
//! with a pattern of the caller's choice, and the station without a part.

use crate::error::Exit;
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::head::scan::{self, Scan};
use crate::storage::folder::{read_whole, write_whole};
use algo::geometry::Triangulator;
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::{Decoder, LeastModulation};
use algo::pipeline::{HeightMap, PhaseMap, Progress};
use algo::units::AbsolutePhase;
use hal::frame::Frame;
use hal::head::Head;
use hal::npy;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The share of a measurement's time in which its frames are taken.
const TAKEN: f64 = 0.7;
/// Pitch of straight fringes, projector pixels, and shifts of each of their levels.
pub const STRAIGHT_PITCH_PX: f64 = 20.0;
/// See above.
pub const STRAIGHT_SHIFTS: usize = 4;
/// Levels of straight fringes.
const STRAIGHT_LEVELS: usize = 3;
/// Longest wait for a frame.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Begin and end of the name of its file beside the calibration; between them are the first digits of the
/// calibration's fingerprint: heights of another calibration are of no use.
const NAME: [&str; 2] = ["empty-", ".npy"];
const DIGITS: usize = 16;
/// Largest file, bytes.
const MAX_BYTES: u64 = 256 << 20;

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
    /// The least modulation that is trusted.
    pub least: LeastModulation,
}

/// A measured part.
#[derive(Debug)]
pub struct MeasuredPart {
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

impl<'a> CalibratedHead<'a> {
    /// That trusts the modulation that the head's calibration says.
    pub fn new(head: &'a mut Head, calibration: &'a Calibration, timeout: Duration) -> Self {
        Self {
            head,
            calibration,
            timeout,
            least: calibration.least_modulation(),
        }
    }

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
    ) -> Result<MeasuredPart, MeasureError> {
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
    ) -> Result<MeasuredPart, MeasureError> {
        let (calibration, timeout) = (self.calibration, self.timeout);
        let triangulator = calibration.triangulator(function.clone(), None);
        let triangulator = triangulator.map_err(MeasureError::impossible)?;
        illumination.load(self.head, function, shots, calibration)?;
        let frames = scan::take_loaded(self.head, shots.len(), timeout, &|share| {
            progress(TAKEN * share);
        })?;
        let scan = Scan::new(function.range(), shots, &frames).map_err(MeasureError::impossible)?;
        let scan = scan.trusting(self.least);
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
        Ok(MeasuredPart {
            phases,
            heights,
            decoder: scan.decoder,
            triangulator,
            frames,
        })
    }
}

/// The heights that are seen without a part.
#[derive(Clone, Debug, PartialEq)]
pub struct EmptyStation {
    /// z of each pixel in mm, row by row; not a number where nothing is seen.
    pub heights: Vec<f32>,
}

impl EmptyStation {
    /// Measures it with straight fringes.
    ///
    /// # Errors
    /// As [`CalibratedHead::measure`].
    pub fn measure(
        head: &mut Head,
        calibration: &Calibration,
        progress: Progress<'_>,
    ) -> Result<Self, MeasureError> {
        let calibration = &calibration.clone().with_rays();
        let (columns, rows) = (
            calibration.projector.width(),
            calibration.projector.height(),
        );
        let (function, shots) = straight_fringes((columns, rows))?;
        let mut head = CalibratedHead::new(head, calibration, TIMEOUT);
        let measured = head.measure(&function, &shots, None, progress)?;
        let heights = measured.heights.height.iter();
        let mm = heights.map(|height| match height.is_known() {
            true => height.mm() as f32,
            false => f32::NAN,
        });
        Ok(Self {
            heights: mm.collect(),
        })
    }

    /// The share of the picture where something is seen.
    pub fn seen(&self) -> f64 {
        let seen = self.heights.iter().filter(|height| height.is_finite());
        seen.count() as f64 / self.heights.len().max(1) as f64
    }

    /// Stores it beside the calibration's file, in place of another one.
    ///
    /// # Errors
    /// If it cannot be stored (73).
    pub fn store(&self, place: &Path, calibration: &Calibration) -> crate::error::Result<()> {
        let file = file(place, calibration);
        let bytes = npy::write(calibration.camera.width(), &self.heights);
        let folder = file.parent().unwrap_or(Path::new("."));
        let written = fs::create_dir_all(folder).and_then(|()| write_whole(&file, &bytes));
        written.map_err(Exit::CannotCreate.because(format!("store {}", file.display())))?;
        let others = fs::read_dir(folder).into_iter().flatten().flatten();
        for other in others
            .map(|entry| entry.path())
            .filter(|other| *other != file)
        {
            let name = other.file_name().and_then(|name| name.to_str());
            if name.is_some_and(|name| name.starts_with(NAME[0]) && name.ends_with(NAME[1])) {
                // One that stays is of another calibration, and of no use.
                let _ = fs::remove_file(other);
            }
        }
        Ok(())
    }

    /// What was recorded with this calibration, if it was.
    ///
    /// # Errors
    /// If there is a file that cannot be used (65).
    pub fn load(place: &Path, calibration: &Calibration) -> crate::error::Result<Option<Self>> {
        let file = file(place, calibration);
        let what = format!("read {}", file.display());
        let wrong = Exit::Content.advising(what, "record the empty station again");
        let bytes = match read_whole(&file, MAX_BYTES) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|error| wrong(error.to_string()))?,
        };
        let heights = npy::read::<f32>(&bytes).map_err(|error| wrong(error.to_string()))?;
        let (width, rows, _) = calibration.frames();
        match (heights.columns, heights.rows) == (width as usize, rows as usize) {
            true => Ok(Some(Self {
                heights: heights.elements,
            })),
            false => Err(wrong("it is of another camera".into())),
        }
    }
}

fn file(place: &Path, calibration: &Calibration) -> PathBuf {
    let fingerprint = calibration.fingerprint();
    let digits: String = fingerprint.chars().take(DIGITS).collect();
    place.with_file_name(format!("{}{digits}{}", NAME[0], NAME[1]))
}
