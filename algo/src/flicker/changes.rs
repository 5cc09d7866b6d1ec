//! How the light of a level's frames changes, by least squares.
//!
//! Unknown are a, b, g and ε of N frames. A run gives equations per pixel: for its ripple and for its
//! brightness A, both without mean, slope and bend, and N − 3 for what no sine explains. (The brightness
//! tells shifts from gains; what the part's own shades do to it counts as noise.) They are linear about
//! the frames as corrected so far; three rounds do for changes of a third of the light. What the frames
//! have in common, and the two numbers of an offset where all runs have the same contrast, are left
//! open; a weak prior makes them small.

use super::level::{FrameLight, LevelShifts, RUN, Run, SeenRun, steady};
use crate::math::solve::solve_symmetric;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Unknowns of a frame.
const PARTS: usize = 4;
/// Rounds of correcting and solving.
const ROUNDS: usize = 3;
/// Rounds of finding the contrast of a run: changing light makes it seem larger than it is.
const CONTRASTS: usize = 2;
/// σ of the prior of a, b, g and ε.
const PRIOR: [f64; PARTS] = [0.5, 0.5, 0.2, 0.05];
/// Runs whose ripple varies by so many times the median variance are of an edge or a shadow.
const STRAY: f64 = 4.0;
/// A run does not fit whose ripple varies by so many times the variance of noise.
const FAR: f64 = 9.0;

/// What was found of a level.
#[derive(Clone, Debug)]
pub(super) struct Changes {
    pub light: Vec<FrameLight>,
    /// The sum of the squares of what is left, in σ, and how many there are.
    pub left: [f64; 2],
    /// Runs that do not fit, of all.
    pub strays: [usize; 2],
    /// By how much χ² fell when the frames were corrected first.
    pub gained: f64,
    /// A and B of the runs together, counts.
    pub seen: [f64; 2],
    /// σ of a frame's offset, counts, and of its gain.
    pub sigma: [f64; 2],
}

/// The normal equations of a level.
struct LightEquations {
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// Coefficients of the pixels of a run, one row per unknown.
    rows: Vec<[f64; RUN]>,
}

impl Changes {
    /// Of a level's runs, with noise of `noise` counts per sample.
    pub fn of(level: &LevelShifts, runs: &[Run], noise: f64) -> Self {
        let count = level.frames.len();
        let mut light = vec![FrameLight::default(); count];
        let mut found = Self {
            light: vec![FrameLight::default(); count],
            left: [0.0; 2],
            strays: [0; 2],
            gained: 0.0,
            seen: [0.0; 2],
            sigma: [0.0; 2],
        };
        for round in 0..=ROUNDS {
            let seen: Vec<_> = runs.iter().map(|run| level.seen(run, &light)).collect();
            let kept = kept(level, &seen, noise);
            let mut equations = LightEquations::new(level);
            found.left = [0.0; 2];
            for (samples, run) in seen
                .iter()
                .zip(&kept)
                .filter_map(|(run, kept)| kept.then_some(run))
            {
                let left = equations.add(level, (samples, run), noise);
                found.left[0] += left[0];
                found.left[1] += left[1];
            }
            if round == ROUNDS {
                found.tell(&equations, &seen);
                let strays = seen
                    .iter()
                    .filter(|(_, run)| ripples(level, run, noise) > FAR);
                found.strays = [strays.count(), seen.len()];
                break;
            }
            let Some(step) = equations.solve(count) else {
                break;
            };
            if round == 0 {
                let gains = step.iter().zip(&equations.right);
                found.gained = gains.map(|(x, b)| x * b).sum();
            }
            for (k, light) in light.iter_mut().enumerate() {
                light.offset[0] += step[k];
                light.offset[1] += step[count + k];
                light.gain += step[2 * count + k];
                light.shift += step[3 * count + k];
            }
        }
        found.light = light;
        found
    }

