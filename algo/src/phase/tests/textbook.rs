//! Any number of shifts at any bit depth, against the definition in `f64`.

use super::{by_definition, level, off, wrap};
use core::f64::consts::TAU;
use std::vec::Vec;

/// The arctangent's bound, and the rounding of S and C to words at the modulation used here.
const PHASE_BOUND: f64 = 2.5e-5 + 0.5 / 8_000.0 / TAU;
/// The polynomial for √(1 + t²), and rounding.
const MODULATION_SHARE: f64 = 6.5e-4 + 3e-4;

#[test]
fn any_number_of_steps_at_any_depth_agrees_with_the_definition() {
    let mut worst = 0.0_f64;
    for depth in 8..=16_u8 {
        let full = f64::from((1_u32 << depth) - 1);
        for steps in (3..=16).chain([33, 64]) {
            for start in [0.0, 0.25, -0.37] {
                let shifts: Vec<f64> = (0..steps)
                    .map(|k| start - f64::from(k) / f64::from(steps))
                    .collect();
                let rows: Vec<Vec<u16>> = shifts
                    .iter()
                    .map(|shift| {
                        let light = |i: i32| {
                            let phase = f64::from(i) / 40.0 + 0.003;
                            0.5 + 0.4 * libm::sin(TAU * (phase + shift))
                        };
                        (0..40)
                            .map(|i| libm::rint(full * light(i)) as u16)
                            .collect()
                    })
                    .collect();
                let found = wrap(&level(&shifts, depth), depth, &rows);
                for u in 0..40 {
                    let samples: Vec<u16> = rows.iter().map(|row| row[u]).collect();
                    let (turns, counts) = by_definition(&samples, &shifts);
                    let error = off(found.row().phase[u], turns).abs();
                    worst = worst.max(error);
                    assert!(
                        error <= PHASE_BOUND,
                        "{depth} bit, N = {steps}, start {start}: {error:e}"
                    );
                    let modulation = found.modulation(u, full);
                    assert!(
                        (modulation - counts).abs() <= counts * MODULATION_SHARE,
                        "{depth} bit, N = {steps}: {modulation} for {counts}"
                    );
                    assert_eq!(found.row().flags[u], 0);
                }
            }
        }
    }
    std::println!("N 3 to 64, 8 to 16 bit: largest error {worst:.3e} turn");
}

#[test]
fn the_modulation_threshold_is_sixteen_counts_exactly() {
    let decoder = level(&[0.0, 0.25, 0.5, 0.75], 8);
    let row = |x: u16| std::vec![x; 33];
    let others = [row(100), row(100), row(100)];
    let with = |first: u16| {
        let [b, c, d] = others.clone();
        wrap(&decoder, 8, &[row(first), b, c, d])
    };
    assert_eq!(with(132).row().flags, [0; 33]);
    assert_eq!(with(131).row().flags, [1; 33]);
    let thirds = level(&[0.0, 1.0 / 3.0, 2.0 / 3.0], 8);
    // B = (2/3) · 24 = 16.
    let found = |first| {
        wrap(&thirds, 8, &[row(first), row(100), row(100)])
            .row()
            .flags[32]
    };
    assert_eq!((found(124), found(123)), (0, 1));
}

#[test]
fn constant_frames_are_weak_and_full_scale_is_saturated() {
    for steps in [3_u8, 4, 5, 7, 8, 9] {
        for depth in [8_u8, 10, 12, 16] {
            let full = ((1_u32 << depth) - 1) as u16;
            let shifts: Vec<f64> = (0..steps)
                .map(|k| f64::from(k) / f64::from(steps))
                .collect();
            let decoder = level(&shifts, depth);
            let constant = |x: u16| {
                let rows = std::vec![std::vec![x; 40]; usize::from(steps)];
                wrap(&decoder, depth, &rows).row().flags[5]
            };
            assert_eq!(constant(full), 1 + 2, "N = {steps}, {depth} bit");
            assert_eq!(constant(full - 1), 1);
        }
    }
}
