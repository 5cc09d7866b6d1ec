//! What one frame shows.

use super::{Waveform, Waveforms};

/// What one frame shows of a phase function Φ_P: I = I_max/2 · (1 + f(ratio · Φ_P + shift)), where
/// f is the waveform with its peak scaled to 1, for a sine I = I_max/2 · (1 + sin 2π(ratio · Φ_P +
/// shift)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Share of the full phase function. Frames of equal ratio form a level.
    pub ratio: f64,
    /// Shift in turns.
    pub shift: f64,
    /// What is projected for a turn of phase.
    pub waveform: Waveform,
}

impl Shot {
    /// A sine.
    pub const fn sine(ratio: f64, shift: f64) -> Self {
        Self {
            ratio,
            shift,
            waveform: Waveform::SINE,
        }
    }

    /// A level of sines: `shifts` shots of one ratio, k/N turns apart.
    pub fn level(ratio: f64, shifts: usize) -> impl Iterator<Item = Self> + Clone {
        (0..shifts).map(move |k| Self::sine(ratio, k as f64 / shifts as f64))
    }

    /// A level of the waveform for its number of shifts.
    pub fn level_as(
        ratio: f64,
        shifts: usize,
        waveforms: Waveforms,
    ) -> impl Iterator<Item = Self> + Clone {
        let waveform = waveforms(shifts);
        Self::level(ratio, shifts).map(move |shot| Self { waveform, ..shot })
    }
}
