//! `fringed serve`: the station, until the stop signal. `fringed idle`: the output lines at their idle
//! levels, for the service manager after the daemon was killed.

use super::options::{Quiet, Serving, SimulatedPart};
use crate::config::Config;
use crate::error::Result;
use crate::production::backend;
use crate::service::{Caller, Daemon};
use crate::station::Snapshot;
use crate::station::snapshot::{reject, status};
use crate::system::caller::{Notify, StopSignal};
use crate::system::journal::Severity;
use crate::system::progress::Progress;
use crate::system::runtime;
use std::path::PathBuf;
use std::time::Duration;

/// How long the start waits for devices that are switched on together with the computer.
const TOGETHER: Duration = Duration::from_secs(20);

/// Run the station.
#[derive(Debug, clap::Args)]
pub struct Serve {
    #[command(flatten)]
    serving: Serving,
    #[command(flatten)]
    quiet: Quiet,
    #[command(flatten)]
    part: SimulatedPart,
}

impl Serve {
    /// Runs the daemon until Ctrl-C or SIGTERM.
    ///
    /// # Errors
    /// If it cannot start.
    pub fn run(&self) -> Result<()> {
        let mut config = self.serving.configuration()?;
        config.head.part = self.part.placed(&config.head)?;
        let progress = self.quiet.progress();
        let caller = Caller {
            notify: Notify::from_environment(),
            // Installed first, so that a signal at any time ends the program cleanly.
            stop: StopSignal::listen()?,
        };
        caller.notify.status("starting");
        let pool = self.serving.threads.pool(config.threads)?;
        let daemon = Daemon::start(&config, pool, progress.clone(), &caller)?;
        runtime()?.block_on(async {
            tokio::select! {
                () = caller.stop.wait() => {}
                () = serve(&daemon, &caller.notify, &progress) => {}
            }
        });
        caller.notify.stopping();
        progress.report(Severity::Notice, "stopping");
        daemon.stop();
        Ok(())
    }
}

/// Reports how the start ended, and from then on each change of the station's status.
async fn serve(daemon: &Daemon, notify: &Notify, progress: &Progress) {
    let mut settled = daemon.settled().await;
    let faulted = || daemon.station.snapshot().fault.is_some();
    if notify.is_connected() && settled.is_err() && faulted() {
        notify.status(&status_line(&daemon.station.snapshot()));
        let there = async {
            let mut snapshots = daemon.station.subscribe();
            drop(snapshots.wait_for(|now| now.fault.is_none()).await);
        };
        drop(tokio::time::timeout(TOGETHER, there).await);
        settled = daemon.settled().await;
    }
    match settled {
        Ok(snapshot) => {
            let recipe = snapshot.recipe.as_ref().map_or(String::new(), |recipe| {
                format!(", recipe {} ({})", recipe.number, recipe.name)
            });
            progress.report(Severity::Notice, &format!("ready{recipe}"));
            if let Some(words) = snapshot.refusal_words() {
                progress.warn(&format!("no trigger is accepted yet: {words}"));
            }
        }
        // The station serves without a recipe as well: the PLC loads or teaches one.
        Err(failure) => progress.warn(&failure.to_string()),
    }
    progress.log(&format!(
        "Modbus TCP on {}, page on http://{}",
        daemon.modbus, daemon.http
    ));
    notify.ready();
    let mut snapshots = daemon.station.subscribe();
    let mut reported = String::new();
    loop {
        let words = status_line(&snapshots.borrow_and_update());
        if words != reported {
            notify.status(&words);
            reported = words;
        }
        // Fails only after the daemon, which holds the sender, is gone.
        if snapshots.changed().await.is_err() {
            return;
        }
    }
}

/// The station's status in one line, which does not change from cycle to cycle.
fn status_line(snapshot: &Snapshot) -> String {
    match (&snapshot.fault, &snapshot.recipe) {
        (Some(fault), _) => format!("fault {}: {}; {}", fault.code, fault.cause, fault.remedy),
        (None, Some(_)) if snapshot.refusal == Some(reject::OTHER_RECIPE) => {
            snapshot.refusal_words().unwrap_or_default()
        }
        (None, Some(recipe)) => format!("recipe {} ({})", recipe.number, recipe.name),
        (None, None) if !snapshot.is(status::CALIBRATION_VALID) => {
            "the head is not calibrated: calibrate it with `fringed calibrate`".into()
        }
        (None, None) => "no recipe: load or teach one".into(),
    }
}

/// Leave the output lines at their idle levels: no trigger pulse, busy and ok off, fault on.
#[derive(Debug, clap::Args)]
pub struct Idle {
    /// Configuration file (TOML), which names the lines.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl Idle {
    /// Opens each line at its idle level and releases it.
    ///
    /// # Errors
    /// If the configuration is wrong, or a line cannot be used, for example because a running
    /// station holds it (69).
    pub fn run(&self) -> Result<()> {
        let config = self.config.as_deref().map(Config::read).transpose()?;
        backend::leave_lines_idle(&config.unwrap_or_default())
    }
}
