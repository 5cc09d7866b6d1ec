//! A recipe made ready to run: from frames to an inspection without anything that can fail.

use crate::calibration::Calibration;
use crate::recipe::{GaugeKind, Recipe, SequenceKind, safe};
use crate::seam;
use crate::station::result::flag::{FULL_SEQUENCE, SIMULATED, SINGLE_LEVEL, TWO_LEVELS};
use crate::station::{GaugeValue, Inspection, StageTime, Unit, Verdict};
use algo::adaptive::Field;
use algo::frame::FrameView;
use algo::geometry::{HeightRange, Reference, Triangulator};
use algo::inspect::{Comparison, Golden, Reading};
use algo::pattern::encode;
use algo::phase::{Decoder, Trust};
use algo::pipeline::{self, HeightMap, PhaseMap};
use algo::units::{AbsolutePhase, Height};
use hal::frame::Frame;
use hal::projector::Raster;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// A recipe joined with the head's calibration.
#[derive(Debug)]
pub struct Plan {
    recipe: Recipe,
    decoder: Decoder,
    triangulator: Triangulator,
    golden: Golden,
    /// The known map for sequences that are unwrapped about one.
    map: Option<Vec<AbsolutePhase>>,
    /// The columns of each row that some gauge looks at.
    window: Vec<Range<usize>>,
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

/// What a cycle leaves for the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Pixels per row.
    pub width: usize,
    /// z in mm, NaN where not resolved.
    pub height_mm: Vec<f32>,
}

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
        let file = &recipe.file;
        let camera = (file.camera.width, file.camera.height, file.camera.bit_depth);
        if camera != calibration.camera {
            return Err(format!(
                "it is for frames {camera:?}, the camera gives {:?}",
                calibration.camera
            ));
        }
        let (camera, projector) = calibration.devices()?;
        let [low, high] = file.range_mm;
        let triangulator = Triangulator::new(
            camera,
            projector,
            Reference::Models,
            recipe.function.clone(),
            Some(HeightRange { low, high }),
        )
        .map_err(|error| error.to_string())?;
        let range = recipe.function.range();
        let decoder = Decoder::new(&recipe.sequence, range, file.camera.bit_depth)
            .map_err(|error| error.to_string())?;
        let map = decoder
            .unwrapping()
            .needs_map()
            .then(|| known_map(&recipe, &triangulator));
        let golden = golden(&recipe, &decoder);
        let window = window(&recipe);
        let flags = sequence_flag(recipe.kind) | if simulated { SIMULATED } else { 0 };
        Ok(Self {
            decoder,
            triangulator,
            golden,
            map,
            window,
            flags,
            recipe,
        })
    }

    /// The recipe.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// The columns of each row that some gauge looks at.
    pub fn window(&self) -> &[Range<usize>] {
        &self.window
    }

    /// The patterns of the sequence, in the order of its frames.
    pub fn rasters(&self, calibration: &Calibration) -> Result<Vec<Raster>, hal::error::Error> {
        let frames = self.recipe.production.iter().copied();
        rasters(&self.recipe.function, frames, calibration)
    }

    /// Judges a part from the frames of one sequence. Always ends in an inspection; what cannot be
    /// measured is INVALID with a reason.
    pub fn inspect(&self, frames: &[Frame], exposed: Instant) -> (Inspection, Option<Maps>) {
        let mut inspection = Inspection {
            flags: self.flags,
            ..Inspection::default()
        };
        let views: Result<Vec<FrameView<'_>>, _> = frames.iter().map(seam::view).collect();
        let decoded = views.map_err(|error| error.to_string()).and_then(|views| {
            pipeline::decode(
                &self.decoder,
                &views,
                self.map.as_deref(),
                Some(&self.window),
            )
            .map_err(|error| error.to_string())
        });
        let mut phases = match decoded {
            Ok(phases) => phases,
            Err(error) => {
                inspection.judged = Verdict::Invalid;
                inspection.reason = Some(error.into());
                inspection.error_code = WRONG_FRAMES;
                return (inspection, None);
            }
        };
        let mut clock = StageClock::new(exposed);
        clock.stage("phase", &mut inspection);
        let noise = Some(self.recipe.file.noise_counts);
        let guess = |place: usize, phase: AbsolutePhase| self.expand(place, phase);
        let heights = pipeline::triangulate(
            &self.triangulator,
            &self.decoder,
            noise,
            Some(&guess),
            Some(&self.window),
            &mut phases,
        );
        clock.stage("height", &mut inspection);
        self.judge(&phases, &heights, &mut inspection);
        clock.stage("gauges", &mut inspection);
        let maps = Maps {
            width: heights.width,
            height_mm: heights
                .height
                .iter()
                .map(|height| height.mm() as f32)
                .collect(),
        };
        (inspection, Some(maps))
    }

    /// The height that the golden expansion gives for a phase, inside its range.
    fn expand(&self, place: usize, phase: AbsolutePhase) -> Option<f64> {
        let arrays = &self.recipe.arrays;
        let delta = phase.turns() - arrays.golden_phase[place];
        // A NaN, where golden knows nothing, is not inside.
        (delta.abs() <= self.recipe.file.expansion_range_turns).then(|| {
            let first = f64::from(arrays.height_slope[place]);
            let second = f64::from(arrays.height_curvature[place]);
            f64::from(arrays.golden_height[place]) + delta * (first + 0.5 * delta * second)
        })
    }

    fn judge(&self, phases: &PhaseMap, heights: &HeightMap, inspection: &mut Inspection) {
        let comparison = Comparison::new(&self.golden, heights);
        for (gauge, region) in self.recipe.file.gauges.iter().zip(&self.recipe.regions) {
            let (unit, reading) = match gauge.measures {
                GaugeKind::Deviation { smoothing_px } => {
                    (Unit::Length, comparison.deviation(region, smoothing_px))
                }
                GaugeKind::Coverage => (Unit::Share, Some(comparison.coverage(region))),
            };
            let judged = GaugeValue::judged(
                &gauge.name,
                unit,
                reading.map(|reading| reading.value),
                reading.and_then(|reading: Reading| reading.sigma),
                (gauge.low, gauge.high),
            );
            // The recipe was checked for at most as many gauges as fit.
            let _ = inspection.gauges.push(judged);
        }
        let coverage = comparison.golden_coverage(&self.window);
        inspection.valid_points = phases.count(Trust::Resolved) as u32;
        inspection.coverage_permille = (coverage * 1000.0).round() as u16;
        inspection.height_noise_mm = rms(&heights.sigma, &self.golden.height);
        let taught = rms(&self.golden.sigma, &heights.height);
        let fitness = taught / inspection.height_noise_mm.max(f64::MIN_POSITIVE);
        inspection.fitness_permille = (fitness.min(1.0) * 1000.0).round() as u16;
        let missing: Vec<&str> = inspection
            .gauges
            .iter()
            .filter(|gauge| !gauge.decision.valid)
            .map(|gauge| &*gauge.name)
            .collect();
        let least = self.recipe.file.min_coverage;
        let reason = if coverage < least {
            Some(format!(
                "only {:.1} % of the taught surface is resolved, {:.1} % are needed: is the part in place \
                 and the light on?",
                coverage * 100.0,
                least * 100.0
            ))
        } else if !missing.is_empty() {
            Some(format!(
                "gauge {} found nothing to measure",
                missing.join(", ")
            ))
        } else {
            None
        };
        inspection.judged = match &reason {
            Some(_) => Verdict::Invalid,
            None if inspection.gauges.iter().all(|gauge| gauge.decision.pass) => Verdict::Pass,
            None => Verdict::Fail,
        };
        inspection.reason = reason.map(Arc::from);
    }
}

