//! A recipe made ready to run: from frames to an inspection without anything that can fail.

mod golden;
mod judge;
mod layers;
mod window;

pub use layers::Layers;

use crate::calibration::Calibration;
use crate::recipe::{GaugeKind, Recipe, RecipeFile, SequenceKind, short};
use crate::seam;
use crate::station::result::flag::{FULL_SEQUENCE, SIMULATED, SINGLE_LEVEL, TWO_LEVELS};
use crate::station::{Inspection, StageTime, Verdict};
use algo::frame::FrameView;
use algo::geometry::{HeightRange, Reference, Triangulator};
use algo::inspect::{Measure, Production, Strip};
use algo::pattern::{Sequence, encode};
use algo::phase::Decoder;
use algo::pipeline::Rises;
use algo::units::AbsolutePhase;
use hal::frame::Frame;
use hal::projector::Raster;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// A recipe joined with the head's calibration. Of the recipe's arrays only what production needs is kept.
#[derive(Debug)]
pub struct Plan {
    file: RecipeFile,
    sequence: Sequence,
    frames: Vec<(f64, f64)>,
    production: Production,
    /// The buffers of a cycle, made once.
    strips: Mutex<Vec<Strip>>,
    flags: u16,
}

/// A recipe that cannot be run on this head.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
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
    /// Something in it does not fit.
    #[error("recipe {number}: {reason}")]
    Unfit {
        /// The recipe's number.
        number: u16,
        /// In words, with the remedy.
        reason: String,
    },
}

/// The heights of a part, for the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Pixels per row.
    pub width: usize,
    /// z in mm, NaN where not resolved.
    pub height_mm: Vec<f32>,
}

/// A frame is inspected in this many strips: work for four threads, and few rows that two of them need.
pub const STRIPS: usize = 4;
/// Error code of a cycle whose frames are not what the recipe was made for.
const WRONG_FRAMES: u16 = 103;

impl Plan {
    /// Joins a recipe and a calibration.
    ///
    /// # Errors
    /// If the recipe was made for another calibration or does not fit the head.
    pub fn new(
        recipe: Recipe,
        calibration: &Calibration,
        simulated: bool,
    ) -> Result<Self, PlanError> {
        let number = recipe.file.number;
        let present = calibration.fingerprint();
        if recipe.file.calibration != present {
            let digits = |fingerprint: &str| fingerprint.chars().take(8).collect();
            return Err(PlanError::OtherCalibration {
                number,
                made_for: digits(&recipe.file.calibration),
                present: digits(&present),
            });
        }
        Self::join(recipe, calibration, simulated)
            .map_err(|reason| PlanError::Unfit { number, reason })
    }

    fn join(recipe: Recipe, calibration: &Calibration, simulated: bool) -> Result<Self, String> {
        let Recipe {
            file,
            mut arrays,
            function,
            kind,
            production: frames,
            sequence,
            regions,
        } = recipe;
        arrays.phase_function = Vec::new();
        let camera = (file.camera.width, file.camera.height, file.camera.bit_depth);
        if camera != calibration.camera {
            return Err(format!(
                "it is for frames {camera:?}, the camera gives {:?}",
                calibration.camera
            ));
        }
        let decoder = Decoder::new(&sequence, function.range(), file.camera.bit_depth)
            .map_err(|error| error.to_string())?;
        let (camera, projector) = calibration.devices()?;
        let [low, high] = file.range_mm;
        let range = Some(HeightRange { low, high });
        let triangulator = Triangulator::new(camera, projector, Reference::Models, function, range)
            .map_err(|error| error.to_string())?;
        let window = window::of(&file, &regions);
        let taught = golden::taught(&file, &mut arrays, &decoder);
        let surface = golden::surface(&file, arrays, kind, &triangulator);
        let rises = Rises::new(&triangulator, surface, file.expansion_range_turns, &window);
        let measures = file.gauges.iter().map(|gauge| match gauge.measures {
            GaugeKind::Deviation { smoothing_px } => Measure::Deviation { side: smoothing_px },
            GaugeKind::Coverage => Measure::Coverage,
        });
        let production = Production::new(
            decoder,
            triangulator,
            rises,
            taught,
            regions.into_iter().zip(measures).collect(),
            window,
            file.noise_counts,
        )
        .map_err(|error| error.to_string())?;
        let rows = (file.camera.height as usize).div_ceil(STRIPS);
        Ok(Self {
            strips: Mutex::new(production.strips(rows)),
            production,
            file,
            sequence,
            frames,
            flags: sequence_flag(kind) | if simulated { SIMULATED } else { 0 },
        })
    }

