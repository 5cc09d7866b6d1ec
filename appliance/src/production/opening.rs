//! Opens the head at the start, and again when it was lost: a fault with its remedy is reported, and
//! the head is opened again and again until it is there.
//!
//! At the start this is so only if a service manager started the program; else one attempt decides.

use super::{Order, SIGN_OF_LIFE, Worker, active};
use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure, Result, code_of};
use crate::production::backend::{self, OpenedHead};
use crate::station::{Event, StationHandle, error_code};
use crate::system::caller::Pulse;
use crate::system::computing::{self, Computing};
use crate::system::progress::Progress;
use hal::error::Error;
use sim::Stage;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};

/// Opens the head at the start.
pub struct Opening<'a> {
    /// The configured head.
    pub config: &'a HeadConfig,
    /// Computing threads.
    pub pool: &'a rayon::ThreadPool,
    /// Progress and log.
    pub progress: &'a Progress,
    /// The station, which shows a missing head as a fault.
    pub station: &'a StationHandle,
    /// The measuring task's heartbeat.
    pub pulse: &'a Pulse,
    /// Whether to wait for a head that is not there.
    pub patient: bool,
    /// Marked while the light of a simulated head is computed.
    pub computing: &'a Computing,
}

impl Opening<'_> {
    /// Opens the head; returns it with the event that tells the station that it can work. `outcome`
    /// gets the outcome of the first attempt for the caller of the start: where parts are placed in
    /// front of a simulated head, or `None` as long as the head is waited for. Returns `None` if
    /// the head cannot be opened or the daemon ends.
    pub fn run(
        &self,
        orders: &Receiver<Order>,
        outcome: &Sender<Result<Option<Stage>>>,
    ) -> Option<(OpenedHead, Event)> {
        let on_progress = |share: f64| {
            self.pulse.beat();
            self.station.event(Event::Alive);
            self.progress
                .tell(share, "working out the light of the scene");
        };
        let mut pause = Pause::default();
        let mut reported = String::new();
        loop {
            self.pulse.beat();
            let open = || {
                self.pool
                    .install(|| backend::open(self.config, &on_progress))
            };
            let opened = match self.config.backend {
                Backend::Sim => self.computing.on(open),
                Backend::Replay | Backend::Rpi => open(),
            };
            match opened {
                Ok(head) => {
                    computing::trim_memory();
                    // The receiver is gone if the start was given up.
                    drop(outcome.send(Ok(head.stage.clone())));
                    let event = match reported.is_empty() {
                        true => Event::Started,
                        false => Event::Recovered { recipe: None },
                    };
                    return Some((head, event));
                }
                // Once the head is waited for, errors of its files are waited out as well.
                Err(failure)
                    if self.patient
                        && (failure.exit == Exit::Unavailable || !reported.is_empty()) =>
                {
                    if failure.to_string() != reported {
                        self.lost(&failure);
                        reported = failure.to_string();
                    }
                    drop(outcome.send(Ok(None)));
                }
                Err(failure) => {
                    drop(outcome.send(Err(failure)));
                    return None;
                }
            }
            if pause.wait(orders, self.station, self.pulse).is_break() {
                return None;
            }
        }
    }

    fn lost(&self, failure: &Failure) {
        self.station.event(Event::Faulted {
            error_code: failure.device.as_ref().map_or(error_code::UNNAMED, code_of),
            cause: failure.to_string().into(),
            remedy: REMEDY.into(),
        });
    }
}

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
