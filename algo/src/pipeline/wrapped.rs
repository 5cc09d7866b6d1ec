//! The wrapped phase of one level, without any other level.

use super::{PhaseMap, decode};
use crate::frame::FrameView;
use crate::pattern::{Level, PhaseRange, Sequence, Shot};
use crate::phase::{DecodeError, Decoder, LeastModulation};
use alloc::vec::Vec;

/// Decodes one level of a sequence to its wrapped phase: `phase` is φ, 0 ≤ φ < 1 turn of that
/// level, modulation and trust are the level's. `frames` are those of the whole sequence.
///
/// A level of ratio 1 over a phase function of one turn is absolute by itself, so the production
/// kernels decode it, with their accuracy ([`Decoder`]). Modulations are trusted from `least` on.
///
/// # Errors
/// If the frames do not fit the level, or `bit_depth` is not 8 to 16.
pub fn wrapped(
    level: &Level,
    frames: &[FrameView<'_>],
    bit_depth: u8,
    least: LeastModulation,
) -> Result<PhaseMap, DecodeError> {
    let shifts = level.shifts();
    let shots = (0..shifts).map(|k| Shot::sine(1.0, level.start + k as f64 / shifts as f64));
    let sequence = Sequence::from_frames(&shots.collect::<Vec<_>>())?;
    let one_turn = PhaseRange { min: 0.0, max: 1.0 };
    let decoder = Decoder::new(&sequence, one_turn, bit_depth)?.with_least_modulation(least);
    let of_level: Vec<_> = level
        .frames
        .iter()
        .filter_map(|&at| frames.get(usize::from(at)).copied())
        .collect();
    decode(&decoder, &of_level, None, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Samples;
    use crate::phase::Trust;
    use std::vec::Vec;

    /// The bound of the arctangent for 8-bit samples and their rounding (B = 100 counts): 2.4e-5 +
    /// √2 · 0.5 / (2π · 100) turn.
    const TOLERANCE: f64 = 1.2e-3;

    #[test]
    fn a_level_alone_gives_its_fraction_of_a_turn_whatever_its_ratio_and_first_shift() {
        for (shifts, start) in [(3, 0.0), (4, 0.25), (5, -1.0 / 3.0), (8, 0.1)] {
            let shot = |k: usize| Shot::sine(0.37, start + k as f64 / shifts as f64);
            let shots: Vec<_> = (0..shifts).map(shot).collect();
            let turns = |u: usize| u as f64 / 64.0 * 3.0;
            let sample = |shot: &Shot, u: usize| {
                let sine = libm::sin(core::f64::consts::TAU * (turns(u) + shot.shift));
                libm::rint(120.0 + 100.0 * sine) as u8
            };
            let rows: Vec<Vec<u8>> = shots
                .iter()
                .map(|shot| (0..64).map(|u| sample(shot, u)).collect())
                .collect();
            let view = |row| FrameView::new(Samples::Eight(row), 64, 1, 64).unwrap();
            let frames: Vec<_> = rows.iter().map(|row| view(row)).collect();
            let sequence = Sequence::from_frames(&shots).unwrap();
            let map = wrapped(
                &sequence.levels()[0],
                &frames,
                8,
                LeastModulation::default(),
            )
            .unwrap();
            for u in 0..64 {
                assert_eq!(map.trust[u], Trust::Resolved);
                let phase = map.phase[u].turns();
                assert!((0.0..1.0).contains(&phase), "{phase}");
                let error = phase - turns(u);
                let error = error - libm::rint(error);
                assert!(error.abs() < TOLERANCE, "{shifts} shifts, {u}: {error}");
            }
        }
    }
}
