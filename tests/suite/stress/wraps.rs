//! Phases at and near every wrap: no fringe order is wrong in frames without noise.

use super::bounds::ROUNDING;
use super::random::between;
use super::stack::{Stack, shots};
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use std::f64::consts::TAU;
use tests::random::Random;

const SEED: u64 = 20_260_607;
const FRINGES: f64 = 100.0;
/// Offset and modulation, shares of full scale.
const LIGHT: (f64, f64) = (0.5, 0.3);

/// Every 65,536th of a turn once, spread over the 100 fringes; every half turn of each fringe and
/// phases within a few units and a few hundredths of it; both ends.
fn phases(min: f64) -> Vec<f64> {
    let unit = 1.0 / 65_536.0;
    let mut phases: Vec<f64> = (0..65_536)
        .map(|i| f64::from(i * 37 % 100) + f64::from(i) * unit)
        .collect();
    for half_turns in 0..=2 * FRINGES as i32 {
        let middle = f64::from(half_turns) / 2.0;
        phases.push(middle);
        for k in 0..12 {
            let beside = unit * 0.5 * f64::from(1 << k);
            phases.extend([middle - beside, middle + beside]);
        }
        phases.extend([middle - 1e-9, middle + 1e-9]);
    }
    let end = min + FRINGES;
    let shifted = phases.iter().map(|phase| phase + min.floor());
    let mut phases: Vec<f64> = shifted.filter(|p| (min..=end).contains(p)).collect();
    phases.extend([min, end]);
    phases
}

/// One pixel per phase, without noise; the map is off by up to `reach` turns.
fn stack(phases: &[f64], min: f64, bit_depth: u8, frames: Vec<Shot>, reach: f64) -> Stack {
    let mut random = Random::new(SEED);
    let range = (min, min + FRINGES);
    let mut stack = Stack::dark((phases.len(), 1), bit_depth, frames, range);
    let full = f64::from(stack.full_scale());
    for (pixel, phase) in phases.iter().enumerate() {
        for frame in 0..stack.frames.len() {
            let Shot { ratio, shift, .. } = stack.frames[frame];
            let sine = (TAU * (ratio * phase + shift)).sin();
            let light = full * (LIGHT.0 + LIGHT.1 * sine);
            stack.set(frame, pixel, light.round() as u16);
        }
    }
    let mut near = |phase: &f64| {
        // The ends of the reach, and values between them.
        let off = [-reach, reach, between(&mut random, -reach, reach)][random.below(3)];
        AbsolutePhase::from_turns(phase + off)
    };
    stack.map = (reach > 0.0).then(|| phases.iter().map(&mut near).collect());
    stack
}

/// Checks that every pixel is resolved, within the error from rounding its samples.
fn check(name: &str, phases: &[f64], stack: &Stack) {
    let map = stack.decode();
    let counts = LIGHT.1 * f64::from(stack.full_scale());
    let ratio = stack
        .levels()
        .iter()
        .map(|l| l.ratio)
        .fold(f64::INFINITY, f64::min);
    let ratio = if stack.map.is_some() { ratio } else { 1.0 };
    // Samples off by half a count change (S, C) by at most N/2: 1/B radians; plus 1e-4 for the
    // fixed point.
    let bound = (1.0 / counts / TAU + 1e-4) / ratio;
    let mut worst = 0.0_f64;
    for (pixel, phase) in phases.iter().enumerate() {
        assert_eq!(map.trust[pixel], Trust::Resolved, "{name}: {phase}");
        let error = (map.phase[pixel].turns() - phase).abs();
        assert!(
            error <= bound,
            "{name}: {} for {phase}",
            map.phase[pixel].turns()
        );
        worst = worst.max(error);
    }
    println!("{name}: {} phases, worst {worst:.2e} turn", phases.len());
    assert!(worst >= ROUNDING / 2.0, "{name}: too good to be true");
}

#[test]
fn no_fringe_order_slips_at_any_wrap_of_a_hundred_fringes() {
    for min in [0.0, -3.3] {
        let phases = phases(min);
        assert!(phases.len() > 65_000 && phases[0] >= min);
        for bit_depth in [8, 12] {
            let range = PhaseRange {
                min,
                max: min + FRINGES,
            };
            for (count, shifts) in [(3, 4), (3, 3), (4, 5), (6, 3)] {
                let frames = Sequence::geometric(range, count, shifts);
                // Shifts from 0 are symmetric at the ends; with any other start rounding moves them
                // over the end.
                for start in [0.0, 0.137] {
                    let moved = frames
                        .iter()
                        .map(|&Shot { ratio, shift, .. }| Shot::sine(ratio, start + shift));
                    let stack = stack(&phases, min, bit_depth, moved.collect(), 0.0);
                    let name =
                        format!("{count} levels of {shifts}, {bit_depth} bit, from {min}, {start}");
                    check(&name, &phases, &stack);
                }
            }
        }
    }
}

#[test]
fn no_fringe_order_slips_at_any_wrap_about_a_map() {
    let phases = phases(0.0);
    let n = 6.0_f64;
    for bit_depth in [8, 12] {
        for (ratios, reach) in [
            (
                vec![1.0, 1.0 - 1.0 / (n * n), 1.0 - 1.0 / n],
                n * n / 2.0 - n,
            ),
            // Two levels: the reach of the beat minus the effect of rounding.
            (vec![0.8, 1.0], 2.4),
            (vec![1.0], 0.49),
        ] {
            for shifts in [3, 4] {
                let frames = shots(&ratios, shifts);
                let stack = stack(&phases, 0.0, bit_depth, frames, reach);
                let name = format!("{ratios:.3?} of {shifts}, {bit_depth} bit");
                check(&name, &phases, &stack);
            }
        }
    }
}
