//! A recipe joined with the head's calibration. Planning can fail; judging a part with the plan
//! always ends in an inspection.

mod arriving;
mod golden;
mod judge;
mod laps;
mod layers;
mod look;
mod patterns;
mod refused;
mod rendered;
mod run;
mod trial;
pub(super) mod window;

pub use arriving::Arriving;
pub use layers::{GoldenView, Layers, Shown, ShownGauge};
pub use refused::PlanError;
pub use trial::Golden;

use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::head::seam;
use crate::recipe::light::{GoldenLight, Light};
use crate::recipe::{Conditions, Demands, Outline, Recipe, RecipeId, Refusal};
use crate::station::error_code::WRONG_FRAMES;
use crate::station::result::flag::{JUDGES_NOTHING, SIMULATED};
use crate::station::{Inspection, Stage, Verdict};
use crate::system::headway::Headway;
use algo::frame::FrameView;
use algo::geometry::HeightRange;
use algo::inspect::{Findings, Input, Maps, PairPlaced, Production, Signal, Strips, normal_shares};
use algo::pattern::{MAX_FRAMES, Shot};
use algo::pipeline::HeightCubics;
use hal::frame::Frame;
use laps::Laps;
use run::{Prepared, Run, Shared};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use trial::OfGolden;

/// A recipe joined with the head's calibration. Of the recipe's arrays only what production reads
/// is kept.
#[derive(Debug)]
pub struct Plan {
    id: RecipeId,
    conditions: Conditions,
    /// What it demands of a part.
    demands: Demands,
    /// What its gauges and features are called.
    outline: Outline,
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
        refused::same_devices(&recipe.conditions, calibration)
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
            outline,
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
        let triangulator = quick.triangulator(function, Some(HeightRange { low, high }));
        let triangulator = triangulator.map_err(|error| error.to_string())?;
        headway.done(0.1);
        window::of_sections((&mut features, &demands.features), size, &triangulator)?;
        let (window, away) =
            window::of((&features, &gauges), size, &triangulator, &demands, &arrays);
        // The golden surface is by the sequence that is projected first, so that deviations by that
        // have no other error of golden's.
        let base = sequences.first().and_then(|first| first.offset);
        let base = base.filter(|_| !arrays.sequence_offset.is_empty());
        let surface = golden::surface(size.0, &arrays, golden::offset(&arrays, base));
        let shares = normal_shares(&triangulator, &surface);
        headway.done(0.25);
        let range = triangulator.function().range();
        let lenient = of_golden.is_some_and(|of| of.lenient);
        let signal = golden::signal(&mut arrays, &sequences, (&features, &gauges), lenient);
        let golden = (&arrays, &shares[..], base);
        let (prepared, shots) = Prepared::all(sequences, &conditions, golden, range)?;
        drop(shares);
        headway.done(0.4);
        let golden_light = GoldenLight::of(&arrays, conditions.golden_offset_counts);
        let noise_counts = golden::even_noise(conditions.noise, &arrays);
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
            aligned: demands.aligned,
            triangulator: Arc::new(triangulator),
            cubics: Arc::new(cubics),
            features,
            gauges,
            window,
            noise_counts,
            golden,
            picture: (modulation, away as f64),
            names: &demands.features,
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
            outline,
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

    /// Judges a part from the frames of a sequence; the times of its stages begin at `exposed`. A
    /// part that cannot be measured is INVALID with a reason.
    pub fn inspect(&self, sequence: usize, frames: &[Frame], exposed: Instant) -> Inspection {
        self.inspect_arrived(frames, self.arriving(sequence), exposed)
    }

    /// As [`Self::inspect`], with the levels that were decoded on arrival.
    pub fn inspect_arrived(
        &self,
        frames: &[Frame],
        arriving: Arriving,
        exposed: Instant,
    ) -> Inspection {
        let sequence = arriving.sequence();
        let mut laps = Laps::since(exposed);
        let of = (arriving, frames);
        let found = self.run(&mut self.strips(), of, Maps::default(), &mut laps);
        self.judged((sequence, frames), found, &mut laps)
    }

