//! The flip-to-light delay, from the brightness of frames while black and white alternate at random
//! intervals.
//!
//! A frame exposed from s to s + T sees white for a share p(d) of its time if light comes d after
//! its flip; p follows from the times of the flips. The frame's mean is b + a·p(d). Black b, white
//! above black a, and d are fitted to all frames by least squares: d first by trial on a grid
//! (intervals are random, so only one d fits), then all three by Gauss–Newton. Each change inside
//! an exposure determines d: a relative noise ε of the mean, as a share of white, gives an error of
//! ε·T, which falls with the square root of the number of such changes.

use super::{Lit, load_black_and_white};
use super::{PATIENCE, refreshes};
use hal::error::Error;
use hal::head::{Head, Showing};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::time::Duration;

/// Changes between black and white in a round.
const CHANGES: u32 = 80;
/// Longest delay that is tried, refreshes.
const LONGEST: u32 = 16;
/// Points of the trial grid in the shorter of refresh and exposure.
const TRIALS: f64 = 8.0;
/// Iterations of Gauss–Newton; p is piecewise linear in d, so few are needed.
const ITERATIONS: usize = 12;
/// 1 σ of the delay at which measuring ends, s: 3.3 σ are half a microsecond, to which the delay is
/// rounded.
const GOAL_S: f64 = 0.15e-6;
/// White must lie this many times the scatter of the means above black, else no light follows the
/// flips.
const LEAST_SIGNAL: f64 = 5.0;

/// The measured delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay {
    /// From a flip to its light, s, rounded to a microsecond; negative if the time stamps of flips
    /// or frames are misinterpreted.
    pub seconds: f64,
    /// σ of the delay, s.
    pub error: f64,
}

/// The flips and frames of one round.
struct Round {
    /// Each change: its flip after the first one, s, and whether it is to white.
    changes: Vec<(f64, bool)>,
    /// Each frame: start of its exposure after the first flip, s, and its mean, counts.
    frames: Vec<(f64, f64)>,
}

impl Delay {
    /// Measures the delay in at most `rounds` of about four seconds each; `None` if no light
    /// follows the flips. The camera's stamps are interpreted as the head's timing says. `progress`
    /// gets the share of the rounds done.
    ///
    /// # Errors
    /// The error of a device.
    pub fn measure(
        head: &mut Head,
        lit: &Lit,
        rounds: u32,
        progress: &dyn Fn(f64),
    ) -> Result<Option<Self>, Error> {
        load_black_and_white(head)?;
        let exposure = head.camera_timing().exposure.as_secs_f64();
        let refresh = head.refresh().as_secs_f64();
        let mut taken = Vec::new();
        let mut fitted = None;
        for round in 0..rounds.max(1) {
            progress(f64::from(round) / f64::from(rounds.max(1)));
            taken.push(Round::take(head, lit, round)?);
            fitted = fit(&taken, exposure, refresh);
            if fitted.is_none_or(|delay: Self| delay.error <= GOAL_S) {
                break;
            }
        }
        Ok(fitted)
    }

    /// The delay as a duration; zero if it is negative.
    pub fn duration(&self) -> Duration {
        Duration::from_micros((self.seconds * 1e6).round().max(0.0) as u64)
    }
}

impl Round {
    fn take(head: &mut Head, lit: &Lit, round: u32) -> Result<Self, Error> {
        let whole = refreshes(head, head.camera_timing().exposure).clamp(1, 100);
        let mut random = SplitMix64::seed_from_u64(u64::from(round).wrapping_add(1));
        let mut showings: Vec<Showing> = (0..CHANGES)
            .map(|change| Showing {
                index: change as usize % 2,
                refreshes: whole + (random.next_u64() >> 33) as u32 % 3,
                settle: 0,
            })
            .collect();
        // Black at both ends; the last one stays until the longest delay has passed.
        showings.push(Showing {
            index: 0,
            refreshes: whole + LONGEST,
            settle: 0,
        });
        let seen = head.watch(&showings, PATIENCE, &mut |frame| lit.mean(&frame.counts()))?;
        let Some(first) = seen.flips.first() else {
            return Ok(Self {
                changes: Vec::new(),
                frames: Vec::new(),
            });
        };
        // Differences of a few seconds are exact to far below a nanosecond.
        let after = |at: hal::units::Timestamp| {
            (i128::from(at.0) - i128::from(first.timestamp.0)) as f64 * 1e-9
        };
        let flips = seen.flips.iter().zip(&showings).skip(1);
        Ok(Self {
            changes: flips
                .map(|(flip, showing)| (after(flip.timestamp), showing.index == 1))
                .collect(),
            frames: seen
                .frames
                .iter()
                .filter(|frame| !seen.spoiled_near(frame.start))
                .map(|frame| (after(frame.start), frame.measured))
                .collect(),
        })
    }

