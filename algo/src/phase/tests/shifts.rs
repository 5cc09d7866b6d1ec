//! Accuracy of every number of shifts at every kind of depth, over random pixels.

use super::super::LeastModulation;
use super::{by_definition, level, off, wrap};
use core::f64::consts::TAU;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// Largest error and RMS of the phase in turns, and largest error of the modulation as a share. The
/// arctangent's bound (2.5e-5); half a unit in S and in C at the least length of 3000; the
/// polynomial for √(1 + t²) (6.5e-4), half a unit again (1.7e-4), and half a unit in the modulation
/// at its least (2.4e-4).
const BOUND: [f64; 3] = [2.5e-5 + 3.75e-5, 1.1e-5, 1.1e-3];
/// The bounds at the least length of N = 4 of more than 12 bits, 2056.
const COARSE: [f64; 3] = [2.5e-5 + 5.5e-5, 1.3e-5, 1.4e-3];
/// Least modulations in counts of 255; the bounds are those of the first, and what is not the
/// arctangent's or the polynomial's share is larger where less is trusted.
const LEAST: [f64; 3] = [16.0, 7.0, 4.0];
/// Pixels per number of shifts and depth.
const PIXELS: usize = 20_000;

/// Samples of random offset, modulation from `least` of 255 counts on, and phase; one row per
/// shift.
fn rows(shifts: &[f64], full: f64, least: f64, random: &mut SplitMix64) -> Vec<Vec<u16>> {
    let mut rows = std::vec![Vec::new(); shifts.len()];
    let mut draw = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    for _ in 0..PIXELS {
        let modulation =
            full * (least + 0.1) / 255.0 * libm::pow(16.1 * 7.8 / (least + 0.1), draw());
        let offset = modulation + (full - 2.0 * modulation) * draw();
        let phase = draw();
        for (row, shift) in rows.iter_mut().zip(shifts) {
            let light = offset + modulation * libm::sin(TAU * (phase + shift));
            row.push(libm::rint(light).clamp(0.0, full - 1.0) as u16);
        }
    }
    rows
}

#[test]
fn every_number_of_shifts_is_within_the_bounds() {
    for least in LEAST {
        let mut random = SplitMix64::seed_from_u64(7);
        for depth in [8, 10, 12, 14, 16_u8] {
            for n in 3..=10_usize {
                within_the_bounds(depth, n, least, &mut random);
            }
        }
    }
}

fn within_the_bounds(depth: u8, n: usize, least: f64, random: &mut SplitMix64) {
    let full = f64::from((1_u32 << depth) - 1);
    let shifts: Vec<f64> = (0..n).map(|k| k as f64 / n as f64).collect();
    let rows = rows(&shifts, full, least, random);
    let decoder = level(&shifts, depth);
    let decoder = decoder.with_least_modulation(LeastModulation::new(least).unwrap());
    let found = wrap(&decoder, depth, &rows);
    let fainter = 16.0 / least;
    let (mut worst, mut squares, mut share) = (0.0_f64, 0.0_f64, 0.0_f64);
    for u in 0..PIXELS {
        let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
        let (turns, counts) = by_definition(&samples, &shifts);
        if found.row().flags[u] != 0 {
            // And rounding.
            let least = least / 255.0 * (1.0 + 5e-4 * fainter);
            assert!(counts < least * full, "{depth} bit, N = {n}: {samples:?}");
            continue;
        }
        let error = off(found.row().phase[u], turns);
        worst = worst.max(error.abs());
        squares += error * error;
        share = share.max((found.modulation(u, full) / counts - 1.0).abs());
    }
    let rms = libm::sqrt(squares / PIXELS as f64);
    std::println!(
        "{depth} bit, N = {n}, {least} counts: largest error {worst:.3e} turn, RMS {rms:.3e}, modulation {share:.2e}"
    );
    let coarse = n == 4 && depth > 12;
    let bound = if coarse { COARSE } else { BOUND };
    let scaled = |bound: f64, fixed: f64| fixed + (bound - fixed) * fainter;
    let bound = [
        scaled(bound[0], 2.5e-5),
        bound[1] * fainter,
        scaled(bound[2], 6.5e-4),
    ];
    assert!(
        worst <= bound[0] && rms <= bound[1] && share <= bound[2],
        "{depth} bit, N = {n}, {least} counts"
    );
}
