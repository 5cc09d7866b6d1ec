//! The stop signal: Ctrl-C or SIGTERM.

use super::runtime;
use crate::error::{Exit, Result};
use std::future::pending;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// Whether the signal has arrived; the default value never gets one. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct StopSignal(Option<watch::Receiver<bool>>);

impl StopSignal {
    /// Catches the signals from now on.
    ///
    /// # Errors
    /// If the system does not deliver signals (exit code 70).
    pub fn listen() -> Result<Self> {
        let failed = Exit::Software.because("wait for a signal");
        let runtime = runtime()?;
        let listen = |kind| {
            let _inside = runtime.enter();
            signal(kind).map_err(&failed)
        };
        let mut interrupt = listen(SignalKind::interrupt())?;
        let mut terminate = listen(SignalKind::terminate())?;
        let (arrive, arrived) = watch::channel(false);
        let wait = move || {
            runtime.block_on(async {
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
            });
            // All receivers are gone only where the program ends anyway.
            let _ = arrive.send(true);
        };
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(wait)
            .map_err(&failed)?;
        Ok(Self(Some(arrived)))
    }

    /// Whether it has arrived.
    pub fn has_arrived(&self) -> bool {
        self.0.as_ref().is_some_and(|arrived| *arrived.borrow())
    }

    /// Waits until it arrives.
    pub async fn wait(&self) {
        if let Some(mut arrived) = self.0.clone()
            && arrived.wait_for(|arrived| *arrived).await.is_ok()
        {
            return;
        }
        pending::<()>().await;
    }
}
