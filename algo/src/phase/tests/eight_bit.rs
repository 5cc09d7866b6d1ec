//! Four shifts of 8 bits: every pair of differences.

use super::{by_definition, level, off, wrap};
use std::vec::Vec;

const SHIFTS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Quotient, polynomial and two roundings; the bound.
const WORST_TURNS: f64 = 2.5e-5;
const RMS_TURNS: f64 = 1e-5;
/// The polynomial for √(1 + t²), and the last bit of a word at the least modulation.
const MODULATION_SHARE: f64 = 6.5e-4 + 4e-4;

#[test]
fn every_pair_of_8_bit_differences_is_within_the_bound() {
    let decoder = level(&SHIFTS, 8);
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
    for s in -255..=255_i32 {
        let pair = |x: i32| [x.max(0) as u16, (-x).max(0) as u16];
        let rows: [Vec<u16>; 4] = core::array::from_fn(|frame| {
            let sample = |c: i32| match frame {
                0 | 2 => pair(s)[frame / 2],
                _ => pair(c)[frame / 2],
            };
            (-255..=255).map(sample).collect()
        });
        let found = wrap(&decoder, 8, &rows);
        for (u, c) in (-255..=255_i32).enumerate() {
            let weak = s * s + c * c < 32 * 32;
            let full = s.abs() == 255 || c.abs() == 255;
            let doubts = u8::from(weak) + 2 * u8::from(full);
            assert_eq!(found.doubts[u], doubts, "S {s} C {c}");
            if weak {
                continue;
            }
            let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
            let (turns, counts) = by_definition(&samples, &SHIFTS);
            let error = off(found.phase[u], turns);
            worst = worst.max(error.abs());
            squares += error * error;
            count += 1.0;
            let modulation = f64::from(found.modulation[u]) * 255.0 / 32_767.5;
            assert!(
                (modulation - counts).abs() <= counts * MODULATION_SHARE,
                "S {s} C {c}: {modulation} for {counts}"
            );
        }
    }
    let rms = libm::sqrt(squares / count);
    std::println!("8 bit, N = 4: largest error {worst:.3e} turn, RMS {rms:.3e}");
    assert!(worst <= WORST_TURNS, "{worst:e}");
    assert!(rms <= RMS_TURNS, "{rms:e}");
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
        let error = found.phase[17].wrapping_sub(turn).cast_signed();
        assert!(error.abs() <= 1, "S {s} C {c}: {error}");
    }
}
