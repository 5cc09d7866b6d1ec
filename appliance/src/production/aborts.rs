//! The job that the station wants to be ended early.

use crate::station::JobId;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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
