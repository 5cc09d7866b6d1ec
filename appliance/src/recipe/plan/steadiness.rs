//! What is said of light that changes from frame to frame.

use super::Plan;
use crate::head::examine::LAMPS_HZ;
use crate::station::error_code::UNSTEADY_LIGHT;
use crate::station::snapshot::warning;
use crate::station::{Inspection, UnsteadyLight, Verdict};
use algo::flicker::{Flicker, Steadiness};
use algo::math::solve::Normal;
use hal::frame::Frame;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Smaller changes are corrected and not told: share of full scale, of the projector's light, turns.
const TOLD: [f64; 3] = [0.008, 0.02, 0.005];
/// A frequency is named that explains so much of the changes, and if no other one explains as much as
/// the second share.
const EXPLAINED: [f64; 2] = [0.9, 0.7];

impl Plan {
    /// Adds to an inspection what its frames tell of changing light.
    pub(super) fn tell_changes(
        &self,
        light: Steadiness,
        frames: &[Frame],
        inspection: &mut Inspection,
    ) {
        match light {
            Steadiness::Steady => {}
            Steadiness::Broken(frame) => {
                let words = format!(
                    "the light changed too much while frame {} of {} was taken (a flash or a shadow): keep other light away from the part and measure again",
                    frame + 1,
                    frames.len()
                );
                inspection.warnings |= warning::UNSTEADY_LIGHT;
                inspection.judged = Verdict::Invalid;
                inspection.reason = Some(words.into());
                inspection.error_code = UNSTEADY_LIGHT;
                inspection.step_up = None;
            }
            Steadiness::Flickers(flicker) => {
                let full_scale = f64::from((1_u32 << self.conditions.camera.2) - 1);
                let [other, gain] = [flicker.other_counts() / full_scale, flicker.largest_gain()];
                if other > TOLD[0] || gain > TOLD[1] || flicker.largest_shift() > TOLD[2] {
                    inspection.warnings |= warning::UNSTEADY_LIGHT;
                }
                inspection.light = Some(Arc::new(UnsteadyLight {
                    hz: frequency(&flicker, frames),
                    shift_turns: flicker.frames.iter().map(|light| light.shift).collect(),
                    gain: flicker.frames.iter().map(|light| light.gain).collect(),
                    other_counts: flicker.other,
                }));
            }
        }
    }
}

/// The frequency of lamps that the changes of other light have, where the times of frames tell it.
fn frequency(flicker: &Flicker, frames: &[Frame]) -> Option<u32> {
    let whole: f64 = flicker.other.iter().map(|other| other * other).sum();
    let explained = LAMPS_HZ.map(|hz| {
        // With an offset, as what frames have in common is not known.
        let rows = flicker.other.iter().zip(frames).map(|(other, frame)| {
            let turns = f64::from(hz) * frame.timestamp().0 as f64 * 1e-9;
            let (sin, cos) = (TAU * turns.fract()).sin_cos();
            ([sin, cos, 1.0], *other)
        });
        let rows: Vec<_> = rows.collect();
        let solved = Normal::of(rows.iter().copied()).solve()?;
        let left = rows.iter().map(|(row, other)| {
            let fitted: f64 = row.iter().zip(solved).map(|(a, b)| a * b).sum();
            (other - fitted).powi(2)
        });
        Some(1.0 - left.sum::<f64>() / whole)
    });
    let [first, second] = explained.map(|share| share.unwrap_or(0.0));
    let [sure, doubtful] = EXPLAINED;
    if first > sure && second < doubtful {
        return Some(LAMPS_HZ[0]);
    }
    (second > sure && first < doubtful).then_some(LAMPS_HZ[1])
}