    /// The inspection by the findings of the frames of a sequence, or by why there are none.
    fn judged(
        &self,
        (sequence, frames): (usize, &[Frame]),
        found: Result<(Findings, Option<f64>), Refusal>,
        laps: &mut Laps,
    ) -> Inspection {
        let simulated = if self.simulated { SIMULATED } else { 0 };
        let nothing = match self.demands.judges_nothing {
            true => JUDGES_NOTHING,
            false => 0,
        };
        let kind = self.runs.get(sequence).map(|run| run.kind);
        let mut inspection = Inspection {
            flags: kind.map_or(0, judge::sequence_flag) | simulated | nothing,
            ..Inspection::default()
        };
        match found {
            Ok((findings, likeness)) => {
                self.demands.judge(&findings, &mut inspection);
                if sequence + 1 < self.runs.len() {
                    let unlike = likeness.is_some_and(|likeness| likeness < judge::ALIKE);
                    inspection.step_up = match unlike {
                        true => Some("the picture differs from that of the taught part"),
                        false => self.demands.step_up(&findings, &inspection),
                    };
                }
                if inspection.step_up.is_none() && Demands::doubts_the_light(&inspection) {
                    let light = self.light(sequence, frames);
                    self.demands.explain(light, &mut inspection);
                }
            }
            Err(reason) => {
                inspection.judged = Verdict::Invalid;
                inspection.reason = Some(reason.words.into());
                inspection.error_code = WRONG_FRAMES;
            }
        }
        laps.end(Stage::Judgement);
        inspection.stages = laps.stages.clone();
        inspection
    }

    /// The light of a part from the frames of a sequence; none if the frames do not fit.
    fn light(&self, sequence: usize, frames: &[Frame]) -> Option<Light> {
        let full_scale = self.runs.get(sequence)?.production.decoder().full_scale();
        let modulation = self.modulation(sequence, frames)?;
        let views: Result<Vec<FrameView<'_>>, _> = frames.iter().map(seam::view).collect();
        Light::of(&self.golden_light, &views.ok()?, (&modulation, full_scale))
    }

    /// The buffers of an inspection.
    fn strips(&self) -> MutexGuard<'_, Strips> {
        // A poisoned lock does no harm: strips are cleared before they are used.
        self.strips.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The findings from the frames of a sequence, and of two frames how much the picture is like
    /// golden's.
    fn run(
        &self,
        strips: &mut Strips,
        (arriving, frames): (Arriving, &[Frame]),
        maps: Maps<'_>,
        laps: &mut Laps,
    ) -> Result<(Findings, Option<f64>), Refusal> {
        let sequence = arriving.sequence();
        let run = self.runs.get(sequence);
        let run = run.ok_or_else(|| format!("the recipe has no sequence {sequence}"))?;
        // On the stack: a trigger allocates nothing.
        let mut views: heapless::Vec<FrameView<'_>, MAX_FRAMES> = heapless::Vec::new();
        for frame in frames {
            let view = seam::view(frame).map_err(|error| error.to_string())?;
            let full = |_| format!("{} frames are more than any sequence has", frames.len());
            views.push(view).map_err(full)?;
        }
        let production = &run.production;
        if let Some(buffers) = &run.pair {
            let mut buffers = buffers.lock().unwrap_or_else(PoisonError::into_inner);
            let placed = production.place_pair(&views, strips, &mut buffers);
            laps.end(Stage::Alignment);
            let findings = placed.and_then(|PairPlaced { found, placed }| {
                let input = (Input::Phases(buffers.phases()), Signal::None);
                let findings = production.inspect_placed(input, strips, placed, maps)?;
                Ok((findings, Some(found.map_or(0.0, |found| found.likeness))))
            });
            laps.end(Stage::Strips);
            return findings.map_err(|error| error.to_string().into());
        }
        let (arrived, finest) = run.complete(arriving, &views).map_err(|e| e.to_string())?;
        let input = Input::Finest(&arrived, &finest);
        let placed = production.place(input, strips);
        laps.end(Stage::Alignment);
        let findings = placed
            .and_then(|placed| {
                let input = (input, Signal::Frames(&views));
                production.inspect_placed(input, strips, placed, maps)
            })
            .map_err(|error| error.to_string());
        laps.end(Stage::Strips);
        run.keep(arrived);
        Ok((findings?, None))
    }
}
