//! Run time against error: processor time and height error of each implementation, sequence and bit
//! depth on the simulated parts.

use super::decoding::Decoding;
use super::effort::Effort;
use super::floor::FloorSets;
use super::frames::{FrameSet, Rotation};
use super::median::median;
use super::point::Point;
use super::timing::{Contender, Round, interleaved};
use super::variants::{decoders, references};
use super::words;
use crate::experiment::{BetterSequence, Method, OpticsKind, Runner, Scene};
use algo::pattern::{Level, PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::{self, PhaseMap};
use algo::units::{AbsolutePhase, Modulation};
use appliance::head::calibrated::MeasuredPart;
use appliance::measure::{Score, Truth};
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

/// The patterns that are compared.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pattern {
    /// 100 fringes, three geometric levels of sines.
    Fixed,
    /// Made for the part, with the sequences of the experiments.
    Better,
}

/// A sequence that is compared, of so many frames.
struct Compared(Pattern, usize);

/// The noise of all measurements.
const SEED: u64 = 1;

const SEQUENCES: [Compared; 10] = [
    Compared(Pattern::Fixed, 9),
    Compared(Pattern::Fixed, 12),
    Compared(Pattern::Fixed, 24),
    Compared(Pattern::Better, 24),
    Compared(Pattern::Better, 12),
    Compared(Pattern::Better, 9),
    Compared(Pattern::Better, 6),
    Compared(Pattern::Better, 5),
    Compared(Pattern::Better, 4),
    Compared(Pattern::Better, 3),
];

impl Compared {
    fn name(&self) -> &'static str {
        match self.0 {
            Pattern::Fixed => "fixed",
            Pattern::Better => "better",
        }
    }

    fn method(&self) -> Method {
        match self.0 {
            Pattern::Fixed => Method::Fixed { fringes: 100 },
            Pattern::Better => Method::Better(BetterSequence::new(self.1)),
        }
    }

    fn shots(&self, range: PhaseRange) -> Result<Vec<Shot>, String> {
        match self.0 {
            Pattern::Fixed => Ok(Sequence::geometric(range, 3, self.1 / 3)),
            Pattern::Better => BetterSequence::new(self.1).shots(),
        }
    }
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
    pub fn run(&self, progress: &dyn Fn(f64, &str)) -> Result<Vec<Point>, String> {
        let mut base = FloorSets::new(&self.effort);
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
                let mut runner = Runner::new(&scene, OpticsKind::Sharp).map_err(words)?;
                for compared in &SEQUENCES {
                    let words = format!(
                        "{part}, {bit_depth} bit, {}-{}",
                        compared.name(),
                        compared.1
                    );
                    progress(done / total, &words);
                    points.extend(self.compare(
                        &mut runner,
                        compared,
                        part,
                        bit_depth,
                        &mut base,
                    )?);
                    done += 1.0;
                }
            }
        }
        Ok(points)
    }

    fn compare(
        &self,
        runner: &mut Runner,
        compared: &Compared,
        part: &'static str,
        bits: u8,
        base: &mut FloorSets,
    ) -> Result<Vec<Point>, String> {
        let shots = |range| compared.shots(range).unwrap_or_default();
        let (measured, map) = runner
            .measure_with(compared.method(), shots, SEED)
            .map_err(words)?;
        let range = measured.triangulator.function().range();
        let sequence = Sequence::from_frames(&compared.shots(range)?).map_err(words)?;
        let set = FrameSet::of(&measured.frames, map);
        let truth = runner.truth();
        let lit = Truth::from(truth).whole_pixels().count();
        let pixels = set.pixels();
        let mut contenders = Vec::new();
        let mut named = Vec::new();
        for (name, kernel) in references(&sequence, range, bits, pixels)? {
            contenders.push(Contender::cold(kernel));
            named.push((name, false));
        }
        for (name, decoder) in decoders(&sequence, range, bits)? {
            let window = rows_seen(truth, set.width());
            for window in [None, Some(window)] {
                let decoding = Decoding::new(decoder.clone(), window);
                contenders.push(Contender::cold(Box::new(decoding)));
            }
            named.extend([(name, false), (name, true)]);
        }
        let mut sets = [Rotation::of(set, self.effort.bytes)];
        let rounds = interleaved(&mut contenders, &mut sets, base, &self.effort)?;
        let mut points = Vec::new();
        for (((implementation, skipping), contender), rounds) in
            named.into_iter().zip(&mut contenders).zip(rounds)
        {
            let set = sets[0].next();
            contender.kernel.run(set);
            let score = score(&measured, truth, &contender.kernel.turns(set));
            let ns_per_px = median(rounds.iter().map(|round| round.cold.ns).collect());
            points.push(Point {
                part,
                implementation,
                sequence: compared.name(),
                frames: compared.1,
                shifts: sequence.levels().last().map_or(0, Level::shifts),
                bits,
                skipping,
                ns_per_px,
                x_floor: median(rounds.iter().map(Round::x_floor).collect()),
                ms_per_set: ns_per_px * pixels as f64 / 1e6,
                rms_mm: score.as_ref().map_or(f64::NAN, |score| score.rms_mm),
                unresolved_px: score
                    .as_ref()
                    .map_or(f64::NAN, |score| (lit - score.scored) as f64),
                gross_px: score.map_or(f64::NAN, |score| score.gross as f64),
            });
        }
        Ok(points)
    }
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
