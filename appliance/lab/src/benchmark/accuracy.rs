//! Run time against error: processor time and height error of each implementation, sequence and bit depth on the simulated parts.

use super::decoding::Decoding;
use super::floor::FloorSets;
use super::frames::{FrameSet, Rotation};
use super::median::median;
use super::point::Point;
use super::timing::{Contender, Effort, Round, interleaved};
use super::variants::{decoders, references};
use super::words;
use crate::experiment::{BetterSequence, Method, OpticsKind, Runner, Scene};
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::{self, PhaseMap};
use algo::units::{AbsolutePhase, Modulation};
use appliance::head::calibrated::Measured;
use appliance::measure::{Score, Truth};
use std::ops::Range;
use std::time::Duration;

/// What is measured, and how thoroughly.
#[derive(Clone, Debug)]
pub struct Study {
    /// Names of the simulated parts.
    pub parts: Vec<&'static str>,
    /// Columns and rows of their camera.
    pub camera: u32,
    /// Bits of it.
    pub bit_depths: Vec<u8>,
    /// How long times are measured; its size is that of the floor.
    pub effort: Effort,
}

/// A sequence that is compared: of the fixed pattern, or of the better one.
struct Compared {
    name: &'static str,
    levels: usize,
    shifts: usize,
}

/// The name of the fixed pattern, and the pattern.
const FIXED: &str = "fixed";
const FIXED_METHOD: Method = Method::Fixed { fringes: 100 };
/// n of the dense levels: reaches ± 4 turns, as recipes have it.
const DENSE_N: f64 = 4.0;
/// The noise of all measurements.
const SEED: u64 = 1;

const fn compared(name: &'static str, levels: usize, shifts: usize) -> Compared {
    Compared {
        name,
        levels,
        shifts,
    }
}

const SEQUENCES: [Compared; 10] = [
    compared(FIXED, 3, 3),
    compared(FIXED, 3, 4),
    compared(FIXED, 3, 8),
    compared("better", 3, 3),
    compared("better", 3, 4),
    compared("better", 3, 8),
    compared("better", 2, 3),
    compared("better", 1, 3),
    compared("better", 1, 4),
    compared("better", 1, 8),
];

impl Compared {
    fn method(&self) -> Method {
        match self.name {
            FIXED => FIXED_METHOD,
            // Three levels are unwrapped about the preliminary map, fewer about the golden one.
            _ if self.levels == 3 => Method::Better(BetterSequence::TWELVE),
            _ => Method::Better(BetterSequence::FOUR),
        }
    }

    fn frames(&self, range: PhaseRange) -> Vec<Shot> {
        let level = |ratio| Shot::level(ratio, self.shifts);
        match (self.name, self.levels) {
            (FIXED, levels) => Sequence::geometric(range, levels, self.shifts),
            (_, 3) => Sequence::dense(DENSE_N, self.shifts),
            (_, 2) => level(1.0).chain(level(0.8)).collect(),
            _ => level(1.0).collect(),
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
            // Shorter for each: ten sequences of three depths on four parts.
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
                        "{part}, {bit_depth} bit, {} {}x{}",
                        compared.name, compared.levels, compared.shifts
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
        let frames = |range| compared.frames(range);
        let (measured, map) = runner
            .measure_with(compared.method(), frames, SEED)
            .map_err(words)?;
        let range = measured.triangulator.function().range();
        let sequence = Sequence::from_frames(&compared.frames(range)).map_err(words)?;
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
        let rounds = interleaved(&mut contenders, &mut sets, base, &self.effort);
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
                sequence: compared.name,
                frames: compared.levels * compared.shifts,
                shifts: compared.shifts,
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
fn score(measured: &Measured, truth: &sim::Truth, turns: &[f64]) -> Option<Score> {
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
    let heights = pipeline::triangulate(triangulator, decoder, None, &mut phases);
    Truth::from(truth).score(&phases, &heights)
}
