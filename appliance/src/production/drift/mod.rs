//! The check of the geometry between two cycles: whether camera and projector still stand to each
//! other as they were calibrated.
//!
//! Its patterns are loaded behind those of the recipe, and it ends within a frame when anything
//! else is to be done, so a trigger waits no longer than for a frame. What the frames show is
//! worked out on a thread of its own with a low priority.

mod due;
mod trend;

pub use due::Due;
pub use trend::{DriftTrend, FILE};

use super::{DEVICE_TIMEOUT, Worker, recovery};
use crate::config::Backend;
use crate::head::examine::{CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX};
use crate::recipe::teach::TeachError;
use crate::station::{Event, JobId, StationHandle};
use crate::system::priority;
use crate::system::progress::Progress;
use algo::pipeline::Epipolar;
use hal::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the measuring task remembers of its checks.
pub struct Watch {
    /// When the next check is due.
    pub due: Due,
    /// Whether the frames of the last check are being worked out.
    judging: Arc<AtomicBool>,
}

impl Watch {
    /// A check after so many cycles; 0 = never.
    pub fn every(cycles: u32) -> Self {
        Self {
            due: Due::every(cycles),
            judging: Arc::default(),
        }
    }
}

/// Who hears of a check.
struct DriftReport {
    trend: DriftTrend,
    station: StationHandle,
    progress: Progress,
    calibration: String,
}

impl DriftReport {
    /// Keeps what a check has found, if it has found anything, and says so.
    fn tell(&self, compared: Result<Option<Epipolar>, Error>) {
        let seen = match compared {
            Ok(Some(seen)) if seen.rms.is_finite() => seen,
            Ok(_) => return,
            Err(error) => return self.progress.warn(&format!("check the geometry: {error}")),
        };
        if let Err(problem) = self.trend.add(&self.calibration, &seen) {
            self.progress.warn(&problem);
        }
        let last = self.trend.last(&self.calibration);
        let words = format!(
            "geometry: projector points are {:.2} px off their epipolar lines (limit {MOST_DRIFT_PX} px)",
            seen.rms
        );
        match last {
            Some(drift) if drift.drifted => {
                self.progress.warn(&format!("{words}: {DRIFT_REMEDY}"));
            }
            _ if self.trend.is_doubtful(&self.calibration) => {
                self.progress
                    .log(&format!("{words}: it is checked once more"));
            }
            _ => self.progress.log(&words),
        }
        self.station.event(Event::Drift(last));
    }
}

impl Worker {
    /// Checks the geometry, if that is due and nothing else is to be done; called with each sign of
    /// life without an order.
    pub(super) fn rest_and_check(&mut self) {
        if self.watch.judging.load(Ordering::Relaxed) || !self.can_be_checked() {
            return;
        }
        let report = self.report();
        let doubtful = report.trend.is_doubtful(&report.calibration);
        if !self.watch.due.rests(doubtful) {
            return;
        }
        let kept = self.plan.as_ref().map_or(0, |plan| plan.patterns());
        let station = self.station.clone();
        let at_rest = move || station.snapshot().is_at_rest();
        // Its patterns take the place of those for live pictures.
        self.live = false;
        match self.crossed_fringes(kept, Arc::new(at_rest), &|_| ()) {
            Ok(fringes) => {
                self.watch.due.done(doubtful);
                self.judge(fringes, report);
            }
            Err(Error::Ended { .. }) => self.watch.due.ended(),
            Err(error) if recovery::is_lost(&error) => self.lost = Some(error),
            Err(error) => {
                self.watch.due.done(true);
                self.progress.warn(&format!("check the geometry: {error}"));
            }
        }
    }

    /// Checks the geometry on the part that was taught, between two shares of the job.
    ///
    /// # Errors
    /// A device is lost, or the teach was ended.
    pub(super) fn check_taught(
        &mut self,
        job: JobId,
        (from, to): (f64, f64),
    ) -> Result<(), TeachError> {
        if !(self.watch.due.is_on() && self.can_be_checked()) {
            return Ok(());
        }
        let (aborts, station) = (self.aborts.clone(), self.station.clone());
        let goes_on = move || !aborts.has(job);
        let progress = |share: f64| {
            let words = "checking the geometry".into();
            let fraction = (from + 0.6 * (to - from) * share) as f32;
            station.event(Event::Progress {
                job,
                fraction,
                words,
            });
        };
        let taken = self.crossed_fringes(0, Arc::new(goes_on), &progress);
        let fringes = match taken {
            Ok(fringes) => fringes,
            Err(Error::Ended { .. }) => return Err(TeachError::Ended),
            Err(error) if recovery::is_lost(&error) => return Err(TeachError::Device(error)),
            // The recipe is good even if its geometry could not be checked.
            Err(error) => {
                self.progress.warn(&format!("check the geometry: {error}"));
                return Ok(());
            }
        };
        let (pool, calibration) = (&self.pool, &self.opened.calibration);
        let compare = || pool.install(|| fringes.compare(calibration));
        self.report().tell(self.computing.on(compare));
        self.watch.due.done(false);
        Ok(())
    }

    /// Tells the station what is known of the head with its present calibration.
    pub(super) fn tell_drift(&self) {
        let report = self.report();
        let last = report.trend.last(&report.calibration);
        if self.station.snapshot().health.drift != last {
            self.station.event(Event::Drift(last));
        }
    }

    /// Recordings hold no other patterns than their own.
    fn can_be_checked(&self) -> bool {
        self.config.backend != Backend::Replay && self.opened.problem.is_none()
    }

    fn report(&self) -> DriftReport {
        DriftReport {
            trend: self.commission.drift().clone(),
            station: self.station.clone(),
            progress: self.progress.clone(),
            calibration: self.opened.calibration.fingerprint(),
        }
    }

    /// Takes the frames of a check behind the first `kept` patterns.
    fn crossed_fringes(
        &mut self,
        kept: usize,
        go_on: hal::head::GoOn,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<CrossedFringes, Error> {
        let (head, calibration) = (&mut self.opened.head, &self.opened.calibration);
        let (station, pulse) = (&self.station, &self.pulse);
        let lives = |share| {
            station.event(Event::Alive);
            pulse.beat();
            progress(share);
        };
        self.pool.install(|| {
            head.aside(kept, go_on, |head| {
                CrossedFringes::take(head, calibration, DEVICE_TIMEOUT, &lives)
            })
        })
    }

    /// Has the frames worked out beside what comes next.
    fn judge(&self, fringes: CrossedFringes, report: DriftReport) {
        let calibration = self.opened.calibration.clone();
        let judging = self.watch.judging.clone();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "checking".into())
            .start_handler(|_| priority::give_way())
            // Without one the program would end. The message is in the log, and there are no more
            // checks.
            .panic_handler(|_| ())
            .build();
        match pool {
            Ok(pool) => {
                judging.store(true, Ordering::Relaxed);
                // The thread ends with its work.
                pool.spawn(move || {
                    report.tell(fringes.compare(&calibration));
                    judging.store(false, Ordering::Relaxed);
                });
            }
            Err(error) => self.progress.warn(&format!(
                "check the geometry: start a thread: {error}: free memory"
            )),
        }
    }
}
