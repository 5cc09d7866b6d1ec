//! Light that changes from one frame of a sequence to the next: lamps of 100 Hz, a cloud, a projector
//! that is not constant. It is found in the frames themselves, and taken out of them.
//!
//! # Idea
//! Of a pixel, the N frames of a level show I_k = A + B sin 2π(φ + s_k). Another offset or gain in
//! some of them makes the modulation of pixels wrong once or twice per fringe, while that of the part
//! hardly changes along a few fringes. So B/A, without its mean, slope and bend along a short
//! run of pixels, tells the changes; from four frames on, what no sine explains tells them, too. (Shifts that
//! are not known are found alike: Z. Wang, B. Han, Optics Letters 29, 2004, pp. 1671–1673. Here shifts
//! are known and the light is not.) What is found is taken out of the samples, so that phases,
//! contours and sections follow from frames of one light.
//!
//! # Equation
//! With the offset e_k = a_k A + b_k B of frame k and its gain 1 + g_k
//!
//! ```text
//! I_k = A + e_k + (1 + g_k) B sin 2π(φ + s_k + ε_k)           w_k = sin 2π(φ + s_k)
//! δB = (2/N) Σ w_k δI_k      δA = (1/N) Σ δI_k                δI_k = e_k + g_k B w_k + 2π ε_k B cos 2π(φ + s_k)
//! ```
//!
//! An offset has two numbers, because it may be the projector's light, which is B/m where the pattern
//! alone has the contrast m, or other light, which is A − B/m. Neither has to be known before. ε_k is of
//! a part that moves towards the camera or away. What all frames of a level have in common is no change
//! of any of them.
//!
//! # Accuracy
//! σ of offsets .03 counts, of gains .001, shifts to 4e-4 turns, with a noise of 1.8 counts and a
//! modulation of 50 (`tests`); docs/accuracy.md has what a lamp leaves of an error of heights.
//!
//! # Shapes and units
//! Samples in counts, row-major. A level of two shifts tells nothing of its light, nor does one whose
//! fringes are longer than a run.

mod changes;
mod correct;
mod level;
mod look;
#[cfg(test)]
mod tests;

pub use correct::SteadyFrames;
pub use level::FrameLight;

use crate::frame::FrameView;
use crate::pattern::Sequence;
use alloc::vec;
use alloc::vec::Vec;
use changes::Changes;
use level::{LevelShifts, RUN, Run, SeenRun};
use look::Ripple;

/// Most runs that changes are worked out of.
const MOST_RUNS: usize = 320;
/// Fewer tell nothing.
const FEWEST_RUNS: usize = 8;
/// Most runs that are looked at in each cycle.
const LOOKED: usize = 24;
/// Runs with a pixel of less modulation than this, in σ of its noise, are left out.
const DIM: f64 = 6.0;
/// Changes are sure if χ² falls by so many σ of what noise does.
const SURE: f64 = 8.0;
/// With a larger misfit, variance over that of noise, changes are not of this kind.
const MOST_MISFIT: f64 = 2.0;
/// Nor if a larger share of the runs does not fit.
const MOST_STRAYS: f64 = 0.08;
/// A frame has other light than its level if its mean differs by more than this share.
const UNLIKE: f64 = 0.04;
/// A frame is overexposed alone if it has so much more of its pixels at full scale than another one.
const ALONE: f64 = 0.5;
/// Where fringes are blurred more than elsewhere, other light is told apart from the projector's to
/// this share of itself.
const BLURRED: f64 = 0.05;
/// The contrast of a pattern alone, where the frames do not tell: at least half, at most 1.
const PATTERN: [f64; 2] = [0.5, 1.0];

/// How and where the light of a sequence's frames is compared.
#[derive(Clone, Debug)]
pub struct Watch {
    levels: Vec<LevelShifts>,
    /// Column and row of the first pixel of each run.
    runs: Vec<(usize, usize)>,
    full_scale: u16,
    /// σ of a sample, counts.
    noise: f64,
}

/// Light that changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Flicker {
    /// Per frame of the sequence.
    pub frames: Vec<FrameLight>,
    /// Per frame, the other light against the mean of its level, counts where the part is.
    pub other: Vec<f64>,
    /// Variance of what the corrected frames differ by from sines, over that of noise.
    pub misfit: f64,
    /// σ of what is left in a sample after the correction, over that of noise.
    pub left: f64,
}

/// What the frames of a sequence tell of their light.
#[derive(Clone, Debug, PartialEq)]
pub enum Steadiness {
    /// It does not change beyond noise, or cannot be told.
    Steady,
    /// It changes, and frames can be corrected.
    Flickers(Flicker),
    /// It changes in a way that cannot be corrected, most in this frame.
    Broken(usize),
}