    /// Adds means and σ by the last equations.
    fn tell(&mut self, equations: &LightEquations, runs: &[(Run, SeenRun)]) {
        let mean = |of: fn(&SeenRun) -> &[f64; RUN]| {
            let sums = runs.iter().map(|(_, run)| of(run).iter().sum::<f64>());
            sums.sum::<f64>() / (RUN * runs.len().max(1)) as f64
        };
        self.seen = [mean(|run| &run.offset), mean(|run| &run.modulation)];
        let [a, b] = self.seen;
        let count = self.light.len();
        self.sigma = [[a, b, 0.0], [0.0, 0.0, 1.0]].map(|of| equations.sigma(count, of));
    }
}

impl LevelShifts {
    /// A run in the light that its frames have together, and what is seen there.
    fn seen(&self, run: &Run, light: &[FrameLight]) -> (Run, SeenRun) {
        let mut seen = SeenRun::of(self, |k, at| run[k][at]);
        let mut samples = run.clone();
        let mut pixel = vec![0.0; run.len()];
        for _ in 0..CONTRASTS {
            for at in 0..RUN {
                for (sample, all) in pixel.iter_mut().zip(run) {
                    *sample = all[at];
                }
                steady(self, &mut pixel, light, seen.contrast);
                for (all, sample) in samples.iter_mut().zip(&pixel) {
                    all[at] = *sample;
                }
            }
            seen = SeenRun::of(self, |k, at| samples[k][at]);
        }
        (samples, seen)
    }
}

/// Which runs are of one surface in one light.
fn kept(level: &LevelShifts, runs: &[(Run, SeenRun)], noise: f64) -> Vec<bool> {
    let all: Vec<f64> = runs
        .iter()
        .map(|(_, run)| ripples(level, run, noise))
        .collect();
    let mut sorted = all.clone();
    sorted.sort_by(f64::total_cmp);
    let most = STRAY * sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    all.iter().map(|ripples| *ripples <= most).collect()
}

/// Variance of a run's ripple over that by noise.
fn ripples(level: &LevelShifts, run: &SeenRun, noise: f64) -> f64 {
    let squares = bare(&run.ripple()).map(|value| value * value);
    squares.iter().sum::<f64>() / (RUN as f64 * variance(level, run, noise))
}

/// Variance of a pixel's ripple by noise.
fn variance(level: &LevelShifts, run: &SeenRun, noise: f64) -> f64 {
    let inverse = |values: &[f64; RUN]| RUN as f64 / values.iter().sum::<f64>();
    let (a, b) = (inverse(&run.offset), inverse(&run.modulation));
    noise * noise * (2.0 * b * b + a * a) / level.count()
}

/// Values without their mean, slope and bend, which are of the part.
fn bare(values: &[f64; RUN]) -> [f64; RUN] {
    let middle = (RUN - 1) as f64 / 2.0;
    let spread = ((RUN * RUN - 1) as f64) / 12.0;
    // Polynomials that are orthogonal on the run.
    let polynomials: [fn(f64, f64) -> f64; 3] = [
        |_, _| 1.0,
        |place, _| place,
        |place, spread| place * place - spread,
    ];
    let mut left = *values;
    for polynomial in polynomials {
        let of = |at: usize| polynomial(at as f64 - middle, spread);
        let (mut product, mut square) = (0.0, 0.0);
        for (at, value) in values.iter().enumerate() {
            product += value * of(at);
            square += of(at) * of(at);
        }
        for (at, left) in left.iter_mut().enumerate() {
            *left -= product / square * of(at);
        }
    }
    left
}

impl LightEquations {
    fn new(level: &LevelShifts) -> Self {
        let count = level.frames.len();
        let unknowns = PARTS * count;
        let mut matrix = vec![0.0; unknowns * unknowns];
        for (at, row) in matrix.chunks_mut(unknowns).enumerate() {
            row[at] = 1.0 / (PRIOR[at / count] * PRIOR[at / count]);
        }
        Self {
            matrix,
            right: vec![0.0; unknowns],
            rows: vec![[0.0; RUN]; unknowns],
        }
    }

