//! A cache of plans: those used last stay, so that a line that changes back and forth between
//! recipes does not wait.

use crate::recipe::plan::Plan;
use crate::recipe::store::Stamp;
use std::sync::Arc;

/// Most bytes of the kept plans, including the active one, and of the file that is being read
/// beside them: two recipes for a camera of 1.6 megapixels, or dozens for a small one.
const ROOM: u64 = 112 << 20;

/// The plans; the most recently used one is the last.
#[derive(Debug, Default)]
pub struct Shelf {
    ready: Vec<Ready>,
}

#[derive(Debug)]
struct Ready {
    stamp: Stamp,
    /// Fingerprint of the calibration that it was joined with.
    calibration: String,
    plan: Arc<Plan>,
}

impl Shelf {
    /// The plan of this recipe file, joined with this calibration, if it is kept.
    pub fn take(&mut self, stamp: &Stamp, calibration: &str) -> Option<Arc<Plan>> {
        let same = |ready: &Ready| ready.stamp == *stamp && ready.calibration == calibration;
        let found = self.ready.iter().position(same)?;
        let ready = self.ready.remove(found);
        let plan = ready.plan.clone();
        self.ready.push(ready);
        Some(plan)
    }

    /// Drops the least recently used plans until there is room for `bytes` more.
    pub fn make_room(&mut self, bytes: u64) {
        let bytes_of = |ready: &Ready| ready.plan.bytes() as u64;
        let taken = |ready: &[Ready]| ready.iter().map(bytes_of).sum::<u64>();
        while !self.ready.is_empty() && taken(&self.ready).saturating_add(bytes) > ROOM {
            self.ready.remove(0);
        }
    }

    /// Keeps a new plan.
    pub fn put(&mut self, stamp: Stamp, calibration: String, plan: Arc<Plan>) {
        self.make_room(plan.bytes() as u64);
        self.ready.push(Ready {
            stamp,
            calibration,
            plan,
        });
    }
}
