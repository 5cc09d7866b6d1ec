//! Measures a recording: phase, height and report (`fringed measure`).

mod coded;
mod known;
pub mod models;
mod report;

pub use report::{GROSS_MM, Manner, MeasurementReport, Score, Truth};

use crate::error::{Exit, Failure, Result};
use crate::head::channel::{Channel, Expected, NoHeights, Unwrapping};
use crate::head::direction::Sensitivity;
use crate::head::scan::Scan;
use crate::head::seam;
use crate::output::cloud::Surface;
use crate::recipe::Recipe;
use algo::adaptive::ProjectorMap;
use algo::frame::SampleNoise;
use algo::geometry::{HeightRange, Pinhole, Reference, RigError, Triangulator};
use algo::pattern::{PhaseFunction, Shot};
use algo::phase::{Decoder, LeastModulation};
use algo::pipeline::{self, PhaseMap};
use hal::npy::Array;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecipeReference};
use known::Known;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;
use std::time::Instant;

/// What is wrong with a recording without patterns.
const NO_PATTERN: &str = "the recording has no pattern";

/// A measured recording.
#[derive(Debug)]
pub struct MeasuredRecording {
    /// The absolute phase of each pattern of the recording; without any phase where `wrapped_only`
    /// says why.
    pub phases: Vec<PhaseMap>,
    /// The wrapped phase of each pattern's finest level, in turns of that level, with its
    /// modulation and trust.
    pub wrapped: Vec<PhaseMap>,
    /// For each pattern why it has no absolute phase; `None` if it has one.
    pub wrapped_only: Vec<Option<String>>,
    /// Which of the patterns the height comes from.
    pub primary: usize,
    /// Height and σ_z, or why there is none.
    pub heights: Result<Surface, NoHeights>,
    /// How the primary pattern was decoded; none of a Gray code alone.
    pub decoder: Option<Decoder>,
    /// What the frames of the primary pattern show that this decoder takes.
    pub shots: Vec<Shot>,
    /// Largest sample.
    pub full_scale: u16,
    /// Of Gray codes alone, for each pattern what it numbers, "column" or "row", and projector
    /// pixels per turn.
    pub places: Vec<(&'static str, f64)>,
    /// The summary.
    pub report: MeasurementReport,
    /// Mean of the finest level's frames of the primary pattern, scaled to 8 bits.
    pub intensity: Vec<u8>,
}

/// Measures every pattern of a recording. The one whose phase changes most with the height gives
/// the heights, without models the first vertical one.
///
/// # Errors
/// If levels cannot be unwrapped or a model is absurd; the message names `folder`.
pub fn measure(recording: &Recording, folder: &Path) -> Result<MeasuredRecording> {
    measure_with(recording, folder, None)
}

/// As [`measure`], with levels that need a map unwrapped about the phase that a preliminary
/// measurement of the part predicts.
///
/// # Errors
/// As for [`measure`], and if the preliminary map is of frames of another size.
pub fn measure_after(
    recording: &Recording,
    folder: &Path,
    preliminary: &ProjectorMap,
) -> Result<MeasuredRecording> {
    let known = Known::expected(preliminary, recording).map_err(wrong(folder))?;
    measure_about(recording, folder, None, Some(known))
}

/// As [`measure`], with levels that need a map unwrapped about this one: Φ in turns, NaN where it
/// is not known.
///
/// # Errors
/// As for [`measure`], and if the map has not the size of the frames.
pub fn measure_about_map(
    recording: &Recording,
    folder: &Path,
    map: &Array<f64>,
) -> Result<MeasuredRecording> {
    let known = Known::given(map, recording).map_err(wrong(folder))?;
    measure_about(recording, folder, None, Some(known))
}

/// As [`measure`], with a recipe: the height comes from the recipe's pattern, and levels that need
/// a map are unwrapped about its golden phase instead of the reference map. The least modulation is
/// the recipe's, and noise and working range are where the recording has none.
///
/// # Errors
/// As for [`measure`], and if the recipe is of another pattern or of frames of another size.
pub fn measure_with(
    recording: &Recording,
    folder: &Path,
    recipe: Option<&Recipe>,
) -> Result<MeasuredRecording> {
    let known = recipe.map(|recipe| Known::of(recipe, recording));
    let known = known.transpose().map_err(wrong(folder))?;
    measure_about(recording, folder, recipe, known)
}

/// The failure of a recording with wrong content, in this folder.
pub fn wrong<E: Display>(folder: &Path) -> impl Fn(E) -> Failure {
    let manifest = folder.join("recording.json");
    Exit::Content.because(manifest.display().to_string())
}

fn measure_about(
    recording: &Recording,
    folder: &Path,
    recipe: Option<&Recipe>,
    known: Option<Known>,
) -> Result<MeasuredRecording> {
    let measured = match (recording.frames.is_empty(), &known) {
        (false, _) => of_fringes(recording, recipe, known.as_ref()),
        (true, None) => coded::measure(recording),
        (true, Some(_)) => Exit::Content.fail("it has a Gray code without fringes, which needs no expected phase: measure without one"),
    };
    measured.map_err(wrong(folder))
}

/// How long the stages of a measurement take, µs.
#[derive(Default)]
struct StageTimes(BTreeMap<&'static str, u64>);

impl StageTimes {
    /// Carries out one part of a stage.
    fn time<T>(&mut self, stage: &'static str, part: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let done = part();
        let us = u64::try_from(started.elapsed().as_micros()).unwrap_or(u64::MAX);
        *self.0.entry(stage).or_default() += us;
        done
    }
}

/// One pattern of a recording: its frames, what makes heights of it, and how it is unwrapped.
struct Pattern<'a> {
    channel: Channel<'a>,
    geometry: Result<Triangulator, NoHeights>,
    unwrapping: Unwrapping,
}

impl<'a> Pattern<'a> {
    fn new(channel: Channel<'a>, devices: &RecordedRig, known: Option<&Known>) -> Result<Self> {
        let geometry = devices.triangulator(&channel.function);
        let geometry = geometry.map_err(Exit::Content.failure())?;
        let known = known.map(|known| known as &dyn Expected);
        let unwrapping = channel.unwrapping(known, &geometry)?;
        Ok(Self {
            channel,
            geometry,
            unwrapping,
        })
    }

