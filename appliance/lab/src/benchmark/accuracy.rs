//! Run time against error: processor time and height error of each implementation, sequence and bit
//! depth on the simulated parts.

use super::kernel::{Decoding, decoders};
use super::timing::{Effort, Floor, FrameSet, FrameSets, Kernel, Round, interleaved, median};
use crate::Failed;
use crate::experiment::{BetterSequence, Method, OpticsKind, Runner, Scene};
use algo::pattern::{Level, PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::{self, PhaseMap};
use algo::units::{AbsolutePhase, Modulation};
use appliance::head::calibrated::MeasuredPart;
use appliance::measure::{Score, Truth};
use appliance::system::computing::timed;
use hal::frame::Frame;
use scenes::oracle::unwrap::recognise;
use scenes::oracle::{PixelTwin, Scale, levels_from};
use serde::Serialize;
use std::ops::Range;
use std::time::Duration;

/// What is measured, and how thoroughly.
#[derive(Clone, Debug)]
pub struct Study {
    /// Names of the simulated parts.
    pub parts: Vec<&'static str>,
    /// Columns and rows of the simulated camera.
    pub camera: u32,
    /// Bits of the camera's samples.
    pub bit_depths: Vec<u8>,
    /// How long times are measured; the size that it states is used for the floor.
    pub effort: Effort,
}

/// One implementation on one sequence, or the mean over the parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The part; `mean` over all.
    pub part: &'static str,
    /// `f64`, the textbook, or the back-end of the decoder.
    pub implementation: &'static str,
    /// `fixed` with geometric levels, or `better` with dense ones or a single one.
    pub sequence: &'static str,
    /// Frames of a set.
    pub frames: usize,
    /// Shifts of the finest level, N.
    #[serde(rename = "steps")]
    pub shifts: usize,
    /// Bits of a sample.
    pub bits: u8,
    /// Whether rows in which the part is not seen are skipped.
    pub skipping: bool,
    /// Processor time of the decoding per pixel of a frame.
    pub ns_per_px: f64,
    /// Processor time of the decoding, in floors.
    pub x_floor: f64,
    /// Processor time of the decoding of a set, ms.
    pub ms_per_set: f64,
    /// RMS error of the height without gross errors, mm.
    pub rms_mm: f64,
    /// Wholly lit pixels that are not resolved.
    pub unresolved_px: f64,
    /// Errors above 1 mm.
    pub gross_px: f64,
}

impl Point {
    /// Whether both points are of the same pattern, frames and depth.
    pub fn same_frames(&self, other: &Self) -> bool {
        (self.sequence, self.frames, self.shifts, self.bits)
            == (other.sequence, other.frames, other.shifts, other.bits)
    }
}

/// The noise of all measurements.
const SEED: u64 = 1;

/// 100 fringes, three geometric levels of sines.
const FIXED: Method = Method::Fixed { fringes: 100 };

/// The methods that are compared, and the frames of each.
const SEQUENCES: [(Method, usize); 10] = [
    (FIXED, 9),
    (FIXED, 12),
    (FIXED, 24),
    better(24),
    better(12),
    better(9),
    better(6),
    better(5),
    better(4),
    better(3),
];

/// A pattern made for the part, with a sequence of the experiments.
const fn better(frames: usize) -> (Method, usize) {
    (Method::Better(BetterSequence::new(frames)), frames)
}

impl Study {
    /// For figures that are quoted.
    pub fn full() -> Self {
        Self {
            parts: vec!["cone", "sawtooth", "sphere", "spline"],
            camera: 512,
            bit_depths: vec![8, 10, 12],
            // Shorter for each than the kernels' effort: there are ten sequences of three depths on
            // four parts.
            effort: Effort {
                rounds: 5,
                patience: Duration::from_millis(15),
                ..Effort::FULL
            },
        }
    }

    /// For checking that everything works; the times mean nothing.
    pub fn quick() -> Self {
        Self {
            parts: vec!["cone"],
            camera: 64,
            bit_depths: vec![8],
            effort: Effort::QUICK,
        }
    }

