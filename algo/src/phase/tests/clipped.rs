//! Pixels of which some samples are at full scale: their phases against the truth, and σ.

use super::{Demodulated, level, off, wrap};
use crate::simd::Backend;
use crate::trust::LeastModulation;
use core::f64::consts::TAU;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// σ of a sample, counts of 255.
const NOISE: f64 = 1.8;
const PIXELS: usize = 20_000;

struct Draw(SplitMix64);

impl Draw {
    fn share(&mut self) -> f64 {
        ((self.0.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let length = libm::sqrt(-2.0 * libm::log(self.share()));
        length * libm::cos(TAU * self.share())
    }
}

/// What became of pixels with clipped samples.
#[derive(Default)]
struct Tally {
    clipped: usize,
    found: usize,
    squares: f64,
    far: usize,
}

impl Tally {
    fn scatter(&self) -> f64 {
        libm::sqrt(self.squares / self.found as f64)
    }
}

/// Pixels of N shifts of full modulation, whose light is `peak` of full scale at most.
fn tally(depth: u8, n: usize, peak: f64, seed: u64) -> Tally {
    let full = f64::from((1_u32 << depth) - 1);
    let noise = NOISE * full / 255.0;
    let shifts: Vec<f64> = (0..n).map(|k| k as f64 / n as f64).collect();
    let mut draw = Draw(SplitMix64::seed_from_u64(seed));
    let phases: Vec<f64> = (0..PIXELS).map(|_| draw.share()).collect();
    let rows: Vec<Vec<u16>> = shifts
        .iter()
        .map(|shift| {
            let light = |phase: &f64| {
                let wave = 0.5 * peak * full * (1.0 + libm::sin(TAU * (phase + shift)));
                libm::rint(wave + noise * draw.normal()).clamp(0.0, full) as u16
            };
            phases.iter().map(light).collect()
        })
        .collect();
    let least = LeastModulation::of_noise(noise, depth);
    let decoder = level(&shifts, depth).with_least_modulation(least);
    let found = wrap(&decoder, depth, &rows);
    let mut tally = Tally::default();
    for (u, phase) in phases.iter().enumerate() {
        if rows.iter().all(|row| f64::from(row[u]) < full) {
            continue;
        }
        tally.clipped += 1;
        if found.row().flags[u] != 0 {
            continue;
        }
        tally.found += 1;
        let counts = found.modulation(u, full);
        // Rounding adds 1/12.
        let sample = libm::sqrt(noise * noise + 1.0 / 12.0);
        let sigma = sample / (TAU * counts) * libm::sqrt(2.0 / n as f64);
        let error = off(found.row().phase[u], *phase) / sigma;
        tally.squares += error * error;
        tally.far += usize::from(error.abs() > 4.0);
    }
    tally
}

#[test]
fn clipped_samples_are_left_out_and_sigma_says_what_is_left() {
    let mut all = Tally::default();
    for n in 4..=12 {
        for peak in [1.02, 1.1, 1.2, 1.5, 2.0, 3.0] {
            let tally = tally(8, n, peak, 100 + n as u64);
            let scatter = tally.scatter();
            std::println!(
                "N = {n}, {peak} of full scale: {:.3} of {} clipped pixels, scatter/σ {scatter:.3}, beyond 4 σ {:.1e}",
                tally.found as f64 / tally.clipped as f64,
                tally.clipped,
                tally.far as f64 / tally.found as f64,
            );
            all.found += tally.found;
            all.far += tally.far;
            all.squares += tally.squares;
            // σ is never too small. It is too large where the modulation is more than words hold,
            // about 0.5 to 0.65 of full scale.
            let least = if peak < 1.3 { 0.9 } else { 0.0 };
            let enough = tally.found < 1000 || (least..1.05).contains(&scatter);
            assert!(enough, "N = {n}, {peak}: {scatter}");
            if n >= 8 {
                assert_eq!(tally.found, tally.clipped, "N = {n}, {peak}");
            }
        }
    }
    let scatter = all.scatter();
    std::println!(
        "scatter/σ {scatter:.3}, {} of {} beyond 4 σ",
        all.far,
        all.found
    );
    assert!((0.9..1.1).contains(&scatter), "{scatter}");
    assert!(5000 * all.far <= all.found, "{} of {}", all.far, all.found);
}

#[test]
fn whole_pixels_beside_clipped_ones_keep_their_bits_on_every_back_end() {
    let mut draw = Draw(SplitMix64::seed_from_u64(5));
    for (depth, n) in [
        (8, 4),
        (8, 5),
        (8, 6),
        (8, 9),
        (8, 11),
        (10, 4),
        (12, 7),
        (16, 4),
    ] {
        let full = ((1_u32 << depth) - 1) as u16;
        let shifts: Vec<f64> = (0..n).map(|k| f64::from(k) / f64::from(n)).collect();
        let mut sample = |_| (draw.share() * f64::from(full)) as u16;
        let whole: Vec<Vec<u16>> = shifts
            .iter()
            .map(|_| (0..97).map(&mut sample).collect())
            .collect();
        let mut clipped = whole.clone();
        for (u, sample) in clipped[1].iter_mut().enumerate() {
            if u % 7 == 3 {
                *sample = full;
            }
        }
        let decoder = level(&shifts, depth);
        let without = wrap(&decoder, depth, &whole);
        let found = wrap(&decoder, depth, &clipped);
        for u in (0..97).filter(|u| u % 7 != 3) {
            let of = |row: &Demodulated| (row.row().phase[u], row.row().flags[u], row.1[u]);
            assert_eq!(of(&found), of(&without), "{depth} bit, N = {n}, pixel {u}");
        }
        for backend in Backend::available() {
            let other = wrap(&decoder.clone().with_backend(backend), depth, &clipped);
            assert_eq!(other.row().phase, found.row().phase, "{backend:?}");
            assert_eq!(other.row().flags, found.row().flags, "{backend:?}");
            assert_eq!(other.1, found.1, "{backend:?}");
        }
    }
}
