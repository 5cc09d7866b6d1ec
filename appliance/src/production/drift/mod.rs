//! The check of the geometry between two cycles: whether camera and projector still stand to each
//! other as they were calibrated.
//!
//! Its patterns are loaded behind those of the recipe, and it ends within a frame when anything
//! else is to be done, so a trigger waits no longer than for a frame. What the frames show is
//! worked out on a thread of its own with a low priority.

use super::{DEVICE_TIMEOUT, Worker, opening};
use crate::config::Backend;
use crate::head::examine::{CrossedFringes, DRIFT_REMEDY, MOST_DRIFT_PX};
use crate::recipe::teach::TeachError;
use crate::station::{Event, JobId, StationHandle};
use crate::system::computing;
use crate::system::progress::Progress;
use algo::pipeline::Epipolar;
use hal::error::Error;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Signs of life without an order before the first attempt: a second.
const SHORTEST: u32 = 10;
/// Signs of life without an order before an attempt, at most, after orders have ended attempts:
/// about a minute.
const LONGEST: u32 = 640;

/// Counts cycles and signs of life. An attempt that an order ended is made again after twice the
/// rest, so that a line with short pauses is not lit in each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// Cycles between two checks; 0 = there are none.
    every: u32,
    cycles: u32,
    /// Signs of life since the last order.
    rested: u32,
    /// How many signs of life there must be before an attempt.
    pause: u32,
}

impl Due {
    /// A check after so many cycles; 0 = never.
    pub fn every(cycles: u32) -> Self {
        Self {
            every: cycles,
            cycles: 0,
            rested: 0,
            pause: SHORTEST,
        }
    }

    /// Whether there are checks at all.
    pub fn is_on(&self) -> bool {
        self.every > 0
    }

    /// A part was measured.
    pub fn cycle(&mut self) {
        self.cycles = self.cycles.saturating_add(1);
    }

    /// A part was measured that a head out of adjustment would explain: the check need not wait for
    /// more cycles.
    pub fn suspect(&mut self) {
        self.cycles = self.cycles.max(self.every);
    }

    /// There was an order.
    pub fn disturbed(&mut self) {
        self.rested = 0;
    }

    /// A sign of life without an order. Answers whether to check now; a doubtful result is checked
    /// again without more cycles.
    pub fn rests(&mut self, doubtful: bool) -> bool {
        self.rested = self.rested.saturating_add(1);
        self.is_on() && (doubtful || self.cycles >= self.every) && self.rested >= self.pause
    }

    /// The frames of a check were taken; `doubtful` as before.
    pub fn done(&mut self, doubtful: bool) {
        self.cycles = 0;
        match doubtful {
            // The part may be gone, so that the doubt stays.
            true => self.ended(),
            false => (self.rested, self.pause) = (0, SHORTEST),
        }
    }

    /// An order ended the check.
    pub fn ended(&mut self) {
        self.rested = 0;
        self.pause = (2 * self.pause).min(LONGEST);
    }
}

mod trend;

pub use trend::{DriftTrend, FILE};

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

/// Where the outcome of a check goes: to the trend, the log and the station.
struct DriftReport {
    trend: DriftTrend,
    station: StationHandle,
    progress: Progress,
    calibration: String,
}

impl DriftReport {
    /// Keeps and reports what a check has found, if it has found anything.
    fn tell(&self, compared: Result<Option<Epipolar>, Error>) {
        let seen = match compared {
            Ok(Some(seen)) if seen.rms.is_finite() => seen,
            Ok(_) => return,
            Err(error) => return self.progress.warn(&format!("check the geometry: {error}")),
        };
        if let Err(problem) = self.trend.add(&self.calibration, &seen) {
            self.progress.warn(&problem.to_string());
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
            Err(error) if opening::is_lost(&error) => self.lost = Some(error),
            Err(error) => {
                self.watch.due.done(true);
                self.progress.warn(&format!("check the geometry: {error}"));
            }
        }
    }

    /// Checks the geometry on the part that was taught, which takes these shares of the job.
    ///
    /// # Errors
    /// A device is lost, or the teach was ended.
    pub(super) fn check_taught(
        &mut self,
        job: JobId,
        shares: Range<f64>,
    ) -> Result<(), TeachError> {
        if !(self.watch.due.is_on() && self.can_be_checked()) {
            return Ok(());
        }
        let (aborts, station) = (self.aborts.clone(), self.station.clone());
        let goes_on = move || !aborts.has(job);
        let progress = |share: f64| {
            let words = "checking the geometry".into();
            let fraction = (shares.start + 0.6 * (shares.end - shares.start) * share) as f32;
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
            Err(error) if opening::is_lost(&error) => return Err(TeachError::Device(error)),
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
            .start_handler(|_| computing::give_way())
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Signs of life until a check is due; none within an hour.
    fn rest(due: &mut Due, doubtful: bool) -> Option<u32> {
        (1..36_000).find(|_| due.rests(doubtful))
    }

    #[test]
    fn a_check_is_due_after_its_cycles_and_a_second_without_an_order() {
        let mut due = Due::every(3);
        assert_eq!(rest(&mut due, false), None);
        for _ in 0..2 {
            due.cycle();
            assert!(!due.rests(false));
        }
        due.cycle();
        due.disturbed();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
        due.done(false);
        assert_eq!(rest(&mut due, false), None);
        let mut never = Due::every(0);
        never.cycle();
        assert_eq!(
            (rest(&mut never, false), rest(&mut never, true)),
            (None, None)
        );
    }

    #[test]
    fn a_check_that_orders_end_waits_for_longer_and_longer_rests() {
        let mut due = Due::every(1);
        due.cycle();
        let mut rests = Vec::new();
        for _ in 0..8 {
            rests.push(rest(&mut due, false).unwrap());
            due.ended();
        }
        assert_eq!(rests, [10, 20, 40, 80, 160, 320, 640, 640]);
        due.done(false);
        due.cycle();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
    }

    #[test]
    fn a_suspicion_is_checked_without_more_cycles() {
        let mut due = Due::every(100);
        due.suspect();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
        let mut never = Due::every(0);
        never.suspect();
        assert_eq!(rest(&mut never, false), None);
    }

    #[test]
    fn a_doubtful_result_is_checked_again_without_more_cycles_but_not_all_the_time() {
        let mut due = Due::every(100);
        assert_eq!(rest(&mut due, true), Some(SHORTEST));
        due.done(true);
        assert_eq!(rest(&mut due, true), Some(2 * SHORTEST));
    }
}
