//! Waits for the end of the start: the station has its recipe, or there is a reason why not.

use super::{Daemon, runtime};
use crate::error::{Exit, Failure, Result};
use crate::station::snapshot::status;
use crate::station::{RecipeResult, Snapshot};
use std::sync::Arc;

impl Daemon {
    /// Waits until the station has its recipe or cannot get it. With a recipe it is READY, unless
    /// the PLC has not set ONLINE or selects another recipe.
    ///
    /// # Errors
    /// The station has a fault, or its recipe could be neither loaded nor taught.
    pub fn wait_until_ready(&self) -> Result<Arc<Snapshot>> {
        runtime()?.block_on(self.settled())
    }

    /// As [`Daemon::wait_until_ready`], as a future.
    ///
    /// # Errors
    /// As [`Daemon::wait_until_ready`].
    pub async fn settled(&self) -> Result<Arc<Snapshot>> {
        if !self.awaited {
            let message = "there is no recipe yet: load or teach one, or import one with `fringed recipe import`";
            return Exit::Unavailable.fail(message);
        }
        let mut snapshots = self.station.subscribe();
        let refused = |snapshot: &Snapshot| snapshot.recipe_result != RecipeResult::Ok;
        let settled = |snapshot: &Arc<Snapshot>| {
            let broken = snapshot.fault.is_some() || snapshot.error.is_some();
            let loaded = snapshot.recipe.is_some() && !snapshot.is_working();
            loaded || broken || refused(snapshot)
        };
        let snapshot = snapshots.wait_for(settled).await.map(|found| found.clone());
        let snapshot = snapshot
            .map_err(|_| Failure::new(Exit::Software, "the station ended before it was ready"))?;
        match (&snapshot.fault, &snapshot.error) {
            (Some(fault), _) => {
                let message = format!("{}: {}", fault.cause, fault.remedy);
                Exit::Unavailable.fail(message)
            }
            (None, error) if refused(&snapshot) => {
                let otherwise = "the recipe was not loaded: load another, or teach it again";
                let message = error.as_deref().unwrap_or(otherwise);
                Exit::Content.fail(message)
            }
            (None, Some(error)) if !snapshot.is(status::READY) => Exit::Unavailable.fail(error),
            _ => Ok(snapshot),
        }
    }
}