    /// The recipe's manifest.
    pub fn file(&self) -> &RecipeFile {
        &self.file
    }

    /// First 32 bits of the recipe's fingerprint.
    pub fn crc(&self) -> u32 {
        short(&self.file.fingerprint)
    }

    /// Levels and shifts of the sequence that is projected.
    pub fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// Ratio and shift of each frame of the sequence that has `count` frames, in their order; empty if there is none.
    pub fn shown(&self, count: usize) -> Vec<(f64, f64)> {
        if self.frames.len() == count {
            self.frames.clone()
        } else {
            Vec::new()
        }
    }

    /// The columns of each row that some gauge looks at.
    pub fn window(&self) -> &[Range<usize>] {
        self.production.window()
    }

    /// The phase as taught, row-major.
    pub fn golden_phase(&self) -> &[AbsolutePhase] {
        &self.production.rises().surface().phase
    }

    /// From frames to findings.
    pub fn production(&self) -> &Production {
        &self.production
    }

    /// The same, for its own sake.
    pub fn into_production(self) -> Production {
        self.production
    }

    /// The patterns of the sequence, in the order of its frames.
    pub fn rasters(&self, calibration: &Calibration) -> Result<Vec<Raster>, hal::error::Error> {
        let frames = self.frames.iter().copied();
        let function = self.production.triangulator().function();
        rasters(function, frames, calibration)
    }

    /// Judges a part from the frames of one sequence. Always ends in an inspection; what cannot be
    /// measured is INVALID with a reason.
    pub fn inspect(&self, frames: &[Frame], exposed: Instant) -> Inspection {
        let mut inspection = Inspection {
            flags: self.flags,
            ..Inspection::default()
        };
        match self.run(frames, None) {
            Ok(findings) => judge::judge(&self.file, &findings, &mut inspection),
            Err(reason) => {
                inspection.judged = Verdict::Invalid;
                inspection.reason = Some(reason.into());
                inspection.error_code = WRONG_FRAMES;
            }
        }
        let us = exposed.elapsed().as_micros().min(u128::from(u32::MAX)) as u32;
        // The first of at most twelve.
        let _ = inspection.stages.push(StageTime { name: "strips", us });
        inspection
    }

    /// The heights of the part, for somebody who wants to see them; `None` if the frames are not what the recipe was made
    /// for.
    pub fn heights(&self, frames: &[Frame]) -> Option<Maps> {
        let width = self.file.camera.width as usize;
        let mut height_mm = vec![f32::NAN; width * self.file.camera.height as usize];
        self.run(frames, Some(&mut height_mm)).ok()?;
        Some(Maps { width, height_mm })
    }

    fn run(
        &self,
        frames: &[Frame],
        heights: Option<&mut [f32]>,
    ) -> Result<algo::inspect::Findings, String> {
        let views: Result<Vec<FrameView<'_>>, _> = frames.iter().map(seam::view).collect();
        let views = views.map_err(|error| error.to_string())?;
        // A strip is cleared before it is used, whatever was left in it.
        let mut strips = self.strips.lock().unwrap_or_else(PoisonError::into_inner);
        self.production
            .inspect(&views, &mut strips, heights)
            .map_err(|error| error.to_string())
    }
}

/// Grey rasters of frames (ratio, shift) of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &algo::pattern::PhaseFunction,
    frames: impl Iterator<Item = (f64, f64)>,
    calibration: &Calibration,
) -> Result<Vec<Raster>, hal::error::Error> {
    let frames: Vec<_> = frames.collect();
    frames
        .into_par_iter()
        .map(|(ratio, shift)| {
            let grey = encode(function, ratio, shift, calibration.response.as_ref());
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        })
        .collect()
}

/// The bit of RESULT's flags that says which sequence was used.
fn sequence_flag(kind: SequenceKind) -> u16 {
    match kind {
        SequenceKind::SingleLevel => SINGLE_LEVEL,
        SequenceKind::TwoLevels => TWO_LEVELS,
        SequenceKind::Full => FULL_SEQUENCE,
    }
}
