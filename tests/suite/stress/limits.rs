//! Sequences at their documented limits are decoded; beyond a limit, planning refuses them with its
//! name.

use super::bounds::Tally;
use super::random::between;
use super::stack::{Stack, shots};
use algo::pattern::{
    MAX_DENSE_N, MAX_LEVEL_FACTOR, MAX_LEVELS, MAX_SHIFTS, MAX_TURNS, PhaseFunction,
    PhaseFunctionError, PhaseRange, Sequence, Shot,
};
use algo::phase::{DecodeError, Decoder, Trust};
use algo::units::AbsolutePhase;
use std::f64::consts::TAU;
use tests::random::Random;

const SEED: u64 = 20_260_608;

/// The reason for which a sequence of these ratios, with `shifts` each, is refused for a phase
/// function of this range.
fn refusal(ratios: &[f64], shifts: usize, (min, max): (f64, f64)) -> Option<String> {
    let frames = shots(ratios, shifts);
    let sequence = match Sequence::from_frames(&frames) {
        Ok(sequence) => sequence,
        Err(error) => return Some(error.to_string()),
    };
    let decoder = Decoder::new(&sequence, PhaseRange { min, max }, 8);
    decoder.err().map(|error| error.to_string())
}

/// Checks that a refusal contains each of `words`.
fn names(refusal: Option<String>, words: &[String]) {
    let refusal = refusal.expect("it is beyond a limit");
    for word in words {
        assert!(refusal.contains(word), "no {word} in: {refusal}");
    }
}

/// Geometric ratios from one that spans 0.9 of the range up to `finest`, in steps of at most
/// `step`.
fn climb(span: f64, finest: f64, step: f64) -> Vec<f64> {
    let coarsest = 0.9 / span;
    let steps = ((finest / coarsest).ln() / step.ln()).ceil().max(1.0);
    let step = (finest / coarsest).powf(1.0 / steps);
    let mut ratios: Vec<f64> = (0..steps as i32).map(|i| coarsest * step.powi(i)).collect();
    ratios.push(finest);
    ratios
}

/// A stack of noise-free 12-bit pixels with phases over the whole range.
fn lit(frames: Vec<Shot>, (min, max): (f64, f64), reach: f64) -> (Stack, Vec<f64>) {
    let mut random = Random::new(SEED);
    let mut stack = Stack::dark((4096, 1), 12, frames, (min, max));
    let phases: Vec<f64> = (0..stack.pixels())
        .map(|pixel| match pixel {
            0 => min,
            1 => max,
            _ => between(&mut random, min, max),
        })
        .collect();
    for frame in 0..stack.frames.len() {
        let Shot { ratio, shift, .. } = stack.frames[frame];
        for (pixel, phase) in phases.iter().enumerate() {
            let light = 2047.5 + 1800.0 * (TAU * (ratio * phase + shift)).sin();
            stack.set(frame, pixel, light.round() as u16);
        }
    }
    let mut near =
        |phase: &f64| AbsolutePhase::from_turns(phase + between(&mut random, -reach, reach));
    stack.map = (reach > 0.0).then(|| phases.iter().map(&mut near).collect());
    (stack, phases)
}

/// Checks that every pixel is resolved, in its own fringe of the finest level, and agrees with the
/// textbook.
fn decodes(name: &str, (stack, phases): (Stack, Vec<f64>)) {
    let map = stack.decode();
    let finest = stack.levels().last().unwrap().ratio;
    for (pixel, phase) in phases.iter().enumerate() {
        assert_eq!(map.trust[pixel], Trust::Resolved, "{name}: {phase}");
        let fringes = (map.phase[pixel].turns() - phase) * finest;
        assert!(fringes.abs() < 0.1, "{name}: {fringes} of a fringe off");
    }
    let mut tally = Tally::default();
    tally.add(&stack, &map);
    tally.conclude(name);
}

#[test]
fn as_many_turns_as_documented_decode_in_every_fringe_and_more_are_refused() {
    for range in [(0.0, MAX_TURNS), (-MAX_TURNS, 0.0)] {
        let ratios = climb(MAX_TURNS, 1.0, 16.0);
        decodes("geometric", lit(shots(&ratios, 4), range, 0.0));
        decodes(
            "dense",
            lit(shots(&[35.0 / 36.0, 5.0 / 6.0, 1.0], 4), range, 11.0),
        );
        decodes("single", lit(shots(&[1.0], 4), range, 0.45));
    }
    let over = MAX_TURNS + 1.0;
    for ratios in [climb(over, 1.0, 16.0), vec![0.8, 1.0], vec![1.0]] {
        for range in [(0.0, over), (-over, 0.0)] {
            names(
                refusal(&ratios, 4, range),
                &[over.to_string(), MAX_TURNS.to_string()],
            );
        }
    }
    // The limit is that of a level: a finer ratio reaches it with fewer fringes.
    names(
        refusal(&[2.0], 4, (0.0, MAX_TURNS * 0.51)),
        &[MAX_TURNS.to_string()],
    );
}

