//! A job of the measuring task while it goes on: how far it is, and whether it is to end early.

use crate::station::{Event, JobId, StationHandle};
use crate::system::caller::Pulse;
use crate::system::progress::Progress;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The last aborted job: set by the station, read by the measuring task between two frames. Cheap
/// to clone.
#[derive(Clone, Debug, Default)]
pub struct Aborts(Arc<AtomicU64>);

impl Aborts {
    /// Ends this job early. Jobs are numbered upwards.
    pub fn abort(&self, job: JobId) {
        self.0.fetch_max(job.0, Ordering::Relaxed);
    }

    /// Whether this job is to be ended.
    pub(super) fn has(&self, job: JobId) -> bool {
        self.0.load(Ordering::Relaxed) == job.0
    }
}

/// Shortest time between two reports of one stage: often enough for a bar that moves.
const PERIOD: Duration = Duration::from_millis(250);

/// Reports the progress of a job to the station, the bar and the service manager. The job's threads
/// may report each row that they have done.
pub(super) struct Telling<'a> {
    pub station: &'a StationHandle,
    pub pulse: &'a Pulse,
    pub bar: &'a Progress,
    pub aborts: &'a Aborts,
    pub job: JobId,
    last: Mutex<Option<Reported>>,
}

/// The last report.
struct Reported {
    at: Instant,
    share: f64,
    words: String,
}

impl<'a> Telling<'a> {
    pub fn new(
        station: &'a StationHandle,
        pulse: &'a Pulse,
        bar: &'a Progress,
        aborts: &'a Aborts,
        job: JobId,
    ) -> Self {
        Self {
            station,
            pulse,
            bar,
            aborts,
            job,
            last: Mutex::new(None),
        }
    }

    /// Reports that a share of the job is done, and the present stage; answers whether to go on.
    pub fn tell(&self, share: f64, words: &str) -> bool {
        self.pulse.beat();
        // Another thread that is reporting says the same.
        if let Ok(mut last) = self.last.try_lock() {
            let before = last.as_ref().map_or(0.0, |report| report.share);
            let due = last
                .as_ref()
                .is_none_or(|report| report.words != words || report.at.elapsed() >= PERIOD);
            if due {
                // Rows are not done in their order.
                let share = share.max(before);
                self.bar.tell(share, words);
                self.station.event(Event::Progress {
                    job: self.job,
                    fraction: share as f32,
                    words: words.into(),
                });
                let (at, words) = (Instant::now(), words.to_owned());
                *last = Some(Reported { at, share, words });
            }
        }
        !self.aborts.has(self.job)
    }
}
