//! Work that may be ended at any time and leaves the loaded patterns as they are: a check between
//! two cycles, a step of the set-up.

use std::sync::Arc;

use super::Head;
use crate::error::Error;
use crate::projector::Raster;

/// Whether work with a head may go on; asked at least once per refresh, also from another thread.
pub type GoOn = Arc<dyn Fn() -> bool + Send + Sync>;

impl Head {
    /// Replaces the patterns; within [`Head::aside`] only those behind the patterns that stay. They
    /// are exposed as the camera is set, unless [`Head::expose`] follows.
    ///
    /// # Errors
    /// As [`Projector::load_behind`](crate::projector::Projector::load_behind); `Ended` as
    /// described there.
    pub fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        self.devices.expose(1)?;
        let kept = self.devices.kept;
        let projector = &mut self.devices.projector;
        let Some(go_on) = &self.go_on else {
            return projector.load_behind(kept, rasters);
        };
        projector.load_behind(kept, Vec::new())?;
        // One after the other: a projector takes milliseconds for each.
        for (at, raster) in (kept..).zip(rasters) {
            if !go_on() {
                return Err(Error::ended("loading patterns"));
            }
            projector.load_behind(at, vec![raster])?;
        }
        Ok(())
    }

    /// Calls `work`, for which the first `kept` patterns stay loaded: what it loads comes behind
    /// them, and its indices count from there. It exposes as the camera is set; patterns that stay
    /// are exposed afterwards as before. When `go_on` returns `false`, loading ends before the next
    /// pattern, a sequence as soon as the camera has given the frames that it was triggered for,
    /// and a watch within a refresh, each with the error `Ended`.
    pub fn aside<R>(&mut self, kept: usize, go_on: GoOn, work: impl FnOnce(&mut Self) -> R) -> R {
        let exposures = self.exposures();
        self.devices.kept = kept;
        self.go_on = Some(go_on);
        // Neither can be refused: the camera is set to one, and the others were accepted before.
        let _ = self.devices.expose(1);
        let result = work(self);
        let _ = self.devices.expose(exposures);
        self.devices.kept = 0;
        self.go_on = None;
        result
    }
}