    /// For each frame its mean, the share p of its exposure in which white is in view if light
    /// comes `delay` after its flip, and dp/d(delay).
    fn shares(&self, exposure: f64, delay: f64) -> impl Iterator<Item = (f64, f64, f64)> {
        let sign = |white: bool| if white { 1.0 } else { -1.0 };
        // The share in view after each number of changes.
        let mut after = vec![0.0];
        for (at, (_, white)) in self.changes.iter().enumerate() {
            after.push(after[at] + sign(*white));
        }
        self.frames.iter().map(move |(start, mean)| {
            let left = |flip: f64| start + exposure - (flip + delay);
            let before = self
                .changes
                .partition_point(|(flip, _)| left(*flip) >= exposure);
            let (mut share, mut slope) = (after[before], 0.0);
            let within = self.changes[before..].iter();
            for (flip, white) in within.take_while(|(flip, _)| left(*flip) > 0.0) {
                // A change to white adds the rest of the exposure, a change to black subtracts it.
                share += sign(*white) * left(*flip) / exposure;
                slope -= sign(*white) / exposure;
            }
            (*mean, share, slope)
        })
    }
}

/// The delay that fits the rounds best; none if no light follows the flips.
fn fit(rounds: &[Round], exposure: f64, refresh: f64) -> Option<Delay> {
    let shares = |delay: f64| {
        rounds
            .iter()
            .flat_map(move |round| round.shares(exposure, delay))
    };
    let step = exposure.min(refresh) / TRIALS;
    let lowest = -2.0 * (exposure + refresh);
    let trials = ((f64::from(LONGEST) * refresh - lowest) / step) as u32;
    let trial = |at: u32| lowest + f64::from(at) * step;
    let best = (0..=trials)
        .map(trial)
        .filter_map(|delay| Some((delay, straight(shares(delay))?.2)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut delay = best.0;
    let (mut known, mut weight) = (None, None);
    for _ in 0..ITERATIONS {
        let (black, white, _) = straight(shares(delay))?;
        let mut normal = [[0.0; 3]; 3];
        let mut right = [0.0; 3];
        let (mut squares, mut frames) = (0.0, 0);
        for (mean, share, slope) in shares(delay) {
            let off = mean - (black + white * share);
            let by = [1.0, share, white * slope];
            for (row, a) in by.iter().enumerate() {
                right[row] += a * off;
                for (column, b) in by.iter().enumerate() {
                    normal[row][column] += a * b;
                }
            }
            squares += off * off;
            frames += 1;
        }
        // Black and white are fitted already, so the right-hand side is zero except for the delay.
        match last_of_inverse(&normal) {
            Some(inverse) => {
                delay += (inverse * right[2]).clamp(-step, step);
                weight = Some(inverse);
            }
            // Exposures that begin with the light of a refresh have no change inside them with the
            // true delay, but with any other.
            None if weight.is_none() => delay += step / 2.0,
            None => {}
        }
        let scatter = (squares / f64::from((frames - 3).max(1))).sqrt();
        known = weight.map(|inverse: f64| (white, scatter, scatter * inverse.sqrt()));
    }
    let (white, scatter, error) = known?;
    // Adding 0 turns a negative zero into 0.
    let seconds = (delay * 1e6).round() * 1e-6 + 0.0;
    (white > LEAST_SIGNAL * scatter).then_some(Delay { seconds, error })
}

/// The straight line of means over shares: black, white above black, and the sum of squared
/// residuals.
fn straight(shares: impl Iterator<Item = (f64, f64, f64)>) -> Option<(f64, f64, f64)> {
    let (mut n, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (mean, share, _) in shares {
        n += 1.0;
        x += share;
        y += mean;
        xx += share * share;
        xy += share * mean;
        yy += mean * mean;
    }
    let spread = xx - x * x / n;
    if !(n > 3.0 && spread > 0.0) {
        return None;
    }
    let white = (xy - x * y / n) / spread;
    let black = (y - white * x) / n;
    let left = (yy - y * y / n) - white * (xy - x * y / n);
    Some((black, white, left))
}

/// The last diagonal element of the inverse of a symmetric matrix; none if it cannot be inverted.
fn last_of_inverse(m: &[[f64; 3]; 3]) -> Option<f64> {
    let minor = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    let determinant = m[2][2] * minor - m[0][2] * (m[0][2] * m[1][1] - m[0][1] * m[1][2])
        + m[1][2] * (m[0][2] * m[0][1] - m[0][0] * m[1][2]);
    let corner = minor / determinant;
    (corner.is_finite() && corner > 0.0).then_some(corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_element_of_an_inverse() {
        // Two blocks: the element is 1 / 4. Then a full matrix, by hand: 1.5.
        let blocks = [[2.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 4.0]];
        assert_eq!(last_of_inverse(&blocks), Some(0.25));
        let full = [[2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 4.0 / 3.0]];
        assert!((last_of_inverse(&full).unwrap() - 1.5).abs() < 1e-12);
        assert_eq!(last_of_inverse(&[[1.0; 3]; 3]), None);
    }
}
