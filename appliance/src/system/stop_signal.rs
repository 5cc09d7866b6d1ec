//! Whether somebody told the program to end: Ctrl-C or SIGTERM, heard from the moment that anybody listens.

use super::runtime;
use crate::error::{Exit, Failure};
use std::future::pending;
use tokio::sync::watch;

/// Whether it was told to end; by default nobody ever tells. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Told(Option<watch::Receiver<bool>>);

impl Told {
    /// Listens from now on.
    ///
    /// # Errors
    /// If the system does not deliver signals (exit code 70).
    pub fn listen() -> Result<Self, Failure> {
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
        let (tell, told) = watch::channel(false);
        let wait = move || {
            runtime.block_on(async {
                #[cfg(unix)]
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
                #[cfg(not(unix))]
                drop(tokio::signal::ctrl_c().await);
            });
            // Nobody waits any more only where the program ends anyway.
            let _ = tell.send(true);
        };
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(wait)
            .map_err(failed)?;
        Ok(Self(Some(told)))
    }

    /// Whether it was told by now.
    pub fn already(&self) -> bool {
        self.0.as_ref().is_some_and(|told| *told.borrow())
    }

    /// Waits until it is told.
    pub async fn wait(&self) {
        if let Some(mut told) = self.0.clone()
            && told.wait_for(|told| *told).await.is_ok()
        {
            return;
        }
        pending::<()>().await;
    }
}
