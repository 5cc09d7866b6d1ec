//! A recipe joined with the head's calibration. Planning can fail; judging a part with the plan
//! always ends in an inspection.

mod inspect;
mod judge;
mod layers;
pub(super) mod light;
mod patterns;
mod run;
mod steadiness;
pub(super) mod taught;
mod trial;

pub use inspect::Arriving;
pub use layers::{GoldenView, Layers, ShownDeviation, ShownGauge};
pub use trial::Golden;

use crate::head::calibration::Calibration;
use crate::head::exposing::Exposing;
use crate::head::rasters::Illumination;
use crate::recipe::file::refusal::refused;
use crate::recipe::{Conditions, Demands, Recipe, RecipeId, Refusal};
use crate::system::headway::Headway;
use algo::geometry::HeightRange;
use algo::inspect::{Production, Strips, normal_shares};
use algo::pattern::Shot;
use algo::pipeline::HeightCubics;
use light::GoldenLight;
use run::{Prepared, Run, Shared};
use std::sync::{Arc, Mutex};
use trial::OfGolden;

/// A recipe joined with the head's calibration. Of the recipe's arrays only what production reads
/// is kept.
#[derive(Debug)]
pub struct Plan {
    id: RecipeId,
    conditions: Conditions,
    /// What it demands of a part.
    demands: Demands,
    /// The light of its patterns.
    illumination: Illumination,
    /// What the rasters show, each once; those of the first run come first.
    shots: Vec<Shot>,
    /// The sequences in the order in which they are tried; each unwraps further than the one
    /// before. Methods take the index of one as `sequence`.
    runs: Vec<Run>,
    /// The buffers of an inspection, allocated once.
    strips: Mutex<Strips>,
    /// Golden's light, for parts that cannot be judged.
    golden_light: GoldenLight,
    simulated: bool,
}

/// A frame is inspected in this many strips: enough for four threads, with few rows that two strips
/// both need.
pub const STRIPS: usize = 4;
/// Heights are planned this many pixels around the taught part at least: a part that is not aligned
/// may be displaced by that.
const AROUND: usize = 16;

impl Plan {
    /// Joins a recipe and a calibration.
    ///
    /// # Errors
    /// If the recipe was made for another calibration, exposure or gain, or does not fit the head.
    pub fn new(
        recipe: Recipe,
        calibration: &Calibration,
        simulated: bool,
    ) -> Result<Self, PlanError> {
        Self::telling(recipe, calibration, simulated, Headway::silent())
    }

