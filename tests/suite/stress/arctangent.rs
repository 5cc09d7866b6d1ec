//! All differences of 8-bit samples with four shifts, decoded by the complete decoder.

use super::bounds::ARCTANGENT;
use super::stack::{Stack, shots};
use algo::pattern::Shot;
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use std::f64::consts::TAU;

/// Largest RMS of the error, turns; the prototype of such a kernel has 6.7e-6.
const RMS: f64 = 1e-5;
/// Number of differences from −255 to 255.
const DIFFERENCES: usize = 511;
/// The square of N/2 · 16 counts: S² + C² of the smallest trusted modulation.
const LEAST_POWER: i32 = 32 * 32;

/// The errors over all pairs.
struct Error {
    trusted: usize,
    worst: f64,
    rms: f64,
}

/// Differences S and C of a pixel.
fn pair(pixel: usize) -> (i32, i32) {
    let difference = |i: usize| i as i32 - 255;
    (
        difference(pixel % DIFFERENCES),
        difference(pixel / DIFFERENCES),
    )
}

/// Four samples around `middle` with these differences, below full scale if possible, in the order
/// of the shifts k/4: S = I₀ − I₂, C = I₁ − I₃.
fn samples((s, c): (i32, i32), middle: i32) -> [u16; 4] {
    let two = |difference: i32| {
        let most = (254 - difference.abs()).max(0);
        let low = (middle - difference.abs() / 2).clamp(0, most);
        if difference < 0 {
            (low, low - difference)
        } else {
            (low + difference, low)
        }
    };
    let ((first, third), (second, fourth)) = (two(s), two(c));
    [first, second, third, fourth].map(|sample| sample as u16)
}

/// Decodes every pair in the finest level of a sequence and compares its phase, modulo whole turns.
fn exhaust(name: &str, mut stack: Stack, middle: i32) -> Error {
    let finest = stack.frames.len() - 4;
    for pixel in 0..stack.pixels() {
        let (s, c) = pair(pixel);
        let turns = f64::from(s).atan2(f64::from(c)) / TAU;
        let phase = 40.0 + turns;
        for frame in 0..finest {
            let Shot { ratio, shift, .. } = stack.frames[frame];
            let light = 127.0 + 100.0 * (TAU * (ratio * phase + shift)).sin();
            stack.set(frame, pixel, light.round() as u16);
        }
        for (k, sample) in samples((s, c), middle).into_iter().enumerate() {
            stack.set(finest + k, pixel, sample);
        }
    }
    let map = stack.decode();
    let (mut trusted, mut worst, mut squares) = (0, 0.0_f64, 0.0);
    for pixel in 0..stack.pixels() {
        let (s, c) = pair(pixel);
        let brightest = samples((s, c), middle).into_iter().max();
        let weak = s * s + c * c < LEAST_POWER;
        let first = if finest == 0 {
            Trust::Dark
        } else {
            Trust::LowModulation
        };
        // A sample at full scale is left out, and these are no sines.
        if brightest == Some(255) {
            continue;
        }
        let expected = if weak { first } else { Trust::Resolved };
        assert_eq!(map.trust[pixel], expected, "S = {s}, C = {c}");
        if expected != Trust::Resolved {
            continue;
        }
        let truth = f64::from(s).atan2(f64::from(c)) / TAU;
        let off = map.phase[pixel].turns() - truth;
        if finest > 0 {
            assert_eq!(off.round(), 40.0, "S = {s}, C = {c}: another fringe");
        }
        let error = (off - off.round()).abs();
        trusted += 1;
        worst = worst.max(error);
        squares += error * error;
    }
    let rms = (squares / trusted as f64).sqrt();
    println!("{name}: {trusted} pairs, worst {worst:.3e} turn, RMS {rms:.3e}");
    Error {
        trusted,
        worst,
        rms,
    }
}

fn check(name: &str, stack: Stack, middle: i32) {
    let error = exhaust(name, stack, middle);
    // All except those below 16 counts and those that need a sample of 255.
    assert!(error.trusted > 250_000, "{name}: {}", error.trusted);
    assert!(error.worst <= ARCTANGENT, "{name}: {:e}", error.worst);
    assert!(error.rms <= RMS, "{name}: {:e}", error.rms);
}

fn dark(ratios: &[f64], range: (f64, f64)) -> Stack {
    Stack::dark((DIFFERENCES, DIFFERENCES), 8, shots(ratios, 4), range)
}

#[test]
fn every_pair_of_eight_bit_differences_decodes_within_the_bound_of_the_arctangent() {
    let mut single = dark(&[1.0], (0.0, 50.0));
    single.map = Some(vec![AbsolutePhase::from_turns(0.0); single.pixels()]);
    check("one level about a map", single, 127);
    for middle in [0, 254] {
        check("one level", dark(&[1.0], (0.0, 0.9)), middle);
    }
    let ratios = [0.94 / 80.0, (0.94_f64 / 80.0).sqrt(), 1.0];
    check("three levels", dark(&ratios, (0.0, 80.0)), 127);
}
