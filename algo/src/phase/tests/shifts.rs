//! Accuracy of every number of shifts at every kind of depth, over random pixels.

use super::{by_definition, level, off, wrap};
use core::f64::consts::TAU;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// Largest error and RMS of the phase in turns, and largest error of the modulation as a share. The arctangent's bound (2.5e-5);
/// half a unit in S and in C at the least length of 3000; the polynomial for √(1 + t²) (6.5e-4), half a unit again (1.7e-4), and
/// half a unit in the modulation at its least (2.4e-4).
const BOUND: [f64; 3] = [2.5e-5 + 3.75e-5, 1.1e-5, 1.1e-3];
/// The same at the least length of N = 4 of more than 12 bits, 2056.
const COARSE: [f64; 3] = [2.5e-5 + 5.5e-5, 1.3e-5, 1.4e-3];
/// The trusted minimum of the modulation as a share of full scale, and rounding.
const LEAST: f64 = 16.0 / 255.0 * 1.0005;
/// Pixels per number of shifts and depth.
const PIXELS: usize = 20_000;

/// Samples of random offset, modulation from the trusted minimum on, and phase; one row per shift.
fn rows(shifts: &[f64], full: f64, random: &mut SplitMix64) -> Vec<Vec<u16>> {
    let mut rows = std::vec![Vec::new(); shifts.len()];
    let mut draw = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    for _ in 0..PIXELS {
        let modulation = full * 16.1 / 255.0 * libm::pow(7.8, draw());
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
    let mut random = SplitMix64::seed_from_u64(7);
    for depth in [8, 10, 12, 14, 16_u8] {
        let full = f64::from((1_u32 << depth) - 1);
        for n in 3..=10_usize {
            let shifts: Vec<f64> = (0..n).map(|k| k as f64 / n as f64).collect();
            let rows = rows(&shifts, full, &mut random);
            let found = wrap(&level(&shifts, depth), depth, &rows);
            let (mut worst, mut squares, mut share) = (0.0_f64, 0.0_f64, 0.0_f64);
            for u in 0..PIXELS {
                let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
                let (turns, counts) = by_definition(&samples, &shifts);
                if found.row().flags[u] != 0 {
                    assert!(counts < LEAST * full, "{depth} bit, N = {n}: {samples:?}");
                    continue;
                }
                let error = off(found.row().phase[u], turns);
                worst = worst.max(error.abs());
                squares += error * error;
                share = share.max((found.modulation(u, full) / counts - 1.0).abs());
            }
            let rms = libm::sqrt(squares / PIXELS as f64);
            std::println!(
                "{depth} bit, N = {n}: largest error {worst:.3e} turn, RMS {rms:.3e}, modulation {share:.2e}"
            );
            let coarse = n == 4 && depth > 12;
            let bound = if coarse { COARSE } else { BOUND };
            assert!(
                worst <= bound[0] && rms <= bound[1] && share <= bound[2],
                "{depth} bit, N = {n}"
            );
        }
    }
}
