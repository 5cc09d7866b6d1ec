//! The input of the kernels: synthetic frames of every kind of sequence, and their true phase; also
//! as files for other programs.

use super::timing::FrameSet;
use crate::Failed;
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::units::AbsolutePhase;
use hal::frame::{Frame, FrameFormat, Pixels, Samples};
use hal::npy;
use hal::units::Timestamp;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;
use std::sync::Arc;

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
    /// Whether decoding behind the last frame is timed as well.
    pub has_last: bool,
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
            has_last: false,
            has_quiet: shifts <= 4,
        }
    }

    /// The first workload: twelve frames of three geometric levels, all pixels lit.
    pub fn geometric() -> Self {
        Self {
            has_last: true,
            ..Self::geometric_of(4)
        }
    }

    /// All kinds.
    pub fn all() -> Vec<Self> {
        let twelve = |name: &str| Self {
            name: name.to_owned(),
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
            quiet(Self {
                has_last: true,
                ..about("dense_12", Sequence::dense(DENSE_N, 4))
            }),
            quiet(about("golden_4", Shot::level(1.0, 4).collect())),
            quiet(about("golden_3", Shot::level(1.0, 3).collect())),
        ];
        all.extend(SHIFTS.filter(|&shifts| shifts != 4).map(Self::geometric_of));
        all.extend(SHIFTS.map(two_dense));
        all
    }

    /// Its frames.
    ///
    /// # Errors
    /// If there are no frames of this size and depth.
    pub fn render(&self, (width, height): (usize, usize)) -> Result<FrameSet, Failed> {
        let format = FrameFormat::packed(width as u32, height as u32, self.bit_depth);
        let full = f64::from(format.full_scale());
        let sine: Vec<f64> = (0..65_536)
            .map(|bits| full * (OFFSET + MODULATION * (TAU * f64::from(bits) / 65_536.0).sin()))
            .collect();
        let size = (width, height);
        let phases: Vec<f64> = (0..width * height).map(|at| self.phase(at, size)).collect();
        let mut random = SplitMix64::seed_from_u64(0);
        let mut sample = |phase: &f64, shot: &Shot| {
            let light = if phase.is_nan() {
                DARK * full
            } else {
                let turns = shot.ratio * phase + shot.shift;
                sine[((turns - turns.floor()) * 65_536.0) as usize & 0xFFFF]
            };
            let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            let noise = (2.0 * share - 1.0) * NOISE * full;
            (light + noise).round().clamp(0.0, full) as u16
        };
        let mut frames = Vec::new();
        for shot in &self.frames {
            let samples = phases.iter().map(|phase| sample(phase, shot));
            let pixels = if self.bit_depth == 8 {
                Pixels::Eight(samples.map(|sample| sample as u8).collect())
            } else {
                Pixels::Sixteen(samples.collect())
            };
            frames.push(Frame::new(format, Arc::new(pixels), Timestamp(0), 0)?);
        }
        let map = self.about_map.then(|| {
            let near = |(at, phase): (usize, &f64)| {
                let offset = MAP_OFFSET * (at as f64 / 997.0).sin();
                AbsolutePhase::from_turns(phase + offset)
            };
            phases.iter().enumerate().map(near).collect()
        });
        Ok(FrameSet::new(frames, map))
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

/// The twelve frames of the first workload as files for other programs, by their names:
/// `frame-00.npy` and so on (8 bits), `phase.npy` (the true Φ in turns), and `sequence.json` with
/// ratio and shift of each frame and the fringes of the finest level.
///
/// # Errors
/// If there are no frames of this size.
pub fn frame_files((width, height): (usize, usize)) -> Result<Vec<(String, Vec<u8>)>, Failed> {
    let workload = Workload::geometric();
    let set = workload.render((width, height))?;
    let mut files = Vec::new();
    for (number, frame) in set.frames.iter().enumerate() {
        if let Samples::Eight(samples) = frame.samples() {
            files.push((format!("frame-{number:02}.npy"), npy::write(width, samples)));
        }
    }
    let phases: Vec<f64> = (0..set.pixels())
        .map(|at| workload.phase(at, (width, height)))
        .collect();
    files.push(("phase.npy".into(), npy::write(width, &phases)));
    let sequence = serde_json::json!({
        "fringes": RANGE.span(),
        "frames": workload.frames.iter().map(|shot| serde_json::json!({"ratio": shot.ratio, "shift": shot.shift})).collect::<Vec<_>>(),
    });
    files.push(("sequence.json".into(), format!("{sequence:#}\n").into()));
    Ok(files)
}
