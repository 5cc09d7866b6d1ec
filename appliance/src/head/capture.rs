//! Pictures without models: which rasters are shown for them, and the recording that their frames
//! make.

use super::calibration::Calibration;
use super::rasters::rasters;
use super::seam;
use algo::pattern::{Sequence, Shot};
use hal::error::Error;
use hal::frame::Frame;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame};

/// Projector pixels per fringe where none are stated.
const PITCH: f64 = 12.0;

/// What is shown: fringes first, then white and black.
#[derive(Default)]
pub struct Shown {
    fringes: Vec<Fringes>,
    /// Whether a white picture is taken.
    pub white: bool,
    /// Whether a black picture is taken.
    pub black: bool,
}

/// Fringes of one direction.
struct Fringes {
    spec: PatternSpec,
    shots: Vec<Shot>,
    rasters: Vec<Raster>,
}

impl Shown {
    /// Vertical and horizontal fringes and white, as a pose of a board needs them.
    ///
    /// # Errors
    /// In words: the projector is too small for them.
    pub fn pose(calibration: &Calibration) -> Result<Self, String> {
        let mut shown = Self {
            white: true,
            ..Self::default()
        };
        for vertical in [true, false] {
            shown.add_fringes(calibration, vertical, None, 3, 4)?;
        }
        Ok(shown)
    }

    /// Adds `levels` of `steps` shifts of one direction, the finest with so many fringes over the
    /// projector, else one per 12 pixels.
    ///
    /// # Errors
    /// In words: no projector of this size can show them.
    pub fn add_fringes(
        &mut self,
        calibration: &Calibration,
        vertical: bool,
        fringes: Option<f64>,
        levels: usize,
        steps: usize,
    ) -> Result<(), String> {
        let (columns, rows) = calibration.raster();
        let length = if vertical { columns } else { rows };
        let fringes = fringes.unwrap_or(f64::from(length) / PITCH);
        let spec = match vertical {
            true => PatternSpec::Vertical { fringes },
            false => PatternSpec::Horizontal { fringes },
        };
        let function = seam::phase_function(&spec, columns as usize, rows as usize)
            .map_err(|error| error.to_string())?;
        let shots = Sequence::geometric(function.range(), levels, steps);
        let rasters = rasters(&function, &shots, calibration).map_err(|error| error.to_string())?;
        self.fringes.push(Fringes {
            spec,
            shots,
            rasters,
        });
        Ok(())
    }

    /// The rasters, in the order in which they are shown.
    ///
    /// # Errors
    /// Never for a projector of at least one pixel.
    pub fn rasters(&self, calibration: &Calibration) -> Result<Vec<Raster>, Error> {
        let (columns, rows) = calibration.raster();
        let fringes = self.fringes.iter().flat_map(|fringes| &fringes.rasters);
        let mut all: Vec<Raster> = fringes.cloned().collect();
        for (wanted, grey) in [(self.white, u8::MAX), (self.black, 0)] {
            if wanted {
                all.push(Raster::uniform(columns, rows, grey)?);
            }
        }
        Ok(all)
    }

    /// The recording, without models, of as many of the `frames` as were shown here.
    pub fn recording(
        &self,
        calibration: &Calibration,
        frames: &mut dyn Iterator<Item = Frame>,
    ) -> Recording {
        let mut recording = calibration.recording();
        recording.description = "taken without models".into();
        (recording.camera_model, recording.projector.model) = (None, None);
        recording.noise_counts = None;
        for (pattern, fringes) in self.fringes.iter().enumerate() {
            recording.patterns.push(fringes.spec.clone());
            let shown = fringes.shots.iter().zip(&mut *frames);
            let recorded = shown.map(|(&shot, frame)| RecordedFrame {
                pattern,
                ..seam::recorded(shot, frame)
            });
            recording.frames.extend(recorded);
        }
        recording.white = self.white.then(|| frames.next()).flatten();
        recording.black = self.black.then(|| frames.next()).flatten();
        recording
    }
}
