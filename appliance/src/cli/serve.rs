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
    // Before anybody is told that it serves: who is told may end it.
    let until_told = until_told()?;
    progress.log(&format!(
        "Modbus TCP on {}, page on http://{}",
        daemon.modbus, daemon.http
    ));
    until_told()?;
    progress.log("stopping");
    daemon.stop();
    Ok(())
}

/// Listens for Ctrl-C and SIGTERM from now on; the answer waits for one.
///
/// # Errors
/// If the system does not deliver signals.
pub fn until_told() -> Result<impl FnOnce() -> Result<(), Failure>, Failure> {
    let failed = |error| Failure::because(Exit::Software, "wait for a signal", error);
    let runtime = runtime()?;
    #[cfg(unix)]
    let (mut interrupt, mut terminate) = {
        use tokio::signal::unix::{SignalKind, signal};
        let _inside = runtime.enter();
        let listen = |kind| signal(kind).map_err(failed);
        (
            listen(SignalKind::interrupt())?,
            listen(SignalKind::terminate())?,
        )
    };
    Ok(move || {
        runtime.block_on(async {
            #[cfg(unix)]
            {
                tokio::select! {
                    _ = interrupt.recv() => Ok(()),
                    _ = terminate.recv() => Ok(()),
                }
            }
            #[cfg(not(unix))]
            tokio::signal::ctrl_c().await.map_err(failed)
        })
    })
}
