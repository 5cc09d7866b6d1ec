//! Recovery of a lost head: reports a fault with its remedy, and opens the head again until it is
//! there.

use super::{Order, SIGN_OF_LIFE, Worker, active};
use crate::error::code_of;
use crate::station::{Event, StationHandle};
use crate::system::notify::Pulse;
use hal::error::Error;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError};

/// Longest wait before the head is opened again, in signs of life.
const LONGEST_WAIT: u32 = 16;
/// The remedy for a head that is not there.
pub(super) const REMEDY: &str = "the head is opened again by itself as soon as it is there; the cable and the power of camera and projector are what to check";

/// Whether the head has to be opened again: a device is gone, or one did not answer in time and is
/// in an unknown state.
pub fn is_lost(error: &Error) -> bool {
    matches!(error, Error::Disconnected { .. } | Error::Timeout { .. })
}

impl Worker {
    /// Handles an error of a job: a lost head is remembered, anything else is reported as `failed`.
    pub(super) fn fail(&mut self, error: Error, failed: Event) {
        if is_lost(&error) {
            // `recover` reports the fault, which ends the job.
            self.lost = Some(error);
        } else {
            self.station.event(failed);
        }
    }

    /// Tries to open the head until it is there again; `Break` if the daemon ends before.
    pub(super) fn recover(&mut self, error: &Error, orders: &Receiver<Order>) -> ControlFlow<()> {
        self.station.event(Event::Faulted {
            error_code: code_of(error),
            cause: error.to_string().into(),
            remedy: REMEDY.into(),
        });
        self.tell_projector(None);
        self.tell_camera(None);
        self.commission.set_head(None);
        let before = self.opened.calibration.fingerprint();
        let mut pause = Pause::default();
        let mut reported = String::new();
        loop {
            pause.wait(orders, &self.station, &self.pulse)?;
            let problem = match self.opened.reopen(&self.config) {
                Err(failure) => failure.to_string(),
                Ok(()) => {
                    self.tell_condition();
                    if self.opened.calibration.fingerprint() != before && self.plan.take().is_some()
                    {
                        self.progress.warn("the head that came back has another calibration: load or teach a recipe for it");
                    }
                    self.restore();
                    match self.lost.take() {
                        Some(error) => error.to_string(),
                        None => break,
                    }
                }
            };
            if problem != reported {
                self.progress
                    .warn(&format!("the head cannot be opened yet: {problem}"));
                reported = problem;
            }
        }
        let recipe = self.plan.as_deref().map(active);
        self.station.event(Event::Recovered { recipe });
        ControlFlow::Continue(())
    }
}

/// The pause between two attempts to open a head: from one sign of life to [`LONGEST_WAIT`],
/// doubled after each attempt.
#[derive(Default)]
pub(super) struct Pause {
    /// Signs of life of the last pause.
    signs: u32,
}

impl Pause {
    /// Waits until it is time to try again, giving signs of life; `Break` when the daemon ends.
    /// Orders that come are dropped: the fault has ended their jobs.
    pub(super) fn wait(
        &mut self,
        orders: &Receiver<Order>,
        station: &StationHandle,
        pulse: &Pulse,
    ) -> ControlFlow<()> {
        self.signs = (2 * self.signs).clamp(1, LONGEST_WAIT);
        for _ in 0..self.signs {
            match orders.recv_timeout(SIGN_OF_LIFE) {
                Ok(Order::Stop) | Err(RecvTimeoutError::Disconnected) => {
                    return ControlFlow::Break(());
                }
                Ok(_) | Err(RecvTimeoutError::Timeout) => {
                    station.event(Event::Alive);
                    pulse.beat();
                }
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal::error::DeviceKind;
    use std::time::Duration;

    #[test]
    fn a_device_that_is_gone_or_silent_is_opened_again_and_one_that_cannot_is_not() {
        assert!(is_lost(&Error::disconnected(
            DeviceKind::Projector,
            "showing pattern 3"
        )));
        let silent = Error::timeout(
            "showing pattern 3",
            Duration::from_secs(2),
            "check the cable",
        );
        assert!(is_lost(&silent));
        assert!(!is_lost(&Error::unsupported(
            "a raster of 3×3",
            "make it 8×8"
        )));
        assert!(!is_lost(&Error::protocol(
            "showing pattern 3",
            "load it first"
        )));
    }
}
