//! What the projector shows: the grey rasters of a phase function, corrected by the inverse of the
//! measured grey response, and the pictures that are taken without models.

use crate::error::{Exit, Failure};
use crate::head::calibration::Calibration;
use crate::head::seam;
use algo::pattern::{Encoder, GreyRaster, PhaseFunction, Sequence, Shot};
use hal::error::Error;
use hal::frame::Frame;
use hal::head::Head;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame};
use rayon::prelude::*;

/// Projector pixels per fringe where none are stated.
const DEFAULT_PITCH_PX: f64 = 12.0;

/// How much light patterns give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Illumination {
    /// Each frame is exposed so many times as long as the camera is set to.
    pub exposures: u32,
    /// The light of each projector pixel, in 1/255 of what its pattern asks for; empty: all of it.
    pub amplitude: Vec<u8>,
}

impl Default for Illumination {
    /// One exposure of the whole light.
    fn default() -> Self {
        Self {
            exposures: 1,
            amplitude: Vec::new(),
        }
    }
}

impl Illumination {
    /// Loads the shots of a phase function, to be exposed in this way.
    ///
    /// # Errors
    /// The error of the projector, or if the head cannot expose for longer.
    pub fn load(
        &self,
        head: &mut Head,
        function: &PhaseFunction,
        shots: &[Shot],
        calibration: &Calibration,
    ) -> Result<(), Error> {
        head.load(self.rasters(function, shots, calibration)?)?;
        head.expose(self.exposures)
    }

    /// The grey raster of each shot of a phase function.
    ///
    /// # Errors
    /// Never for a phase function that could be made.
    pub fn rasters(
        &self,
        function: &PhaseFunction,
        shots: &[Shot],
        calibration: &Calibration,
    ) -> Result<Vec<Raster>, Error> {
        let response = calibration.response.as_ref();
        let whole = self.amplitude.is_empty();
        let encoder = Encoder::new(response.filter(|_| whole), shots);
        let raster = |&shot: &Shot| {
            let mut grey = encoder.raster(function, shot);
            if !whole {
                self.attenuate(&mut grey);
                if let Some(response) = response {
                    grey.pixels
                        .iter_mut()
                        .for_each(|level| *level = response.level_for(*level));
                }
            }
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        };
        shots.par_iter().map(raster).collect()
    }

    /// What is not one exposure of the whole light, for people.
    pub fn words(&self) -> Option<String> {
        let least = f64::from(*self.amplitude.iter().min()?) / 2.55;
        Some(match self.exposures {
            1 => format!(
                "the part mirrors: the projector gives {least:.0} % of its light where the part is brightest, and cycles take no longer"
            ),
            times => format!(
                "frames are exposed {times} times as long, with {least:.0} % of the projector's light where the part is brightest"
            ),
        })
    }

    /// Makes linear light darker, rounded to the nearest level.
    fn attenuate(&self, grey: &mut GreyRaster) {
        for (level, &share) in grey.pixels.iter_mut().zip(&self.amplitude) {
            *level = ((u32::from(*level) * u32::from(share) + 127) / 255) as u8;
        }
    }
}

/// Vertical fringes of `pitch` pixels over a projector of this size, at each of so many shifts of a
/// turn.
///
/// # Errors
/// `Unsupported` if the projector is too small for them.
pub fn fringes(
    size: (u32, u32),
    pitch: u32,
    shifts: usize,
    calibration: &Calibration,
) -> Result<Vec<Raster>, Error> {
    let function = seam::fringes(true, size, f64::from(pitch))?;
    let shots: Vec<Shot> = Shot::level(1.0, shifts).collect();
    rasters(&function, &shots, calibration)
}

/// The grey raster of each shot of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &PhaseFunction,
    shots: &[Shot],
    calibration: &Calibration,
) -> Result<Vec<Raster>, Error> {
    Illumination::default().rasters(function, shots, calibration)
}

/// What is shown: fringes first, then white and black.
#[derive(Default)]
pub struct ShownPictures {
    fringes: Vec<FringePattern>,
    /// Whether a white picture is taken.
    pub white: bool,
    /// Whether a black picture is taken.
    pub black: bool,
}

/// FringePattern of one direction.
struct FringePattern {
    spec: PatternSpec,
    shots: Vec<Shot>,
    rasters: Vec<Raster>,
}

impl ShownPictures {
    /// Vertical and horizontal fringes and white, as a pose of a board needs them.
    ///
    /// # Errors
    /// The projector is too small for them.
    pub fn pose(calibration: &Calibration) -> Result<Self, Failure> {
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
    /// No projector of this size can show them.
    pub fn add_fringes(
        &mut self,
        calibration: &Calibration,
        vertical: bool,
        fringes: Option<f64>,
        levels: usize,
        steps: usize,
    ) -> Result<(), Failure> {
        let (columns, rows) = calibration.raster();
        let length = if vertical { columns } else { rows };
        let fringes = fringes.unwrap_or(f64::from(length) / DEFAULT_PITCH_PX);
        let spec = match vertical {
            true => PatternSpec::Vertical { fringes },
            false => PatternSpec::Horizontal { fringes },
        };
        let function = seam::phase_function(&spec, columns as usize, rows as usize)
            .map_err(Exit::Content.failure())?;
        let shots = Sequence::geometric(function.range(), levels, steps);
        let rasters = rasters(&function, &shots, calibration)?;
        self.fringes.push(FringePattern {
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