    /// How its phase changes with the height, where there are both.
    fn sensitivity(&self) -> Option<Sensitivity> {
        match self.unwrapping.missing() {
            None => Sensitivity::of(self.geometry.as_ref().ok()?),
            Some(_) => None,
        }
    }

    /// σ of a sample in counts, as stated or as the frames show it, and by light.
    fn noise(
        &self,
        recording: &Recording,
        recipe: Option<&Recipe>,
        phases: &PhaseMap,
    ) -> (Option<f64>, Option<SampleNoise>) {
        let stated = recording.noise_counts;
        let stated = stated.or_else(|| recipe.map(|recipe| recipe.conditions.noise_counts));
        let noise = stated.or_else(|| {
            let Scan {
                sequence,
                frames,
                decoder,
                ..
            } = &self.channel.scan;
            pipeline::sample_noise(sequence, frames, decoder.full_scale(), &phases.trust)
        });
        let by_light = match (recording.noise_counts, recipe) {
            (None, Some(recipe)) => Some(recipe.conditions.noise),
            _ => noise.map(SampleNoise::constant),
        };
        (noise, by_light)
    }
}

fn of_fringes(
    recording: &Recording,
    recipe: Option<&Recipe>,
    known: Option<&Known>,
) -> Result<MeasuredRecording> {
    let devices = RecordedRig::of(recording, recipe)?;
    let mut stages = StageTimes::default();
    let least = recipe.map(|recipe| recipe.conditions.least_modulation);
    let least = least.unwrap_or_else(|| least_modulation(recording));
    let (mut patterns, mut phases, mut wrapped) = (Vec::new(), Vec::new(), Vec::new());
    for at in 0..recording.patterns.len() {
        let channel = Channel::new(recording, at, least)?;
        let known = known.filter(|known| known.pattern == at);
        let pattern = stages.time("map", || Pattern::new(channel, &devices, known))?;
        let decoded = stages.time("phase", || pattern.channel.decode(&pattern.unwrapping))?;
        phases.push(decoded.absolute);
        wrapped.push(decoded.wrapped);
        patterns.push(pattern);
    }
    let missing = |pattern: &Pattern<'_>| pattern.unwrapping.missing().map(str::to_owned);
    let wrapped_only: Vec<_> = patterns.iter().map(missing).collect();
    let sensitivities: Vec<_> = patterns.iter().map(Pattern::sensitivity).collect();
    let primary = match known {
        Some(known) => known.pattern,
        None => primary_of(recording, &sensitivities),
    };
    if patterns.len() <= primary {
        return Exit::Content.fail(NO_PATTERN);
    }
    let pattern = patterns.swap_remove(primary);
    let map = &mut phases[primary];
    let (noise, by_light) = stages.time("noise", || pattern.noise(recording, recipe, map));
    let Pattern {
        channel,
        geometry,
        unwrapping,
    } = pattern;
    let ambiguous = unwrapping.ambiguity(&channel, &geometry);
    let geometry = match (geometry, unwrapping.missing()) {
        (Ok(_), Some(_)) => Err("there is no absolute phase".into()),
        (geometry, _) => geometry,
    };
    let heights = stages.time("height", || {
        geometry.map(|triangulator| Surface {
            map: channel.scan.heights(&triangulator, by_light, map, &|_| ()),
            triangulator,
        })
    });
    let report = MeasurementReport::new(
        map,
        &heights,
        Manner {
            kind: unwrapping.kind(&channel),
            ratios: channel.ratios(),
            chain: unwrapping.steps(),
            map: unwrapping.map(),
            recipe: recipe.map(|recipe| RecipeReference {
                number: u32::from(recipe.id.number),
                fingerprint: recipe.id.fingerprint.clone(),
            }),
        },
        noise,
        &Truth::of(recording),
        stages.0,
    );
    let report = MeasurementReport {
        no_phase: wrapped_only[primary].clone(),
        notes: recording.notes.clone(),
        ambiguous,
        ..report.by(recording, primary, sensitivities[primary])
    };
    Ok(MeasuredRecording {
        intensity: channel.intensity(),
        phases,
        wrapped,
        wrapped_only,
        primary,
        heights,
        full_scale: channel.scan.decoder.full_scale(),
        decoder: Some(channel.scan.decoder),
        shots: channel.shots,
        places: Vec::new(),
        report,
    })
}

/// The least modulation that is trusted in a recording: that of its noise where it is stated.
pub fn least_modulation(recording: &Recording) -> LeastModulation {
    let of_noise = |noise| LeastModulation::of_noise(noise, recording.bit_depth);
    recording.noise_counts.map(of_noise).unwrap_or_default()
}

/// The pattern that gives the height: that whose phase changes most with it, else the first
/// vertical one, else the first.
fn primary_of(recording: &Recording, sensitivities: &[Option<Sensitivity>]) -> usize {
    let mut best = (0.0, vertical_of(recording));
    for (at, found) in sensitivities.iter().enumerate() {
        let slope = found.map_or(0.0, |found| found.turns_per_mm);
        if slope > best.0 {
            best = (slope, at);
        }
    }
    best.1
}

/// The first vertical pattern, else the first.
fn vertical_of(recording: &Recording) -> usize {
    let vertical = |spec: &PatternSpec| matches!(spec, PatternSpec::Vertical { .. });
    recording.patterns.iter().position(vertical).unwrap_or(0)
}

/// The devices of a recording, where it has models of them, and its working range.
pub struct RecordedRig {
    devices: Result<(Pinhole, Pinhole, Reference), NoHeights>,
    range: Option<HeightRange>,
}

impl RecordedRig {
    /// The devices of this recording; the working range is the recipe's where the recording has
    /// none.
    ///
    /// # Errors
    /// A model is absurd.
    pub fn of(recording: &Recording, recipe: Option<&Recipe>) -> Result<Self> {
        let projector = &recording.projector;
        let frames = (recording.width, recording.height);
        let raster = (projector.width, projector.height);
        let plane = &projector.plane;
        let devices = match (&recording.camera_model, &projector.model) {
            (Some(camera), Some(projector)) => Ok((
                seam::pinhole("camera", camera, frames)?,
                seam::pinhole("projector", projector, raster)?,
                seam::reference(plane.as_ref(), frames),
            )),
            (None, None) => Err("the recording has no model of camera and projector"),
            (None, _) => Err("the recording has no model of the camera"),
            (_, None) => Err("the recording has no model of the projector"),
        };
        Ok(Self {
            devices: devices.map_err(NoHeights::from),
            range: recording
                .range_mm
                .or_else(|| recipe.map(|recipe| recipe.conditions.range_mm))
                .map(|[low, high]| HeightRange { low, high }),
        })
    }

    /// What makes heights of this phase function's phases.
    ///
    /// # Errors
    /// The inner one says which model is missing, the outer one what is wrong with those that are
    /// there.
    pub fn triangulator(
        &self,
        function: &PhaseFunction,
    ) -> Result<Result<Triangulator, NoHeights>, RigError> {
        match &self.devices {
            Err(missing) => Ok(Err(*missing)),
            Ok((camera, projector, reference)) => Triangulator::new(
                camera.clone(),
                projector.clone(),
                reference.clone(),
                function.clone(),
                self.range,
            )
            .map(Ok),
        }
    }
}
