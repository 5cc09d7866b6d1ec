//! Opens the head at the start: once, or again and again until it is there if a service manager
//! started the program.

use super::Order;
use super::recovery::{Pause, REMEDY};
use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure, Result, code_of};
use crate::production::backend::{self, OpenedHead};
use crate::station::{Event, StationHandle, error_code};
use crate::system::computing::Computing;
use crate::system::memory;
use crate::system::notify::Pulse;
use crate::system::progress::Progress;
use sim::Stage;
use std::sync::mpsc::{Receiver, Sender};

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
                    memory::trim();
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
