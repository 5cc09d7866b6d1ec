//! Accuracy of four shifts at 8 bits, over every pair of differences.

use super::super::Decoder;
use super::super::LeastModulation;
use super::super::arrived::ArrivedRow;
use super::{arrive, by_definition, bytes_of, level, off, wrap};
use crate::frame::{FrameView, Samples};
use crate::pattern::{PhaseRange, Sequence, Shot};
use std::vec::Vec;

const SHIFTS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Least modulations: the bounds, about 5.66 counts, below which words are lifted, the one of
/// unknown noise and about it, and others.
const LEAST: [f64; 10] = [4.0, 5.0, 5.69, 5.71, 15.9, 16.0, 16.1, 27.0, 40.0, 127.5];
/// Quotient, polynomial and two roundings.
const WORST_TURNS: f64 = 2.5e-5;
const RMS_TURNS: f64 = 1e-5;
/// Reciprocal 0.2 % of t (1.4e-4 turn at t = 1), arctangent 1.9e-4, roundings.
const ROUGH_TURNS: f64 = 3.4e-4;

/// Rows of four samples whose differences are `s` and, from column to column, −255 to 255.
fn differences(s: i32) -> [Vec<u16>; 4] {
    let pair = |x: i32| [x.max(0) as u16, (-x).max(0) as u16];
    core::array::from_fn(|frame| {
        let sample = |c: i32| match frame {
            0 | 2 => pair(s)[frame / 2],
            _ => pair(c)[frame / 2],
        };
        (-255..=255).map(sample).collect()
    })
}

/// A sample at full scale is left out ([`super::clipped`]).
fn is_clipped(s: i32, c: i32) -> bool {
    s.abs() == 255 || c.abs() == 255
}

#[test]
fn every_pair_of_8_bit_differences_is_within_the_bound() {
    for least in LEAST {
        every_pair_is_within_the_bound(least);
    }
}

fn every_pair_is_within_the_bound(least: f64) {
    let decoder = level(&SHIFTS, 8).with_least_modulation(LeastModulation::new(least).unwrap());
    // The polynomial for √(1 + t²), and the last bit of a word at the least modulation.
    let share = 6.5e-4 + 4e-4 * (16.0 / least).max(1.0);
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
    for s in -255..=255_i32 {
        let rows = differences(s);
        let found = wrap(&decoder, 8, &rows);
        for (u, c) in (-255..=255_i32).enumerate() {
            if is_clipped(s, c) {
                continue;
            }
            let weak = f64::from(s * s + c * c) < 4.0 * least * least;
            let flags = u8::from(weak);
            assert_eq!(found.row().flags[u], flags, "{least} S {s} C {c}");
            // Flags are those of words, modulations those of bytes.
            let modulation = found.modulation(u, 255.0);
            assert_eq!(modulation > 0.0, flags == 0, "{least} S {s} C {c}");
            if weak {
                continue;
            }
            let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
            let (turns, counts) = by_definition(&samples, &SHIFTS);
            let error = off(found.row().phase[u], turns);
            worst = worst.max(error.abs());
            squares += error * error;
            count += 1.0;
            assert!(
                (modulation - counts).abs() <= counts * share,
                "{least} S {s} C {c}: {modulation} for {counts}"
            );
        }
    }
    let rms = libm::sqrt(squares / count);
    std::println!("8 bit, N = 4, {least} counts: largest error {worst:.3e} turn, RMS {rms:.3e}");
    assert!(worst <= WORST_TURNS, "{worst:e}");
    assert!(rms <= RMS_TURNS, "{rms:e}");
}

#[test]
fn every_rough_angle_is_within_the_bound() {
    let levels = [1.0 / 8.0, 1.0].map(|ratio| SHIFTS.map(|shift| Shot::sine(ratio, shift)));
    let sequence = Sequence::from_frames(levels.as_flattened()).unwrap();
    let range = PhaseRange { min: 0.0, max: 8.0 };
    let decoder = Decoder::new(&sequence, range, 8).unwrap();
    let mut worst = 0.0_f64;
    for s in -255..=255_i32 {
        let rows = differences(s);
        let bytes = rows.each_ref().map(|row| bytes_of(row));
        let frames = bytes
            .each_ref()
            .map(|row| FrameView::new(Samples::Eight(row), row.len(), 1, row.len()).unwrap());
        let mut arrived = decoder.arrived(511, 1);
        arrive(&decoder, &frames, &mut arrived);
        let ArrivedRow::Predicted(row) = arrived.row(0) else {
            panic!("not geometric")
        };
        for (u, c) in (-255..=255_i32).enumerate() {
            if s * s + c * c < 32 * 32 || is_clipped(s, c) {
                continue;
            }
            let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
            // The prediction for the next level, counted from the middle of the turn.
            let (turns, _) = by_definition(&samples, &SHIFTS);
            let expected = 8.0 * (turns - 0.5);
            worst = worst.max(off(row.fraction[u], expected).abs() / 8.0);
        }
    }
    std::println!("8 bit, N = 4: largest rough error {worst:.3e} turn");
    assert!(worst <= ROUGH_TURNS, "{worst:e}");
}

#[test]
fn axes_and_diagonals_are_exact() {
    let decoder = level(&SHIFTS, 8);
    for (s, c, turn) in [
        (0, 200, 0x0000),
        (150, 150, 0x2000),
        (77, 0, 0x4000),
        (33, -33, 0x6000),
        (0, -64, 0x8000),
        (-254, -254, 0xA000),
        (-40, 0, 0xC000),
        (-128, 128, 0xE000),
    ] {
        let of = |x: i32| std::vec![x as u16; 40];
        let rows = [of(s.max(0)), of(c.max(0)), of(-s.min(0)), of(-c.min(0))];
        let found = wrap(&decoder, 8, &rows);
        let error = found.row().phase[17].wrapping_sub(turn).cast_signed();
        assert!(error.abs() <= 1, "S {s} C {c}: {error}");
    }
}
