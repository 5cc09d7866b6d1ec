//! `fringed serve`: the station, until it is told to end.

use super::Common;
use crate::daemon::{Daemon, runtime};
use crate::error::{Exit, Failure};

/// Runs the daemon until Ctrl-C or SIGTERM.
///
/// # Errors
/// If it cannot start.
pub fn run(common: &Common) -> Result<(), Failure> {
    let config = common.configuration()?;
    let progress = common.progress();
    let daemon = Daemon::start(&config, super::pool(config.threads)?, progress.clone())?;
    match daemon.wait_until_ready() {
        Ok(snapshot) => {
            let recipe = snapshot.recipe.as_ref().map_or(String::new(), |recipe| {
                format!(", recipe {} ({})", recipe.number, recipe.name)
            });
            progress.log(&format!("ready{recipe}"));
        }
        // Without a recipe the station still serves: the PLC loads or teaches one.
        Err(failure) => progress.log(&failure.message),
    }
    progress.log(&format!(
        "Modbus TCP on {}, page on http://{}",
        daemon.modbus, daemon.http
    ));
    until_told()?;
    progress.log("stopping");
    daemon.stop();
    Ok(())
}

/// Waits for Ctrl-C or SIGTERM.
///
/// # Errors
/// If the system does not deliver signals.
pub fn until_told() -> Result<(), Failure> {
    runtime()?.block_on(async {
        let failed = |error| Failure::because(Exit::Software, "wait for a signal", error);
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let mut terminate = signal(SignalKind::terminate()).map_err(failed)?;
            tokio::select! {
                told = tokio::signal::ctrl_c() => told.map_err(failed),
                _ = terminate.recv() => Ok(()),
            }
        }
        #[cfg(not(unix))]
        tokio::signal::ctrl_c().await.map_err(failed)
    })
}
