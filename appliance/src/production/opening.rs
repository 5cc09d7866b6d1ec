//! The head at the start: opened once, or, where a service manager started the program, until it is there.

use super::Order;
use super::recovery::{Pause, REMEDY};
use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure};
use crate::production::backend::{self, Opened};
use crate::station::{Event, StationHandle, error_code};
use crate::system::computing::Computing;
use crate::system::notify::Pulse;
use crate::system::progress::Progress;
use sim::Stage;
use std::sync::mpsc::{Receiver, Sender};

/// What opens the head.
pub struct Opening<'a> {
    /// Which.
    pub config: &'a HeadConfig,
    /// Computing threads.
    pub pool: &'a rayon::ThreadPool,
    /// Shows how far it is, and the log.
    pub progress: &'a Progress,
    /// Who is told that it is not there.
    pub station: &'a StationHandle,
    /// The measuring task's signs of life.
    pub pulse: &'a Pulse,
    /// Whether a head that is not there is waited for.
    pub patient: bool,
    /// Told while the light of a simulated head is worked out.
    pub computing: &'a Computing,
}

impl Opening<'_> {
    /// Opens the head and answers with it and with what the station is to be told when it can work. Whoever waits for the start hears through
    /// `heard` how the first attempt ended; a head that is waited for is as good as none that can be placed in front of.
    /// None if there is nothing to work with.
    pub fn run(
        &self,
        orders: &Receiver<Order>,
        heard: &Sender<Result<Option<Stage>, Failure>>,
    ) -> Option<(Opened, Event)> {
        let told = |share: f64| {
            self.pulse.beat();
            self.progress
                .tell(share, "working out the light of the scene");
        };
        let mut pause = Pause::default();
        let mut said = String::new();
        loop {
            self.pulse.beat();
            // Nobody hears any more only if the start was given up.
            let open = || self.pool.install(|| backend::open(self.config, &told));
            let opened = match self.config.backend {
                Backend::Sim => self.computing.on(open),
                Backend::Replay | Backend::Rpi => open(),
            };
            match opened {
                Ok(head) => {
                    drop(heard.send(Ok(head.stage.clone())));
                    let event = match said.is_empty() {
                        true => Event::Started,
                        false => Event::Recovered { recipe: None },
                    };
                    return Some((head, event));
                }
                // While it is waited for, files of it may come and go as well.
                Err(failure)
                    if self.patient && (failure.exit == Exit::Unavailable || !said.is_empty()) =>
                {
                    if failure.message != said {
                        self.lost(&failure);
                        said = failure.message;
                    }
                    drop(heard.send(Ok(None)));
                }
                Err(failure) => {
                    drop(heard.send(Err(failure)));
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
            error_code: failure.code.unwrap_or(error_code::UNNAMED),
            cause: failure.message.as_str().into(),
            remedy: REMEDY.into(),
        });
    }
}