impl Watch {
    /// Of a sequence whose samples are `full_scale` at most, with noise of `noise` counts, in frames of
    /// `width` columns; `lit` tells which pixels are of a part in the pattern's light.
    pub fn new(
        sequence: &Sequence,
        (full_scale, noise): (u16, f64),
        width: usize,
        lit: &[bool],
    ) -> Self {
        let mut runs = Vec::new();
        for (v, row) in lit.chunks(width.max(1)).enumerate() {
            let mut u = 0;
            while let Some(run) = row.get(u..u + RUN) {
                match run.iter().rposition(|lit| !lit) {
                    Some(dark) => u += dark + 1,
                    None => {
                        runs.push((u, v));
                        u += RUN;
                    }
                }
            }
        }
        let apart = runs.len().div_ceil(MOST_RUNS).max(1);
        Self {
            levels: sequence
                .levels()
                .iter()
                .filter_map(LevelShifts::of)
                .collect(),
            runs: runs.into_iter().step_by(apart).collect(),
            full_scale,
            noise,
        }
    }

    /// What the frames of the sequence tell. Nothing is allocated where the light is steady.
    pub fn look(&self, frames: &[FrameView<'_>]) -> Steadiness {
        if self.runs.len() < FEWEST_RUNS {
            return Steadiness::Steady;
        }
        if let Some(frame) = self.overexposed(frames) {
            return Steadiness::Broken(frame);
        }
        if !self.is_suspect(frames) {
            return Steadiness::Steady;
        }
        self.find(frames)
    }

    /// The frames in one light.
    pub fn steady(&self, frames: &[FrameView<'_>], flicker: &Flicker) -> SteadyFrames {
        let levels = self.levels.iter().map(|level| {
            let light = level.frames.iter().map(|&frame| flicker.frames[frame]);
            (level, light.collect())
        });
        SteadyFrames::of(&levels.collect::<Vec<_>>(), frames, self.full_scale)
    }

    fn looked(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let apart = self.runs.len().div_ceil(LOOKED).max(1);
        self.runs.iter().step_by(apart).copied()
    }

    /// The frame that is overexposed where another one of its level is not.
    fn overexposed(&self, frames: &[FrameView<'_>]) -> Option<usize> {
        let share = |&frame: &usize| {
            let clipped = self.looked().map(|(u, v)| {
                let row = frames[frame].row(v);
                let all = (u..u + RUN).filter(|&u| row.at(u) >= self.full_scale);
                all.count()
            });
            let looked = RUN * self.looked().count();
            (clipped.sum::<usize>() as f64 / looked as f64, frame)
        };
        self.levels.iter().find_map(|level| {
            let shares = || level.frames.iter().map(share);
            let (most, frame) = shares().max_by(|a, b| a.0.total_cmp(&b.0))?;
            let least = shares().map(|(share, _)| share).fold(1.0, f64::min);
            (most > least + ALONE).then_some(frame)
        })
    }

    /// The frame whose light differs most from the mean of its level, if it does by more than chance:
    /// else something else than light is strange about the part.
    fn broken(&self, frames: &[FrameView<'_>]) -> Steadiness {
        let light = |frame: usize| {
            let runs = self.looked().map(|(u, v)| {
                let row = frames[frame].row(v);
                (u..u + RUN).map(|u| u64::from(row.at(u))).sum::<u64>()
            });
            runs.sum::<u64>() as f64
        };
        let far = self.levels.iter().flat_map(|level| {
            let all: Vec<f64> = level.frames.iter().map(|&frame| light(frame)).collect();
            let mean = all.iter().sum::<f64>() / level.count();
            let off = all.into_iter().map(move |light| (light / mean - 1.0).abs());
            off.zip(&level.frames)
        });
        let most = far.max_by(|a, b| a.0.total_cmp(&b.0));
        match most.filter(|(off, _)| *off > UNLIKE) {
            Some((_, frame)) => Steadiness::Broken(*frame),
            None => Steadiness::Steady,
        }
    }

    /// The least modulation of a pixel that is looked at, counts.
    fn dim(&self, level: &LevelShifts) -> f64 {
        DIM * self.noise * libm::sqrt(2.0 / level.count())
    }

    fn is_suspect(&self, frames: &[FrameView<'_>]) -> bool {
        self.levels.iter().any(|level| {
            let mut ripple = Ripple::default();
            for (u, v) in self.looked() {
                let sample =
                    |k: usize, at: usize| f64::from(frames[level.frames[k]].row(v).at(u + at));
                let run = SeenRun::of(level, sample);
                if run.is_lit(self.dim(level)) {
                    ripple.add(&run);
                }
            }
            ripple.is_suspect()
        })
    }

    /// The samples of the runs of a level in which all pixels are lit and none is overexposed; none of
    /// a level whose fringes are too long.
    fn samples(&self, level: &LevelShifts, frames: &[FrameView<'_>]) -> Vec<Run> {
        let full_scale = f64::from(self.full_scale);
        let mut all = Ripple::default();
        let run = |&(u, v): &(usize, usize)| {
            let frame = |&frame: &usize| {
                let row = frames[frame].row(v);
                core::array::from_fn(|at| f64::from(row.at(u + at)))
            };
            let run: Run = level.frames.iter().map(frame).collect();
            let whole = run.iter().flatten().all(|sample| *sample < full_scale);
            let seen = whole.then(|| SeenRun::of(level, |k, at| run[k][at]))?;
            seen.is_lit(self.dim(level)).then(|| {
                all.add(&seen);
                run
            })
        };
        let runs = self.runs.iter().filter_map(run).collect();
        match all.is_mute() {
            true => Vec::new(),
            false => runs,
        }
    }

    /// How the light changes.
    fn find(&self, frames: &[FrameView<'_>]) -> Steadiness {
        let mut found = Flicker {
            frames: vec![FrameLight::default(); frames.len()],
            other: vec![0.0; frames.len()],
            misfit: 0.0,
            left: 0.0,
        };
        let (mut left, mut strays, mut gained, mut unknowns) = ([0.0; 2], [0; 2], 0.0, 0.0);
        for level in &self.levels {
            let runs = self.samples(level, frames);
            if runs.len() < FEWEST_RUNS {
                continue;
            }
            let fit = Changes::of(level, &runs, self.noise);
            left = [left[0] + fit.left[0], left[1] + fit.left[1]];
            strays = [strays[0] + fit.strays[0], strays[1] + fit.strays[1]];
            gained += fit.gained;
            unknowns += 4.0 * level.count();
            let [offset, gain] = fit.sigma;
            found.left = found.left.max(libm::hypot(offset, gain * fit.seen[1]));
            let others = fit.other();
            for ((light, other), &frame) in fit.light.iter().zip(others).zip(&level.frames) {
                found.frames[frame] = *light;
                found.other[frame] = other;
            }
        }
        if strays[0] as f64 > MOST_STRAYS * strays[1] as f64 {
            return self.broken(frames);
        }
        if gained < unknowns + SURE * libm::sqrt(2.0 * unknowns) {
            return Steadiness::Steady;
        }
        found.misfit = left[0] / left[1];
        let unsure = libm::hypot(found.left, BLURRED * found.other_counts()) / self.noise;
        found.left = libm::hypot(unsure, libm::sqrt((found.misfit - 1.0).max(0.0)));
        match found.misfit <= MOST_MISFIT {
            true => Steadiness::Flickers(found),
            false => self.broken(frames),
        }
    }
}

impl Changes {
    /// Per frame, what its offset has of other light, counts: the projector's part of it goes with the
    /// gain.
    fn other(&self) -> impl Iterator<Item = f64> + '_ {
        // b = −(a − g)/m.
        let (mut product, mut square) = (0.0, 0.0);
        for light in &self.light {
            let own = light.offset[0] - light.gain;
            product -= own * light.offset[1];
            square += own * own;
        }
        let [least, most] = PATTERN.map(f64::recip);
        let per_modulation = (product / square.max(f64::MIN_POSITIVE)).clamp(most, least);
        let [offset, modulation] = self.seen;
        self.light.iter().map(move |light| {
            let [a, b] = light.offset;
            a * offset + (b - light.gain * per_modulation) * modulation
        })
    }
}

impl Flicker {
    /// Half of the span of the other light, counts.
    pub fn other_counts(&self) -> f64 {
        let most = self.other.iter().copied().fold(0.0, f64::max);
        let least = self.other.iter().copied().fold(0.0, f64::min);
        (most - least) / 2.0
    }

    /// The largest shift of fringes, of either sign, turns.
    pub fn largest_shift(&self) -> f64 {
        self.frames
            .iter()
            .map(|frame| frame.shift.abs())
            .fold(0.0, f64::max)
    }

    /// The largest gain less 1, of either sign.
    pub fn largest_gain(&self) -> f64 {
        self.frames
            .iter()
            .map(|frame| frame.gain.abs())
            .fold(0.0, f64::max)
    }
}
