//! Unusable light: none, too much, light without the pattern, and light without any structure.

use super::bounds::Tally;
use super::random::{Draw, KINDS};
use super::rig;
use super::stack::{Stack, pool, shots};
use algo::frame::SampleNoise;
use algo::phase::{LeastModulation, Trust};
use algo::pipeline::triangulate;
use algo::units::AbsolutePhase;
use std::f64::consts::TAU;
use tests::random::Random;

const SEED: u64 = 20_260_606;
/// Smallest trusted modulations at 8 bit; proportional to full scale. The first is that of unknown
/// noise.
const LEAST_COUNTS: [f64; 4] = [16.0, 4.0, 7.5, 25.0];
/// The arctangent, turns.
const ARCTANGENT: f64 = 2.5e-5;
/// Half a unit in S and in C, which have 128 units per count of 255 at least, over 2π: turns ·
/// counts.
const UNITS: f64 = 0.71 / 128.0 / TAU;
/// RMS of the error where the light exceeds full scale by a tenth, turns: that of the arctangent and of
/// rounded samples, as the clipped ones are left out. It was 7e-4 with them, of 8 shifts.
const SATURATED_RMS: f64 = 2e-5;

/// Three geometric levels of `shifts`.
fn geometric(size: (usize, usize), bit_depth: u8, shifts: usize) -> Stack {
    let ratios = [0.94 / 60.0, (0.94_f64 / 60.0).sqrt(), 1.0];
    Stack::dark(size, bit_depth, shots(&ratios, shifts), (0.0, 60.0))
}

/// One level about a map of zeros.
fn single(size: (usize, usize), bit_depth: u8, shifts: usize) -> Stack {
    let mut stack = Stack::dark(size, bit_depth, shots(&[1.0], shifts), (0.0, 60.0));
    stack.map = Some(vec![AbsolutePhase::from_turns(0.0); stack.pixels()]);
    stack
}