/// Error code of a cycle whose frames are not what the recipe was made for.
const WRONG_FRAMES: u16 = 103;

/// Grey rasters of frames (ratio, shift) of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &algo::pattern::PhaseFunction,
    frames: impl Iterator<Item = (f64, f64)>,
    calibration: &Calibration,
) -> Result<Vec<Raster>, hal::error::Error> {
    frames
        .map(|(ratio, shift)| {
            let grey = encode(function, ratio, shift, calibration.response.as_ref());
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        })
        .collect()
}

/// The columns of each row that some gauge looks at, its smoothing included: nothing else is
/// computed.
fn window(recipe: &Recipe) -> Vec<Range<usize>> {
    let camera = &recipe.file.camera;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut window = vec![0..0; height];
    for (gauge, region) in recipe.file.gauges.iter().zip(&recipe.regions) {
        let margin = match gauge.measures {
            GaugeKind::Deviation { smoothing_px } => smoothing_px / 2,
            GaugeKind::Coverage => 0,
        };
        for (row, columns) in region.spans() {
            let left = columns.start.saturating_sub(margin);
            let right = (columns.end + margin).min(width);
            let near = row.saturating_sub(margin)..(row + margin + 1).min(height);
            for seen in &mut window[near] {
                *seen = if seen.start == seen.end {
                    left..right
                } else {
                    seen.start.min(left)..seen.end.max(right)
                };
            }
        }
    }
    window
}

