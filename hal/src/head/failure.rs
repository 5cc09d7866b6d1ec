//! Why a sequence ended without all its frames, as an error with the counts and the remedy.
//!
//! A camera that times out between two frames: the attempt is overdue, and its pattern is shown
//! again before later ones, up to `MAX_ATTEMPTS` times or until the deadline. Then the error is
//! `Timeout` if the camera fell silent, the projector never flipped, time ran out, or pulses of the
//! trigger spoiled most frames, and `Protocol` if frames came that fit no pattern.

use std::time::Duration;

use super::Exposure;
use crate::error::Error;

/// What prevented the sequence from ending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blocked {
    /// The projector never flipped.
    NoFlip,
    /// The camera gave no frame at all, or none during more than half of the allowed attempts, up
    /// to the last.
    NoFrame,
    /// A pattern was shown as often as allowed, and no frame was exposed while only it was in view.
    Retakes,
    /// A pattern was shown as often as allowed, and most of the rejected frames were spoiled by the
    /// trigger's pulses.
    Pulses,
    /// The time was over.
    Late,
}

impl Blocked {
    /// `Pulses` if most of the rejected frames were spoiled by pulses, else `Retakes`.
    pub fn misfit(so_far: &Exposure) -> Self {
        if so_far.spoiled > so_far.unfit() / 2 {
            Self::Pulses
        } else {
            Self::Retakes
        }
    }
}

/// A sequence that was given up.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    pub blocked: Blocked,
    /// The pattern that has no frame.
    pub index: usize,
    pub attempts: u32,
    pub taken: usize,
    pub of: usize,
    pub so_far: Exposure,
}

impl Failure {
    /// The error; `timeout` is the time that the caller allowed beyond the plan.
    pub fn error(self, timeout: Duration) -> Error {
        let (attempts, so_far) = (self.attempts, self.so_far);
        let acquiring = format!(
            "acquiring pattern {} ({} of {} taken)",
            self.index, self.taken, self.of
        );
        let counts = format!(
            "{} frames straddled two patterns, {} were older, {} began at no trigger, {} were spoiled by their pulses, {} were lost, \
             {} refreshes were missed",
            so_far.straddled,
            so_far.stale,
            so_far.unexplained,
            so_far.spoiled,
            so_far.dropped,
            so_far.missed_flips
        );
        match self.blocked {
            Blocked::NoFlip => Error::timeout(
                format!("{acquiring}: no flip came, which"),
                timeout,
                "check the projector's connection and mode",
            ),
            Blocked::NoFrame => Error::timeout(
                format!("{acquiring}: shown {attempts} times, no frame came, which"),
                timeout,
                "check the trigger's wire and the camera's trigger mode",
            ),
            Blocked::Retakes => Error::protocol(
                format!(
                    "{acquiring}: shown {attempts} times, no frame was wholly exposed in its view ({counts}), which"
                ),
                "check the flip-to-light delay, what the camera's stamp marks, and the load of the processor",
            ),
            // A time-out, because repeating the sequence may succeed: the pulses were too long
            // since the computer was busy.
            Blocked::Pulses => Error::timeout(
                format!(
                    "{acquiring}: shown {attempts} times, pulses of the trigger were up to {:.2} ms off their length, \
                     and with them the brightness of frames ({counts}), which",
                    so_far.pulse_error.as_secs_f64() * 1e3
                ),
                timeout,
                "stop what else loads the computer, or give fringed a real-time priority",
            ),
            Blocked::Late => Error::timeout(
                format!("{acquiring} after {attempts} tries ({counts})"),
                timeout,
                "check the load of the processor and the cables",
            ),
        }
    }
}
