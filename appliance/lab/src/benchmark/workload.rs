//! The input of the kernels: synthetic frames of every kind of sequence, and their true phase.

use super::frames::{Buffer, FrameSet};
use super::placed::Placed;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::units::AbsolutePhase;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// A kind of sequence, and how much of its frames is lit.
#[derive(Clone, Debug)]
pub struct Workload {
    /// For tables and keys.
    pub name: String,
    /// What each frame shows.
    pub frames: Vec<Shot>,
    /// Share of the pixels on which the part is; the rest is dark.
    pub lit: f64,
    /// Bits of a sample.
    pub bit_depth: u8,
    /// Whether it is unwrapped about a map.
    pub about_map: bool,
    /// Whether the references are timed on it as well.
    pub has_references: bool,
    /// Whether the decoders are timed on frames in mappings of their own as well.
    pub has_aligned: bool,
    /// Whether the fastest decoder is timed with the least modulation of a quiet head as well.
    pub has_quiet: bool,
}

/// Numbers of shifts N of the levels that are timed.
const SHIFTS: RangeInclusive<usize> = 3..=9;

/// Range of the phase function: 64 fringes, so that three geometric levels are 8 apart.
pub const RANGE: PhaseRange = PhaseRange {
    min: 0.0,
    max: 64.0,
};
/// n of the dense levels.
const DENSE_N: f64 = 6.0;
/// Offset and modulation of lit pixels, and the value of dark ones, as shares of full scale.
const OFFSET: f64 = 0.48;
const MODULATION: f64 = 0.40;
const DARK: f64 = 0.04;
/// Half-width of the uniform noise of a sample, share of full scale: as the simulated head has it.
const NOISE: f64 = 0.025;
/// The map differs from the phase by up to this, turns.
const MAP_OFFSET: f64 = 0.25;

impl Workload {
    /// Three geometric levels of `shifts` shifts, all pixels lit, 8 bits.
    fn geometric_of(shifts: usize) -> Self {
        Self {
            name: format!("geometric_{}", 3 * shifts),
            frames: Sequence::geometric(RANGE, 3, shifts),
            lit: 1.0,
            bit_depth: 8,
            about_map: false,
            has_references: false,
            has_aligned: true,
            has_quiet: shifts <= 4,
        }
    }

    /// The first workload: twelve frames of three geometric levels, all pixels lit.
    pub fn geometric() -> Self {
        Self {
            has_references: true,
            ..Self::geometric_of(4)
        }
    }

    /// All kinds.
    pub fn all() -> Vec<Self> {
        let twelve = |name: &str| Self {
            name: name.to_owned(),
            has_aligned: false,
            has_quiet: false,
            ..Self::geometric_of(4)
        };
        let lit = |name, lit| Self {
            lit,
            ..twelve(name)
        };
        let bits = |name, bit_depth| Self {
            bit_depth,
            ..twelve(name)
        };
        let about = |name: &str, frames| Self {
            frames,
            about_map: true,
            ..twelve(name)
        };
        let compared = |workload| Self {
            has_references: true,
            ..workload
        };
        let quiet = |workload| Self {
            has_quiet: true,
            ..workload
        };
        let two_dense = |shifts| {
            let levels = Shot::level(1.0, shifts).chain(Shot::level(0.8, shifts));
            about(&format!("golden_{}", 2 * shifts), levels.collect())
        };
        let mut all = vec![
            Self::geometric(),
            lit("background_25", 0.75),
            lit("background_50", 0.50),
            lit("background_75", 0.25),
            bits("bits_10", 10),
            bits("bits_12", 12),
            quiet(compared(about("dense_12", Sequence::dense(DENSE_N, 4)))),
            quiet(compared(about("golden_4", Shot::level(1.0, 4).collect()))),
            quiet(about("golden_3", Shot::level(1.0, 3).collect())),
        ];
        all.extend(SHIFTS.filter(|&shifts| shifts != 4).map(Self::geometric_of));
        all.extend(SHIFTS.map(two_dense));
        all
    }

    /// Its frames.
    pub fn render(&self, (width, height): (usize, usize)) -> FrameSet {
        let full = f64::from((1_u32 << self.bit_depth) - 1);
        let sine: Vec<f64> = (0..65_536)
            .map(|bits| full * (OFFSET + MODULATION * (TAU * f64::from(bits) / 65_536.0).sin()))
            .collect();
        let size = (width, height);
        let phases: Vec<f64> = (0..width * height).map(|at| self.phase(at, size)).collect();
        let mut random = SplitMix64::seed_from_u64(0);
        let mut samples = Vec::with_capacity(self.frames.len() * phases.len());
        for &Shot { ratio, shift, .. } in &self.frames {
            samples.extend(phases.iter().map(|phase| {
                let light = if phase.is_nan() {
                    DARK * full
                } else {
                    let turns = ratio * phase + shift;
                    sine[((turns - turns.floor()) * 65_536.0) as usize & 0xFFFF]
                };
                let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
                let noise = (2.0 * share - 1.0) * NOISE * full;
                (light + noise).round().clamp(0.0, full) as u16
            }));
        }
        let samples = if self.bit_depth == 8 {
            let bytes = samples.into_iter().map(|sample| sample as u8);
            Buffer::Eight(Placed::Packed(bytes.collect()))
        } else {
            Buffer::Sixteen(Placed::Packed(samples))
        };
        let map = self.about_map.then(|| {
            let near = |(at, phase): (usize, &f64)| {
                let offset = MAP_OFFSET * (at as f64 / 997.0).sin();
                AbsolutePhase::from_turns(phase + offset)
            };
            phases.iter().enumerate().map(near).collect()
        });
        FrameSet::new(size, samples, map)
    }

    /// Φ of a pixel in turns, NaN where it is dark. The part is an ellipse in the middle of the
    /// frame.
    pub fn phase(&self, at: usize, (width, height): (usize, usize)) -> f64 {
        let (x, y) = (
            ((at % width) as f64 + 0.5) / width as f64,
            ((at / width) as f64 + 0.5) / height as f64,
        );
        let radius = f64::hypot(x - 0.5, y - 0.5);
        if std::f64::consts::PI * radius * radius > self.lit && self.lit < 1.0 {
            return f64::NAN;
        }
        0.5 + (RANGE.span() - 1.0) * x + 0.4 * (3.0 * TAU * y).sin()
    }
}
