//! Seeded stacks of every form: any number of shifts, depth, ratios, size and stride.

use super::stack::Stack;
use algo::pattern::{MAX_LEVEL_FACTOR, Shot};
use algo::phase::LeastModulation;
use algo::units::AbsolutePhase;
use std::f64::consts::TAU;
use tests::random::Random;

/// The forms of levels.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    Geometric,
    DenseThree,
    DenseTwo,
    Single,
}

pub const KINDS: [Kind; 4] = [
    Kind::Geometric,
    Kind::DenseThree,
    Kind::DenseTwo,
    Kind::Single,
];

/// The fixed properties of a stack; all others are random.
#[derive(Clone, Copy, Debug)]
pub struct Draw {
    pub kind: Kind,
    pub size: (usize, usize),
    pub bit_depth: u8,
    /// Shifts of every level; if `None`, random for each, 3 to 16.
    pub shifts: Option<usize>,
}

/// A random number between two values.
pub fn between(random: &mut Random, low: f64, high: f64) -> f64 {
    low + (high - low) * random.share()
}

/// A stack of lit pixels with noise of up to 3 % of full scale, some weak, some saturated, and some
/// with random samples; also a map for the forms that need one, unknown at some pixels and too far
/// off at others.
pub fn stack(random: &mut Random, draw: Draw) -> Stack {
    let min = between(random, -20.0, 20.0);
    let span = between(random, 5.0, 150.0);
    let (ratios, reach) = ratios(random, draw.kind, span);
    let frames = frames(random, &ratios, draw.shifts);
    let mut stack = Stack::dark(draw.size, draw.bit_depth, frames, (min, min + span));
    if random.below(2) == 0 {
        let stride = stack.width + random.below(40);
        stack = stack.with_stride(stride);
    }
    let full = f64::from(stack.full_scale());
    let mut map = Vec::with_capacity(stack.pixels());
    for pixel in 0..stack.pixels() {
        let phase = between(random, min, min + span);
        let known = phase - 1.2 * between(random, -reach, reach);
        map.push(match random.below(30) {
            0 => AbsolutePhase::UNKNOWN,
            _ => AbsolutePhase::from_turns(known),
        });
        let (offset, modulation, noise) = light(random);
        let wild = random.below(6) == 0;
        for frame in 0..stack.frames.len() {
            let Shot { ratio, shift, .. } = stack.frames[frame];
            let sine = (TAU * (ratio * phase + shift)).sin();
            let share = offset + modulation * sine + between(random, -noise, noise);
            let share = if wild { random.share() } else { share };
            stack.set(frame, pixel, (full * share).round().clamp(0.0, full) as u16);
        }
    }
    stack.map = (!matches!(draw.kind, Kind::Geometric)).then_some(map);
    let least = [16.0, 4.0, 7.5][stack.pixels() % 3];
    stack.least = LeastModulation::new(least).expect("a least modulation");
    stack
}

/// Offset, modulation and noise of a pixel, as shares of full scale.
fn light(random: &mut Random) -> (f64, f64, f64) {
    let noise = [0.0, 0.003, 0.03][random.below(3)];
    match random.below(8) {
        // Near the threshold of 4 to 16 of 255, and below it.
        0 => (0.3, between(random, 0.0, 0.08), noise),
        // Up to a tenth over full scale.
        1 => (0.55, between(random, 0.4, 0.55), noise),
        _ => {
            let modulation = between(random, 0.07, 0.48);
            (
                modulation + between(random, 0.0, 0.98 - 2.0 * modulation),
                modulation,
                noise,
            )
        }
    }
}

/// Ratios of a form for a phase function of this span, and how far its map may be off, turns.
fn ratios(random: &mut Random, kind: Kind, span: f64) -> (Vec<f64>, f64) {
    match kind {
        Kind::Geometric => {
            let coarsest = between(random, 0.6, 1.0) / span;
            let finest = if random.below(2) == 0 {
                1.0
            } else {
                between(random, 0.4, 1.8)
            };
            let rise: f64 = finest / coarsest;
            let fewest = (rise.ln() / MAX_LEVEL_FACTOR.ln()).ceil() as usize;
            let steps = fewest + random.below(4);
            let step = rise.powf(1.0 / steps as f64);
            let mut ratios: Vec<f64> = (0..steps)
                .map(|level| coarsest * step.powi(level as i32))
                .collect();
            ratios.push(finest);
            (ratios, 0.0)
        }
        Kind::DenseThree => {
            let n = order(random, 3);
            let ratios = vec![1.0 - 1.0 / n, 1.0 - 1.0 / (n * n), 1.0];
            (ratios, n * n / 2.0 - n)
        }
        Kind::DenseTwo => {
            let n = order(random, 2);
            (vec![1.0 - 1.0 / n, 1.0], n / 2.0)
        }
        Kind::Single => {
            let ratio = between(random, 0.3, 1.8);
            (vec![ratio], 0.5 / ratio)
        }
    }
}

/// A whole or a real n.
fn order(random: &mut Random, least: usize) -> f64 {
    let whole = (least + random.below(6)) as f64;
    if random.below(2) == 0 {
        whole
    } else {
        whole + random.share()
    }
}

/// Frames of levels in random order; the shifts start at a random value and increase or decrease.
fn frames(random: &mut Random, ratios: &[f64], shifts: Option<usize>) -> Vec<Shot> {
    let mut frames = Vec::new();
    for &ratio in ratios {
        let count = shifts.unwrap_or_else(|| 3 + random.below(14));
        let start = [0.0, 0.0, 0.25, random.share() - 0.5][random.below(4)];
        let sign = [1.0, -1.0][random.below(2)];
        let shift = |k| start + sign * k as f64 / count as f64;
        frames.extend((0..count).map(shift).map(|shift| Shot::sine(ratio, shift)));
    }
    if random.below(2) == 0 {
        for place in (1..frames.len()).rev() {
            frames.swap(place, random.below(place + 1));
        }
    }
    frames
}