#[test]
fn as_many_fringes_as_documented_make_a_pattern_and_more_are_refused() {
    for fringes in [1.0, MAX_TURNS] {
        assert!(PhaseFunction::vertical(64, 4, fringes).is_ok());
        assert!(PhaseFunction::horizontal(64, 4, fringes).is_ok());
        assert!(PhaseFunction::sampled(2, 2, vec![0.0, fringes, -fringes, 1.0]).is_ok());
    }
    let over = MAX_TURNS + 1.0;
    let words = [over.to_string(), MAX_TURNS.to_string()];
    let error = |function: Result<PhaseFunction, PhaseFunctionError>| {
        function.err().map(|error| error.to_string())
    };
    names(error(PhaseFunction::vertical(64, 4, over)), &words);
    names(error(PhaseFunction::horizontal(64, 4, over)), &words);
    names(
        error(PhaseFunction::sampled(2, 2, vec![0.0, 1.0, -over, 1.0])),
        &[format!("-{over}"), "column 0, row 1".to_owned()],
    );
}

#[test]
fn the_largest_step_between_levels_decodes_and_a_larger_one_is_refused() {
    let span = 0.9 * MAX_LEVEL_FACTOR;
    let ratios = [1.0 / MAX_LEVEL_FACTOR, 1.0];
    // Half a count of 12 bit in a level of 16 shifts is an error of at most 9e-5 turn. The step
    // must not enlarge it to more than the limit of the residual.
    const {
        assert!(
            MAX_LEVEL_FACTOR * 9e-5 < 0.4,
            "a step that rounding alone slips"
        )
    };
    decodes("two levels", lit(shots(&ratios, 16), (0.0, span), 0.0));
    // The finest ratio may be as small as the step is large.
    let small = [1.0 / MAX_LEVEL_FACTOR];
    decodes("a small ratio", lit(shots(&small, 16), (0.0, span), 0.0));
    let over = 1.0 / (MAX_LEVEL_FACTOR + 1.0);
    names(
        refusal(&[over, 1.0], 4, (0.0, span)),
        &[over.to_string(), MAX_LEVEL_FACTOR.to_string()],
    );
    names(
        refusal(&[over], 4, (0.0, span)),
        &[over.to_string(), MAX_LEVEL_FACTOR.to_string()],
    );
}

#[test]
fn dense_levels_have_an_n_of_at_most_the_documented_one() {
    let range = (0.0, MAX_TURNS);
    let two = |n: f64| [1.0 - 1.0 / n, 1.0];
    assert_eq!(refusal(&two(MAX_DENSE_N), 4, range), None);
    for n in [MAX_DENSE_N + 1.0, 1e6, 1e10, 1e15] {
        let low = two(n)[0];
        names(
            refusal(&two(n), 4, range),
            &[low.to_string(), MAX_DENSE_N.to_string()],
        );
        assert!(refusal(&[low, low.midpoint(1.0), 1.0], 4, range).is_some());
    }
    // An n of 20 is larger than any useful one, but decodes over its whole range of ± n²/2.
    let n = 20.0_f64;
    let three = [1.0 - 1.0 / n, 1.0 - 1.0 / (n * n), 1.0];
    let reach = n * n / 2.0 - n;
    decodes("n = 20", lit(shots(&three, 4), (0.0, 1000.0), reach));
}

#[test]
fn as_many_levels_and_shifts_as_documented_decode_and_more_are_refused() {
    let ratios = |levels: usize| {
        climb(
            100.0,
            1.0,
            (100.0_f64 / 0.9).powf(1.0 / (levels - 1) as f64),
        )
    };
    let most = ratios(MAX_LEVELS);
    assert_eq!(most.len(), MAX_LEVELS);
    decodes("levels", lit(shots(&most, 3), (0.0, 100.0), 0.0));
    let over: Vec<f64> = (0..=MAX_LEVELS)
        .map(|i| 0.01 * 1.5_f64.powi(i as i32))
        .collect();
    names(
        refusal(&over, 3, (0.0, 90.0)),
        &[(MAX_LEVELS + 1).to_string(), MAX_LEVELS.to_string()],
    );
    decodes("shifts", lit(shots(&[1.0], MAX_SHIFTS), (0.0, 0.9), 0.0));
    for shifts in [1, 2, MAX_SHIFTS + 1] {
        names(
            refusal(&[1.0], shifts, (0.0, 0.9)),
            &[shifts.to_string(), MAX_SHIFTS.to_string()],
        );
    }
}

#[test]
fn the_brightest_frames_of_the_most_shifts_do_not_overflow() {
    for bit_depth in 8..=16 {
        let frames = shots(&[0.01, 0.1, 1.0], MAX_SHIFTS);
        let mut stack = Stack::dark((9, 1), bit_depth, frames, (0.0, 90.0));
        let full = stack.full_scale();
        // Full scale in a growing half of the shifts: the largest sums there are.
        stack.fill(|frame, pixel| {
            let lit = (frame + 5 * pixel) % MAX_SHIFTS < MAX_SHIFTS / 2;
            if lit { full } else { 0 }
        });
        let mut tally = Tally::default();
        tally.add(&stack, &stack.decode());
        assert_eq!(tally.masks, 0, "{bit_depth} bit: {tally:?}");
    }
}

#[test]
fn bit_depths_that_no_sample_has_are_refused() {
    let sequence = Sequence::from_frames(&shots(&[1.0], 3)).unwrap();
    let range = PhaseRange { min: 0.0, max: 0.9 };
    for bits in [0, 1, 7, 17, 255] {
        let error = Decoder::new(&sequence, range, bits).unwrap_err();
        assert_eq!(error, DecodeError::BitDepth(bits));
        assert!(error.to_string().contains(&bits.to_string()));
    }
}