    /// As [`Self::new`], telling how far it is.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn telling(
        recipe: Recipe,
        calibration: &Calibration,
        simulated: bool,
        headway: Headway<'_>,
    ) -> Result<Self, PlanError> {
        let number = recipe.id.number;
        let present = calibration.fingerprint();
        if recipe.id.calibration != present {
            let digits = |fingerprint: &str| fingerprint.chars().take(8).collect();
            return Err(PlanError::OtherCalibration {
                number,
                made_for: digits(&recipe.id.calibration),
                present: digits(&present),
            });
        }
        if let Some([taught, present]) = recipe.conditions.set_otherwise(calibration) {
            return Err(PlanError::OtherExposing {
                number,
                taught,
                present,
            });
        }
        Self::join(recipe, calibration, (simulated, None), headway)
    }

    /// As [`Self::new`], to judge a recorded part again: `calibration` is read from the recording.
    /// A recording does not hold the projector's grey response, so the calibration's fingerprint
    /// cannot be computed from it and is not compared here; it was compared when the part was
    /// measured. Judging frames does not use the response.
    ///
    /// # Errors
    /// If the recipe does not fit the frames.
    pub fn again(
        recipe: Recipe,
        calibration: &Calibration,
        simulated: bool,
    ) -> Result<Self, PlanError> {
        Self::join(recipe, calibration, (simulated, None), Headway::silent())
    }

    /// Joins them, for parts or as `golden` says.
    fn join(
        recipe: Recipe,
        calibration: &Calibration,
        (simulated, golden): (bool, Option<OfGolden>),
        headway: Headway<'_>,
    ) -> Result<Self, PlanError> {
        let number = recipe.id.number;
        same_devices(&recipe.conditions, calibration)
            .map_err(|reason| PlanError::OtherHead { number, reason })?;
        Self::joined(recipe, calibration, (simulated, golden), headway)
            .map_err(|reason| PlanError::Unfit { number, reason })
    }

    fn joined(
        recipe: Recipe,
        calibration: &Calibration,
        (simulated, of_golden): (bool, Option<OfGolden>),
        headway: Headway<'_>,
    ) -> Result<Self, Refusal> {
        let Recipe {
            id,
            conditions,
            demands,
            function,
            sequences,
            mut features,
            gauges,
            mut arrays,
        } = recipe;
        // Large arrays that production does not read.
        arrays.phase_function = [].into();
        let illumination = Illumination {
            exposures: conditions.exposures,
            amplitude: arrays.amplitude.to_vec(),
        };
        arrays.height_curvature = [].into();
        let (columns, rows, _) = conditions.camera;
        let size = (columns as usize, rows as usize);
        let [low, high] = conditions.range_mm;
        // Planning asks for the rays of all pixels several times.
        let quick = calibration.clone().with_rays();
        let triangulator = quick.triangulator(function, Some(HeightRange { low, high }))?;
        headway.done(0.1);
        taught::of_sections((&mut features, &demands.features), size, &triangulator)?;
        let (window, away) =
            taught::window((&features, &gauges), size, &triangulator, &demands, &arrays);
        // The golden surface is by the sequence that is projected first, so that deviations by that
        // have no other error of golden's.
        let base = sequences.first().and_then(|first| first.offset);
        let base = base.filter(|_| !arrays.sequence_offset.is_empty());
        let surface = taught::surface(size.0, &arrays, taught::offset(&arrays, base));
        let shares = normal_shares(&triangulator, &surface);
        headway.done(0.25);
        let range = triangulator.function().range();
        let lenient = of_golden.is_some_and(|of| of.lenient);
        let signal = taught::signal(&mut arrays, &sequences, (&features, &gauges), lenient);
        let golden = (&arrays, &shares[..], base);
        let (prepared, shots) = Prepared::all(sequences, &conditions, golden, range)?;
        drop(shares);
        headway.done(0.4);
        let golden_light = GoldenLight::of(&arrays, conditions.golden_offset_counts);
        let noise_counts = taught::even_noise(conditions.noise, &arrays);
        let modulation = match demands.aligned {
            true => std::mem::take(&mut arrays.modulation),
            false => [].into(),
        };
        // Freed before the expansion of the height is allocated, which takes the most memory.
        drop(arrays);
        let full = prepared.last().ok_or("it has no sequence")?;
        let first = prepared.first().filter(|_| base.is_some());
        let captures = conditions.golden_captures;
        let golden = full.golden_noise(
            first.unwrap_or(full),
            captures,
            (&features, &gauges),
            size.0,
            &|share| headway.done(0.4 + 0.15 * share),
        );
        let range = conditions.expansion_range_turns;
        headway.done(0.55);
        let fitted = |share| headway.done(0.55 + 0.15 * share);
        let around = away.max(AROUND);
        let cubics = HeightCubics::new(&triangulator, surface, range, &window, around, &fitted);
        let triangulator = triangulator.seen_by(calibration.camera.clone());
        let shared = Shared {
            conditions: &conditions,
            demands: &demands,
            triangulator: Arc::new(triangulator),
            cubics: Arc::new(cubics),
            features,
            gauges,
            window,
            noise_counts,
            golden,
            picture: (modulation, away as f64),
            signal,
        };
        let wanted = |(at, _): &(usize, _)| of_golden.is_none_or(|of| of.sequence == *at);
        let runs = prepared
            .into_iter()
            .enumerate()
            .filter(wanted)
            .map(|(_, sequence)| {
                headway.done(0.8);
                sequence.join(&shared)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let first = runs.first().ok_or("it has no sequence")?;
        let strips = first.production.strips(size.1.div_ceil(STRIPS));
        Ok(Self {
            strips: Mutex::new(strips),
            id,
            conditions,
            demands,
            illumination,
            shots,
            runs,
            golden_light,
            simulated,
        })
    }

    /// What the recipe is called.
    pub fn id(&self) -> &RecipeId {
        &self.id
    }

    /// How the recipe's part is measured.
    pub fn conditions(&self) -> &Conditions {
        &self.conditions
    }

    /// Bytes of its maps, of its phase function and of its gauges: nearly all of its memory.
    pub fn bytes(&self) -> usize {
        let production = self.production();
        let function = production.triangulator().function();
        let samples = match function.is_sampled() {
            true => function.columns() * function.rows(),
            false => 0,
        };
        let runs: usize = self.runs.iter().map(|run| run.bytes).sum();
        let amplitude = self.illumination.amplitude.len();
        let gauges = self.strips().bytes();
        production.cubics().bytes() + samples * size_of::<f64>() + runs + amplitude + gauges
    }

    /// Number of sequences; they are tried one after the other until one is good enough.
    pub fn sequence_count(&self) -> usize {
        self.runs.len()
    }

    /// Which of the plan's rasters the frames of a sequence show; empty if there is no such
    /// sequence.
    pub fn indices(&self, sequence: usize) -> &[usize] {
        self.runs.get(sequence).map_or(&[], |run| &run.indices)
    }

    /// What each frame of a sequence shows, in their order; empty if there is no such sequence.
    pub fn shots(&self, sequence: usize) -> impl ExactSizeIterator<Item = Shot> {
        let indices = self.indices(sequence).iter();
        indices.map(|&index| self.shots[index])
    }

    /// The sequence that consists of these shots, if there is one.
    pub fn sequence_of(&self, shots: &[Shot]) -> Option<usize> {
        (0..self.sequence_count()).find(|&sequence| self.shots(sequence).eq(shots.iter().copied()))
    }

    /// What computes findings from frames of the first sequence.
    pub fn production(&self) -> &Production {
        &self.runs[0].production
    }

    /// The same by value.
    pub fn into_production(mut self) -> Production {
        self.runs.swap_remove(0).production
    }
}

/// A recipe that cannot be run on this head.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// It was made on a head with another camera or projector.
    #[error("recipe {number} was made on another head: {reason}: teach it again on this head")]
    OtherHead {
        /// The recipe's number.
        number: u16,
        /// What the head has else.
        reason: Refusal,
    },
    /// It was taught with another exposure or gain.
    #[error(
        "recipe {number} was taught with {taught}, and the camera is set to {present}, where its noise is another: set the camera as it was, or \
         teach the recipe again"
    )]
    OtherExposing {
        /// The recipe's number.
        number: u16,
        /// What it was taught with.
        taught: Exposing,
        /// What the head is set to.
        present: Exposing,
    },
    /// Something in it does not fit.
    #[error("recipe {number}: {reason}")]
    Unfit {
        /// The recipe's number.
        number: u16,
        /// Why, and which of its features is why, if one is.
        reason: Refusal,
    },
}

impl From<PlanError> for Refusal {
    fn from(error: PlanError) -> Self {
        let words = error.to_string();
        let of = match error {
            PlanError::Unfit { reason, .. } => reason.of,
            _ => None,
        };
        Self { words, of }
    }
}

/// Checks that camera and projector have the size that the recipe was made for.
///
/// # Errors
/// In words: which of them has not.
pub(super) fn same_devices(
    conditions: &Conditions,
    calibration: &Calibration,
) -> Result<(), Refusal> {
    let (camera, here) = (conditions.camera, calibration.frames());
    if camera != here {
        return refused!("it is for a camera of {camera:?}, this head's has {here:?}");
    }
    let (raster, here) = (conditions.raster, calibration.raster());
    match raster == here {
        true => Ok(()),
        false => refused!("it is for a projector of {raster:?}, this head's has {here:?}"),
    }
}