/// The map that the production sequence is unwrapped about: the golden phase. A sequence of limited
/// reach knows nothing where the placement could move the phase further. The full one also looks
/// where golden has nothing, an opening say, at the height of the surface around: material where
/// there should be none must be seen.
fn known_map(recipe: &Recipe, triangulator: &Triangulator) -> Vec<AbsolutePhase> {
    let arrays = &recipe.arrays;
    let golden = arrays.golden_phase.iter();
    let golden: Vec<_> = golden
        .map(|&turns| AbsolutePhase::from_turns(turns))
        .collect();
    if let Some(limit) = recipe.kind.reach() {
        return safe(&golden, &arrays.phase_reach, limit);
    }
    let width = recipe.file.camera.width as usize;
    let mut surface = Field {
        columns: width,
        values: arrays
            .golden_height
            .iter()
            .map(|&mm| f64::from(mm))
            .collect(),
    };
    surface.fill_rows(0.0);
    let mut map = golden;
    pipeline::for_each_row(&mut map, width, |v, row| {
        for (u, phase) in row.iter_mut().enumerate() {
            if !phase.is_known() {
                *phase = triangulator.phase_of(u, v, surface.values[v * width + u]);
            }
        }
    });
    map
}

/// The bit of RESULT's flags that says which sequence was used.
fn sequence_flag(kind: SequenceKind) -> u16 {
    match kind {
        SequenceKind::SingleLevel => SINGLE_LEVEL,
        SequenceKind::TwoLevels => TWO_LEVELS,
        SequenceKind::Full => FULL_SEQUENCE,
    }
}

/// The golden map of a recipe: heights where it is valid, and their σ from the modulation as taught.
fn golden(recipe: &Recipe, decoder: &Decoder) -> Golden {
    let arrays = &recipe.arrays;
    let full_scale = f64::from(decoder.full_scale());
    let heights = arrays.golden_height.iter().zip(&arrays.valid);
    let noises = arrays.modulation.iter().zip(&arrays.height_slope);
    Golden {
        width: recipe.file.camera.width as usize,
        height: heights
            .map(|(&mm, &valid)| {
                if valid == 1 {
                    Height::from_mm(f64::from(mm))
                } else {
                    Height::UNKNOWN
                }
            })
            .collect(),
        sigma: noises
            .map(|(&counts, &slope)| {
                let share = (f64::from(counts) / full_scale * 65_535.0).round() as u16;
                let modulation = algo::units::Modulation::from_bits(share);
                let turns = decoder.phase_noise(modulation, recipe.file.noise_counts);
                (turns * f64::from(slope).abs()) as f32
            })
            .collect(),
    }
}

/// RMS of σ over the places that a map of heights knows, 0 if there are none.
fn rms(sigma: &[f32], heights: &[Height]) -> f64 {
    let known = || {
        let pairs = sigma.iter().zip(heights);
        pairs.filter(|(sigma, height)| height.is_known() && sigma.is_finite())
    };
    let squares: f64 = known().map(|(&sigma, _)| f64::from(sigma).powi(2)).sum();
    (squares / known().count().max(1) as f64).sqrt()
}

/// Writes the times between stages into an inspection.
struct StageClock {
    last: Instant,
}

impl StageClock {
    fn new(start: Instant) -> Self {
        Self { last: start }
    }

    fn stage(&mut self, name: &'static str, inspection: &mut Inspection) {
        let now = Instant::now();
        let us = (now - self.last).as_micros().min(u128::from(u32::MAX)) as u32;
        self.last = now;
        // Three stages of at most twelve.
        let _ = inspection.stages.push(StageTime { name, us });
    }
}
