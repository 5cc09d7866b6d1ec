//! How a sequence was taken, or why it ended without all its frames: as an error with the counts and
//! the remedy.
//!
//! If the camera gives no frame within the time of an attempt, the attempt is overdue, and its
//! pattern is shown again before later ones, up to `MAX_ATTEMPTS` times or until the deadline. Then
//! the error is `Timeout` if the camera fell silent, the projector never flipped, time ran out, or
//! pulses of the trigger spoiled most frames, and `Protocol` if frames came that fit no pattern.

use std::time::Duration;

use crate::error::Error;
use crate::units::Timestamp;

/// How a sequence was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// How long the camera took to start; zero if it was on.
    pub start_up: Duration,
    /// When the first pattern came into view.
    pub started: Timestamp,
    /// When the exposure of the last frame started.
    pub done: Timestamp,
    /// Longest time from a pattern's coming into view to the start of its exposure.
    pub lag: Duration,
    /// Largest difference of a flip's stamp from its time by the count, and of an exposure's start
    /// from its trigger.
    pub sync_error: Duration,
    /// How often a pattern was shown again because it had given no usable frame.
    pub retaken: u32,
    /// Refreshes by which flips were later than planned.
    pub missed_flips: u32,
    /// Frames that were exposed and never arrived: gaps in the camera's count.
    pub dropped: u32,
    /// Frames that arrived more than once.
    pub duplicated: u32,
    /// Frames that were exposed during a change of patterns.
    pub straddled: u32,
    /// Frames that were exposed before the first pattern, or arrived much too late.
    pub stale: u32,
    /// Frames whose exposure started at no trigger.
    pub unexplained: u32,
    /// Frames of patterns that had their frame already.
    pub surplus: u32,
    /// Frames that were exposed for too long or too short because the trigger's pulse was.
    pub spoiled: u32,
    /// Largest possible error of the length of such a pulse.
    pub pulse_error: Duration,
}

impl Exposure {
    /// Frames that arrived and could not be used.
    pub(super) fn unfit(&self) -> u32 {
        [self.straddled, self.stale, self.unexplained, self.spoiled]
            .into_iter()
            .fold(0, u32::saturating_add)
    }
}

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
    /// Patterns of the sequence.
    pub patterns: usize,
    pub so_far: Exposure,
}

impl Failure {
    /// The error; `timeout` is the time that the caller allowed beyond the plan.
    pub fn error(self, timeout: Duration) -> Error {
        let (attempts, so_far) = (self.attempts, self.so_far);
        let acquiring = format!(
            "acquiring pattern {} ({} of {} taken)",
            self.index, self.taken, self.patterns
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
