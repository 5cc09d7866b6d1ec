//! Frames whose light is known, frame by frame.

use super::{Flicker, Steadiness, Watch};
use crate::frame::{FrameView, Samples};
use crate::pattern::{Sequence, Shot};
use alloc::vec::Vec;
use core::f64::consts::TAU;

const WIDTH: usize = 192;
const HEIGHT: usize = 96;
const NOISE: f64 = 1.8;

/// A sum of twelve uniform numbers, of mean 0 and variance 1.
fn normal(state: &mut u64) -> f64 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        sum += (*state >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum
}

/// The phase of a pixel in turns: fringes of about eight pixels on a curved part.
fn phase(at: usize) -> f64 {
    let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
    u / 7.7 + v / 60.0 + 0.4 * libm::sin(u / 50.0)
}

/// Frames of a part of two shades, with `other` counts of other light on white, times 1 + α_k, and
/// the projector's times 1 + γ_k.
fn frames(shots: &[Shot], (other, alpha, gamma): (f64, &[f64], &[f64]), seed: u64) -> Vec<Vec<u8>> {
    moved_frames(shots, (other, alpha, gamma), &[], seed)
}

/// The same of a part whose fringes are moved by `shift` turns in each frame.
fn moved_frames(
    shots: &[Shot],
    (other, alpha, gamma): (f64, &[f64], &[f64]),
    moved: &[f64],
    seed: u64,
) -> Vec<Vec<u8>> {
    let mut state = seed;
    let mut frame = |(k, shot): (usize, &Shot)| {
        let turns = moved.get(k).copied().unwrap_or(0.0);
        (0..WIDTH * HEIGHT)
            .map(|at| {
                let white = if (at / WIDTH / 20).is_multiple_of(2) {
                    1.0
                } else {
                    0.5
                };
                // The surface turns away from the projector.
                let facing = 1.0 - 0.3 * (at % WIDTH) as f64 / WIDTH as f64;
                let wave = libm::sin(TAU * (shot.ratio * phase(at) + shot.shift + turns));
                let shown = 70.0 * facing * (1.0 + 0.7 * wave);
                let light = white * (other * (1.0 + alpha[k]) + shown * (1.0 + gamma[k]));
                (light + NOISE * normal(&mut state))
                    .round()
                    .clamp(0.0, 255.0) as u8
            })
            .collect()
    };
    shots.iter().enumerate().map(&mut frame).collect()
}

fn views(frames: &[Vec<u8>]) -> Vec<FrameView<'_>> {
    let view = |frame| FrameView::new(Samples::Eight(frame), WIDTH, HEIGHT, WIDTH).unwrap();
    frames.iter().map(|frame| view(frame.as_slice())).collect()
}

fn watch(shots: &[Shot]) -> Watch {
    let sequence = Sequence::from_frames(shots).unwrap();
    Watch::new(&sequence, (255, NOISE), WIDTH, &[true; WIDTH * HEIGHT])
}