    /// Measures all, a point for each part and implementation.
    ///
    /// # Errors
    /// If something cannot be simulated or decoded.
    pub fn run(&self, progress: &dyn Fn(f64, &str)) -> Result<Vec<Point>, Failed> {
        let mut floor = Floor::new(&self.effort);
        let mut points = Vec::new();
        let total = (self.parts.len() * self.bit_depths.len() * SEQUENCES.len()) as f64;
        let mut done = 0.0;
        for &part in &self.parts {
            for &bit_depth in &self.bit_depths {
                let scene = Scene::named(part).ok_or("there is no such part")?;
                let scene = Scene {
                    camera: self.camera,
                    bit_depth,
                    ..scene
                };
                let mut runner = Runner::new(&scene, OpticsKind::Sharp)?;
                for (method, frames) in SEQUENCES {
                    let words = format!("{part}, {bit_depth} bit, {}-{frames}", word(method));
                    progress(done / total, &words);
                    let compared = self.compare(&mut runner, (method, frames), &scene, &mut floor);
                    points.extend(compared?);
                    done += 1.0;
                }
            }
        }
        Ok(points)
    }

    fn compare(
        &self,
        runner: &mut Runner,
        (method, frames): (Method, usize),
        scene: &Scene,
        floor: &mut Floor,
    ) -> Result<Vec<Point>, Failed> {
        let shots = |range| match method {
            Method::Better(sequence) => sequence.shots(),
            _ => Ok(Sequence::geometric(range, 3, frames / 3)),
        };
        let known = |range| shots(range).unwrap_or_default();
        let (measured, map) = runner.measure_with(method, known, SEED)?;
        let bits = scene.bit_depth;
        let range = measured.triangulator.function().range();
        let shots = shots(range)?;
        let sequence = Sequence::from_frames(&shots)?;
        let set = FrameSet::new(measured.frames.clone(), map);
        let truth = runner.truth();
        let (pixels, width) = (set.pixels(), set.out.width);
        let mut turns = Vec::new();
        let taken = timed(|| turns = textbook(&set, &shots, range, bits).unwrap_or_default());
        let textbook_ns = taken.as_secs_f64() * 1e9 / pixels.max(1) as f64;
        let mut variants = Vec::new();
        let mut kernels = Vec::new();
        for (name, decoder) in decoders(&sequence, range, bits)? {
            for window in [None, Some(rows_seen(truth, width))] {
                variants.push((name, window.is_some()));
                kernels.push(Decoding::new(decoder.clone(), window));
            }
        }
        let mut sets = FrameSets::of(set, self.effort.bytes);
        let rounds = interleaved(&mut kernels, &mut sets, floor, &self.effort)?;
        let lit = Truth::from(truth).whole_pixels().count();
        let point = |(implementation, skipping), turns: &[f64], ns_per_px, x_floor| {
            let score = score(&measured, truth, turns);
            let figure = |figure: &dyn Fn(&Score) -> f64| score.as_ref().map_or(f64::NAN, figure);
            Point {
                part: scene.name,
                implementation,
                sequence: word(method),
                frames,
                shifts: sequence.levels().last().map_or(0, Level::shifts),
                bits,
                skipping,
                ns_per_px,
                x_floor,
                ms_per_set: ns_per_px * pixels as f64 / 1e6,
                rms_mm: figure(&|score| score.rms_mm),
                unresolved_px: figure(&|score| (lit - score.scored) as f64),
                gross_px: figure(&|score| score.gross as f64),
            }
        };
        let floors = rounds.iter().take(1).flatten().map(|round| round.floor);
        let x_floor = textbook_ns / median(floors.collect());
        let mut points = vec![point(("f64", false), &turns, textbook_ns, x_floor)];
        for ((variant, kernel), rounds) in variants.into_iter().zip(&mut kernels).zip(rounds) {
            let set = sets.next();
            kernel.run(set);
            let ns_per_px = median(rounds.iter().map(|round| round.kernel).collect());
            let x_floor = median(rounds.iter().map(Round::x_floor).collect());
            points.push(point(variant, &set.turns(), ns_per_px, x_floor));
        }
        Ok(points)
    }
}