    /// Adds a run's equations; returns the sum of the squares of their right sides, in σ, and how
    /// many there are.
    fn add(
        &mut self,
        level: &LevelShifts,
        (samples, run): (&Run, &SeenRun),
        noise: f64,
    ) -> [f64; 2] {
        let (n, contrast) = (level.count(), run.contrast);
        // δB/B − δA/A, δA/A and, in counts, what no sine explains, of an offset of B.
        self.set(level, run, |_, _, wave| (2.0 * wave - contrast) / n);
        self.rows.iter_mut().for_each(|row| *row = bare(row));
        let ripple = bare(&run.ripple());
        let mut squares = self.join(&ripple, variance(level, run, noise));
        self.set(level, run, |_, _, _| contrast / n);
        self.rows.iter_mut().for_each(|row| *row = bare(row));
        let mean = run.offset.iter().sum::<f64>() / RUN as f64;
        let bright = bare(&run.offset.map(|offset| offset / mean));
        let shades = bright.iter().map(|value| value * value).sum::<f64>() / RUN as f64;
        self.join(&bright, shades.max(noise * noise / (n * mean * mean)));
        for other in &level.others {
            self.set(level, run, |k, at, _| other[k] * contrast * run.offset[at]);
            let left = core::array::from_fn(|at| {
                let all = other.iter().zip(samples);
                all.map(|(weight, samples)| weight * samples[at]).sum()
            });
            squares += self.join(&left, noise * noise);
        }
        [squares, (RUN * (1 + level.others.len())) as f64]
    }

    /// Sets the coefficients of each frame's a, b, g and ε at the pixels of a run to a factor times
    /// A/B, 1, sin 2π(φ + s_k) and the derivative of that; the factor is of the frame, the pixel and
    /// that sine.
    fn set(
        &mut self,
        level: &LevelShifts,
        run: &SeenRun,
        factor: impl Fn(usize, usize, f64) -> f64,
    ) {
        let count = level.frames.len();
        for (k, [cos, sin]) in level.shifts.iter().enumerate() {
            for (at, [sine, cosine]) in run.phase.iter().enumerate() {
                let (wave, slope) = (sine * cos + cosine * sin, cosine * cos - sine * sin);
                let factor = factor(k, at, wave);
                let parts = [1.0 / run.contrast, 1.0, wave, TAU * slope];
                for (part, of) in parts.into_iter().enumerate() {
                    self.rows[part * count + k][at] = factor * of;
                }
            }
        }
    }

    /// Adds the equations whose coefficients are in `rows`.
    fn join(&mut self, right: &[f64; RUN], variance: f64) -> f64 {
        let dot = |a: &[f64; RUN], b: &[f64; RUN]| {
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / variance
        };
        let unknowns = self.rows.len();
        for (i, row) in self.rows.iter().enumerate() {
            for (j, other) in self.rows[..=i].iter().enumerate() {
                self.matrix[i * unknowns + j] += dot(row, other);
            }
            self.right[i] += dot(row, right);
        }
        dot(right, right)
    }

    /// The unknowns, without what all `count` frames have in common.
    fn solve(&self, count: usize) -> Option<Vec<f64>> {
        let mut solved = self.right.clone();
        solve_symmetric(&mut self.matrix.clone(), &mut solved)?;
        for part in solved.chunks_mut(count) {
            let mean = part.iter().sum::<f64>() / count as f64;
            part.iter_mut().for_each(|value| *value -= mean);
        }
        Some(solved)
    }

    /// σ of this sum of a frame's a, b and g, against the mean of all `count` frames.
    fn sigma(&self, count: usize, of: [f64; 3]) -> f64 {
        let mut sum = vec![0.0; self.right.len()];
        for (part, factor) in sum.chunks_mut(count).zip(of) {
            part.fill(-factor / count as f64);
            part[0] += factor;
        }
        let mut solved = sum.clone();
        if solve_symmetric(&mut self.matrix.clone(), &mut solved).is_none() {
            return f64::INFINITY;
        }
        libm::sqrt(sum.iter().zip(&solved).map(|(a, b)| a * b).sum())
    }
}