#[test]
fn constant_frames_are_dark_at_every_level_depth_and_number_of_shifts() {
    for shifts in 3..=16 {
        for bit_depth in 8..=16 {
            for mut stack in [
                geometric((37, 2), bit_depth, shifts),
                single((37, 2), bit_depth, shifts),
            ] {
                let full = stack.full_scale();
                for level in [0, 1, full / 2, full - 1, full] {
                    stack.fill(|_, _| level);
                    let map = stack.decode();
                    assert_eq!(map.count(Trust::Dark), stack.pixels(), "{shifts} {level}");
                    let brightest = map.modulation.iter().max().unwrap();
                    assert!(
                        brightest.counts(255) < 0.1,
                        "{shifts} {level} {brightest:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn checkerboards_of_extremes_decode_as_the_textbook_says() {
    let mut tally = Tally::default();
    for shifts in 3..=16 {
        for bit_depth in [8, 10, 12, 16] {
            for mut stack in [
                geometric((33, 4), bit_depth, shifts),
                single((33, 4), bit_depth, shifts),
            ] {
                let full = stack.full_scale() - 1;
                let boards: [fn(usize, usize, usize) -> usize; 5] = [
                    |_, u, v| u + v,
                    |frame, _, _| frame,
                    |frame, u, v| frame + u + v,
                    |frame, u, _| frame / 2 + u,
                    |frame, u, v| (frame >> (u % 4)) + v,
                ];
                for board in boards {
                    stack.fill(|frame, pixel| {
                        full * (board(frame, pixel % 33, pixel / 33) % 2) as u16
                    });
                    tally.add(&stack, &stack.decode());
                }
            }
        }
    }
    tally.conclude("checkerboards");
}

#[test]
fn random_samples_decode_as_the_textbook_says() {
    let mut random = Random::new(SEED);
    let mut tally = Tally::default();
    for kind in KINDS {
        for shifts in 3..=16 {
            for bit_depth in [8, 9, 12, 16] {
                let draw = Draw {
                    kind,
                    size: (61, 5),
                    bit_depth,
                    shifts: Some(shifts),
                };
                let mut stack = super::random::stack(&mut random, draw);
                let full = usize::from(stack.full_scale());
                stack.fill(|_, _| random.below(full + 1) as u16);
                tally.add(&stack, &stack.decode());
            }
        }
    }
    tally.conclude("random samples");
}

#[test]
fn samples_beyond_the_bit_depth_are_survived_and_rejected() {
    let mut random = Random::new(SEED + 1);
    for shifts in 3..=16 {
        for bit_depth in [9, 10, 12, 15] {
            let mut stack = single((53, 3), bit_depth, shifts);
            let full = usize::from(stack.full_scale());
            stack.fill(|_, _| (full + random.below(65_536 - full)) as u16);
            let map = stack.decode();
            assert_eq!(map.count(Trust::Resolved), 0, "{shifts}, {bit_depth} bit");
        }
    }
}

#[test]
fn from_the_least_modulation_on_the_phase_is_known_and_below_it_never() {
    for least in LEAST_COUNTS {
        the_phase_is_known_from(least);
    }
}

fn the_phase_is_known_from(least: f64) {
    let mut tally = Tally::default();
    for shifts in 3..=16 {
        for bit_depth in [8, 10, 12, 16] {
            // A phase per column, a modulation per row.
            let mut stack = single((64, 40), bit_depth, shifts);
            stack.least = LeastModulation::new(least).expect("a least modulation");
            let scale = f64::from(stack.full_scale()) / 255.0;
            let truth = |pixel: usize| (0.9 * ((pixel % 64) as f64 / 64.0 - 0.5), 1 + pixel / 64);
            for pixel in 0..stack.pixels() {
                let (turns, counts) = truth(pixel);
                for frame in 0..shifts {
                    let sine = (TAU * (turns + stack.frames[frame].shift)).sin();
                    let light = scale * (100.3 + counts as f64 * sine);
                    stack.set(frame, pixel, light.round() as u16);
                }
            }
            let map = stack.decode();
            tally.add(&stack, &map);
            for pixel in 0..stack.pixels() {
                let (turns, counts) = truth(pixel);
                let counts = counts as f64;
                // Rounded samples change S and C by at most half a count each, and so B by at most
                // one.
                let rounding = 1.0 / scale;
                if counts + rounding < least {
                    assert_eq!(map.trust[pixel], Trust::Dark, "B = {counts}");
                } else if counts - rounding >= least {
                    assert_eq!(map.trust[pixel], Trust::Resolved, "B = {counts}");
                    let bound = rounding / counts / TAU + ARCTANGENT + UNITS / counts;
                    let error = map.phase[pixel].turns() - turns;
                    assert!(error.abs() <= bound, "B = {counts}: {error}");
                }
            }
        }
    }
    tally.conclude("1 to 40 counts");
}

#[test]
fn a_tenth_over_full_scale_is_rejected_with_three_shifts_and_no_error_with_more() {
    for shifts in 3..=16 {
        let mut stack = single((1024, 1), 12, shifts);
        let full = f64::from(stack.full_scale());
        let truth = |pixel: usize| 0.99 * (pixel as f64 / 1024.0 - 0.5);
        for pixel in 0..stack.pixels() {
            for frame in 0..shifts {
                let sine = (TAU * (truth(pixel) + stack.frames[frame].shift)).sin();
                let light = full * 1.1 * (0.5 + 0.5 * sine);
                stack.set(frame, pixel, light.round().min(full) as u16);
            }
        }
        let map = stack.decode();
        let (mut worst, mut squares) = (0.0_f64, 0.0);
        for pixel in 0..stack.pixels() {
            let clipped = (0..shifts).any(|f| stack.sample(f, pixel) == stack.full_scale());
            let rejected = clipped && shifts == 3;
            assert_eq!(map.trust[pixel] == Trust::Saturated, rejected, "{shifts}");
            if !rejected {
                let error = (map.phase[pixel].turns() - truth(pixel)).abs();
                worst = worst.max(error);
                squares += error * error;
            }
        }
        let rms = (squares / stack.pixels() as f64).sqrt();
        println!("{shifts} shifts: worst {worst:.2e} turn, RMS {rms:.2e}");
        assert!(rms <= SATURATED_RMS, "{shifts}: {rms:e}");
        assert!(worst <= 4.0 * SATURATED_RMS, "{shifts}: {worst:e}");
    }
}

#[test]
fn what_has_no_phase_has_no_height_whatever_the_frames_hold() {
    let mut random = Random::new(SEED + 2);
    let side = 48;
    let solver = rig::study(side, 60.0);
    let (mut with, mut without) = (0, 0);
    for shifts in [3, 4, 8] {
        let mut stack = geometric((side, side), 8, shifts);
        for wild in [false, true] {
            stack.fill(|_, _| match wild {
                true => [0, 255][random.below(2)],
                false => random.below(256) as u16,
            });
            let decoder = stack.decoder();
            let noise = SampleNoise::new(1.5, 0.04);
            let run = || {
                let mut phases = stack.decode();
                let heights = triangulate(&solver, &decoder, Some(noise), &mut phases, &|_| ());
                (phases, heights)
            };
            let (phases, heights) = run();
            let (_, again) = pool(1).install(run);
            assert_eq!(heights.height, again.height);
            let bits = |map: &[f32]| map.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&heights.sigma), bits(&again.sigma));
            for pixel in 0..stack.pixels() {
                let (height, sigma) = (heights.height[pixel], heights.sigma[pixel]);
                if phases.trust[pixel] == Trust::Resolved {
                    let range = solver.range();
                    assert!((range.low..=range.high).contains(&height.mm()));
                    assert!(sigma > 0.0 && sigma.is_finite(), "{sigma}");
                    with += 1;
                } else {
                    assert!(!height.is_known() && sigma.is_nan(), "pixel {pixel}");
                    without += 1;
                }
            }
        }
    }
    println!("{with} heights, {without} without");
    assert!(with > 50 && without > 1000, "{with} {without}");
}