/// The sequence of a point.
fn word(method: Method) -> &'static str {
    match method {
        Method::Better(_) => "better",
        _ => "fixed",
    }
}

/// Φ of every pixel in turns as the textbook decodes it in `f64`, NaN where it is rejected; `None` if
/// the levels have no known form.
fn textbook(set: &FrameSet, shots: &[Shot], range: PhaseRange, bits: u8) -> Option<Vec<f64>> {
    let shots = shots.iter().enumerate();
    let levels = levels_from(shots.map(|(frame, shot)| (frame, shot.ratio, shot.shift)));
    let ratios: Vec<f64> = levels.iter().map(|level| level.ratio).collect();
    let form = recognise(&ratios, (range.min, range.max))?;
    let scale = Scale::of(bits, None);
    let frames: Vec<Vec<f32>> = set.frames.iter().map(Frame::counts).collect();
    let decode = |pixel: usize| {
        let samples = levels.iter().map(|level| {
            let samples = level.frames.iter();
            samples
                .map(|&frame| f64::from(frames[frame][pixel]))
                .collect()
        });
        let samples: Vec<Vec<f64>> = samples.collect();
        let map = || match &set.map {
            Some(map) if map[pixel].is_known() => map[pixel].turns(),
            _ => f64::NAN,
        };
        PixelTwin::of(form, &levels, &samples, scale, map).phase
    };
    Some((0..set.pixels()).map(decode).collect())
}

/// The columns of each row to decode: all where the part is seen, none elsewhere.
fn rows_seen(truth: &sim::Truth, width: usize) -> Vec<Range<usize>> {
    let rows = truth.class.chunks(width.max(1));
    let seen = rows.map(|row| row.iter().any(|&class| class > 0));
    seen.map(|seen| if seen { 0..width } else { 0..0 })
        .collect()
}

/// The heights of an implementation's phases, by exact triangulation, against the truth.
fn score(measured: &MeasuredPart, truth: &sim::Truth, turns: &[f64]) -> Option<Score> {
    let mut phases = PhaseMap {
        width: measured.phases.width,
        phase: turns
            .iter()
            .map(|&turns| AbsolutePhase::from_turns(turns))
            .collect(),
        modulation: vec![Modulation::default(); turns.len()],
        trust: turns
            .iter()
            .map(|turns| {
                if turns.is_nan() {
                    Trust::Residual
                } else {
                    Trust::Resolved
                }
            })
            .collect(),
    };
    let (triangulator, decoder) = (&measured.triangulator, &measured.decoder);
    let heights = pipeline::triangulate(triangulator, decoder, None, &mut phases, &|_| ());
    Truth::from(truth).score(&phases, &heights)
}

/// The means over the parts, in the order of the first part's points.
pub fn means(points: &[Point]) -> Vec<Point> {
    let mut means: Vec<Point> = Vec::new();
    for first in points {
        let same = |other: &Point| {
            other.same_frames(first)
                && other.implementation == first.implementation
                && other.skipping == first.skipping
        };
        if means.iter().any(same) {
            continue;
        }
        let all: Vec<&Point> = points.iter().filter(|point| same(point)).collect();
        let mean = |figure: fn(&Point) -> f64| {
            all.iter().map(|point| figure(point)).sum::<f64>() / all.len() as f64
        };
        means.push(Point {
            part: "mean",
            ns_per_px: mean(|point| point.ns_per_px),
            x_floor: mean(|point| point.x_floor),
            ms_per_set: mean(|point| point.ms_per_set),
            rms_mm: mean(|point| point.rms_mm),
            unresolved_px: mean(|point| point.unresolved_px),
            gross_px: mean(|point| point.gross_px),
            ..first.clone()
        });
    }
    means
}
