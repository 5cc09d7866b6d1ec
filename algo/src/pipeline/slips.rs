//! Pixels whose fringe order is wrong, in phase maps of frames with noise: as many as
//! [`Slips`](crate::pattern::Slips) predicts.

use super::{PhaseMap, decode};
use crate::frame::{FrameView, Samples};
use crate::pattern::split::tests::{PAPER, RANGE, slips, two};
use crate::pattern::{Sequence, Shot, Waveform};
use crate::phase::{Decoder, Trust};
use crate::units::AbsolutePhase;
use core::f64::consts::TAU;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec;
use std::vec::Vec;

/// Simulated over predicted rates: see *Accuracy*.
const SIMULATED: core::ops::Range<f64> = 0.75..1.75;

/// The share of resolved pixels that the decoder gives another order than the true one, of
/// `pixels` with normal noise.
fn simulated(shots: &[Shot], noise: f64, away: f64, pixels: usize) -> f64 {
    // So bright that none is rejected for its modulation.
    const MODULATION: f64 = 8000.0;
    let mut random = SplitMix64::seed_from_u64(7);
    let mut share = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    // Box and Muller, 1958.
    let mut normal = || libm::sqrt(-2.0 * libm::log(1.0 - share())) * libm::cos(TAU * share());
    let golden: Vec<_> = (0..pixels)
        .map(|at| AbsolutePhase::from_turns(20.0 + 0.37 * (at % 97) as f64))
        .collect();
    let frames: Vec<Vec<u16>> = shots
        .iter()
        .map(|shot| {
            let b = shot.waveform.fundamental();
            let of_pixel = |golden: &AbsolutePhase| {
                let turns = shot.ratio * (golden.turns() + away) + shot.shift;
                let light =
                    1.0 + 0.25 * b * shot.waveform.unscaled(turns) + 0.25 * noise * normal();
                libm::rint(4.0 * MODULATION * light) as u16
            };
            golden.iter().map(of_pixel).collect()
        })
        .collect();
    let sequence = Sequence::from_frames(shots).unwrap();
    let decoder = Decoder::new(&sequence, RANGE, 16).unwrap();
    let view = |samples| FrameView::new(Samples::Sixteen(samples), pixels, 1, pixels).unwrap();
    let views: Vec<_> = frames.iter().map(|frame| view(&frame[..])).collect();
    let PhaseMap { phase, trust, .. } = decode(&decoder, &views, Some(&golden), None).unwrap();
    let wrong = |at: usize| (phase[at] - golden[at]).turns() - away;
    let resolved = (0..pixels).filter(|&at| trust[at] == Trust::Resolved);
    let wrong = resolved.filter(|&at| wrong(at).abs() > 0.5).count();
    wrong as f64 / pixels as f64
}

#[test]
fn simulated_pixels_slip_as_often_as_predicted() {
    const PIXELS: usize = 400_000;
    let noise = PAPER / 16.0;
    let single: Vec<Shot> = Shot::level_as(1.0, 3, Waveform::brightest).collect();
    let cases = vec![
        (two(3, Waveform::sine), 0.0),
        (two(3, Waveform::sine), 2.2),
        (two(3, Waveform::brightest), -2.3),
        (Sequence::dense(4.0, 3), 7.0),
        (Sequence::geometric(RANGE, 3, 4), 0.0),
        (single, 0.43),
    ];
    for (shots, away) in cases {
        let predicted = slips(&shots).rate(noise, libm::fabs(away));
        let found = simulated(&shots, noise, away, PIXELS);
        std::println!(
            "{} frames, {away}: {found:.2e} of {predicted:.2e}",
            shots.len()
        );
        let ratio = found / predicted;
        assert!(SIMULATED.contains(&ratio), "{found} {predicted}");
    }
}