/// RMS over cells of 8 × 8 pixels of the mean error of the finest level's phase, turns.
fn error(shots: &[Shot], views: &[FrameView<'_>]) -> f64 {
    let mut cells = [0.0; WIDTH * HEIGHT / 64];
    for at in 0..WIDTH * HEIGHT {
        let (mut re, mut im) = (0.0, 0.0);
        for (shot, view) in shots
            .iter()
            .zip(views)
            .filter(|(shot, _)| shot.ratio == 1.0)
        {
            let sample = f64::from(view.row(at / WIDTH).at(at % WIDTH));
            let (sin, cos) = libm::sincos(TAU * shot.shift);
            re += sin * sample;
            im += cos * sample;
        }
        let error = libm::atan2(im, re) / TAU - phase(at);
        let cell = at / WIDTH / 8 * (WIDTH / 8) + at % WIDTH / 8;
        cells[cell] += (error - error.round()) / 64.0;
    }
    let squares: f64 = cells.iter().map(|cell| cell * cell).sum();
    libm::sqrt(squares / cells.len() as f64)
}

/// What is found in frames that change, and the errors of their phases before and after.
fn corrected(shots: &[Shot], watch: &Watch, views: &[FrameView<'_>]) -> (Flicker, [f64; 2]) {
    let Steadiness::Flickers(found) = watch.look(views) else {
        panic!("{:?}", watch.look(views));
    };
    let steady = watch.steady(views, &found);
    let steady: Vec<_> = steady.views().collect();
    let errors = [error(shots, views), error(shots, &steady)];
    (found, errors)
}

/// The sequences of production: three levels of four shifts, two of three, one of four or three.
fn sequences() -> Vec<Vec<Shot>> {
    [
        &[(0.75, 4), (0.9375, 4), (1.0, 4)][..],
        &[(0.8, 3), (1.0, 3)],
        &[(1.0, 4)],
        &[(1.0, 3)],
    ]
    .iter()
    .map(|levels| {
        levels
            .iter()
            .flat_map(|&(ratio, shifts)| Shot::level(ratio, shifts))
            .collect()
    })
    .collect()
}

/// A lamp of 100 Hz in exposures 33.4 ms apart.
fn lamp(depth: f64, frames: usize) -> Vec<f64> {
    let turns = |k: usize| 100.0 * 0.0334 * k as f64 + 0.13;
    (0..frames)
        .map(|k| depth * libm::cos(TAU * turns(k)))
        .collect()
}

#[test]
fn steady_light_is_left_alone() {
    for shots in sequences() {
        let none = alloc::vec![0.0; shots.len()];
        for seed in 0..20 {
            let frames = frames(&shots, (40.0, &none, &none), seed);
            let found = watch(&shots).look(&views(&frames));
            assert_eq!(
                found,
                Steadiness::Steady,
                "{} frames, seed {seed}",
                shots.len()
            );
        }
    }
}

#[test]
fn a_lamp_and_an_unsteady_projector_are_found_and_taken_out() {
    let gains = [
        0.03, -0.02, 0.01, -0.03, 0.0, 0.025, -0.01, 0.02, -0.03, 0.01, 0.0, 0.015,
    ];
    for shots in sequences() {
        let count = shots.len();
        let none = alloc::vec![0.0; count];
        let (lamp, gains) = (lamp(15.0 / 40.0, count), &gains[..count]);
        let watch = watch(&shots);
        let steady = frames(&shots, (40.0, &none, &none), 1);
        let least = error(&shots, &views(&steady));
        for (alpha, gamma) in [(&lamp[..], &none[..]), (&none, gains), (&lamp, gains)] {
            let frames = frames(&shots, (40.0, alpha, gamma), 1);
            let views = views(&frames);
            let (found, [before, after]) = corrected(&shots, &watch, &views);
            let off = |found: &[f64], truth: &[f64]| {
                let mut most: f64 = 0.0;
                for (k, shot) in shots.iter().enumerate() {
                    let own = (0..count).filter(|&at| shots[at].ratio == shot.ratio);
                    let mean = own.clone().map(|at| truth[at]).sum::<f64>() / own.count() as f64;
                    most = most.max((found[k] - (truth[k] - mean)).abs());
                }
                most
            };
            // 56 of 96 rows are white, the others half as bright.
            let shades: Vec<f64> = alpha
                .iter()
                .map(|alpha| 76.0 / 96.0 * 40.0 * alpha)
                .collect();
            let gains: Vec<f64> = found.frames.iter().map(|frame| frame.gain).collect();
            let (other, gain) = (off(&found.other, &shades), off(&gains, gamma));
            std::println!(
                "{count} frames: phases off by {before:.5}, corrected {after:.5}, in steady light {least:.5}; other light off by {other:.2}, gains by {gain:.4}; misfit {:.2}, left {:.2}",
                found.misfit,
                found.left
            );
            // σ: .03 counts, and what is known of the pattern's contrast; .001.
            let mut sigma = 0.04 * found.other_counts();
            if gamma.iter().any(|gain| *gain != 0.0) {
                sigma += 0.1 * 0.03 * 50.0;
            }
            assert!(other < 3.0 * (0.03 + sigma) && gain < 0.0035);
            assert!(
                after < 1.5 * least + 2e-4,
                "{count}: {before} -> {after}, steady {least}"
            );
        }
    }
}

#[test]
fn fringes_that_move_from_frame_to_frame_are_found_and_moved_back() {
    for shots in sequences() {
        let count = shots.len();
        let none = alloc::vec![0.0; count];
        let watch = watch(&shots);
        let steady = frames(&shots, (40.0, &none, &none), 1);
        let least = error(&shots, &views(&steady));
        // As much as .2 mm: of each level the mean is 0, as it cannot be told.
        let moved: Vec<f64> = (0..count)
            .map(|k| 0.03 * libm::sin(2.1 * k as f64 + 0.4))
            .collect();
        let moved = shots.iter().zip(&moved).map(|(shot, here)| {
            let own = shots
                .iter()
                .zip(&moved)
                .filter(|(of, _)| of.ratio == shot.ratio);
            let mean = own.clone().map(|(_, turns)| turns).sum::<f64>() / own.count() as f64;
            here - mean
        });
        let moved: Vec<f64> = moved.collect();
        let frames = moved_frames(&shots, (40.0, &none, &none), &moved, 1);
        let views = views(&frames);
        let (found, [before, after]) = corrected(&shots, &watch, &views);
        let shifts = found.frames.iter().zip(&moved);
        let off = shifts
            .map(|(found, moved)| (found.shift - moved).abs())
            .fold(0.0, f64::max);
        std::println!(
            "{count} frames: phases off by {before:.5}, corrected {after:.5}, at rest {least:.5}; shifts off by {off:.5}, misfit {:.2}",
            found.misfit
        );
        assert!(
            after < 1.5 * least + 2e-4,
            "{count}: {before} -> {after}, at rest {least}"
        );
        assert!(off < 0.002, "{count}: {off}");
    }
}
