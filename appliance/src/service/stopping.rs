//! Stops the daemon: asks every thread to end, and waits for each with a limit.

use super::Daemon;
use crate::production::Order;
use crate::station::Event;
use crate::system::progress::Progress;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two checks whether a thread has ended.
const POLLING: Duration = Duration::from_millis(2);
/// A measuring task that has not ended after this time is abandoned: each wait for a device ends
/// after 2 s.
const MEASURING: Duration = Duration::from_secs(3);
/// A thread that has not ended after this time is abandoned: a stop takes at most 5 s, whatever
/// hangs.
const STOPPING: Duration = Duration::from_millis(4500);

impl Daemon {
    /// Stops everything: the cycle in flight ends with its result, INVALID if it was still
    /// exposing; then the sockets close.
    pub fn stop(self) {
        self.station.event(Event::Stop);
        self.end();
    }

    /// Ends measuring, then the sockets, the survey and the history.
    pub(super) fn end(self) {
        let began = Instant::now();
        let until = began + STOPPING;
        // Fails only if the measuring task has ended already.
        drop(self.orders.send(Order::Stop));
        let [measuring, serving, surveying, wiring] = self.threads;
        let join = |thread| join_while(thread, until, &self.progress, &|| true);
        // A thread that only computes may end with the program.
        join_while(measuring, began + MEASURING, &self.progress, &|| {
            !self.computing.is_under_way()
        });
        // A cycle that has no result by now gets none from the measuring task.
        self.station.event(Event::Stop);
        let _ = self.sockets.send(true);
        join(serving);
        join(wiring);
        drop(self.survey);
        join(surveying);
        // Last, so that the results of the others are stored.
        let last_seq = self.station.snapshot().result_seq;
        while !self.history.stop(last_seq) && Instant::now() < until {
            std::thread::sleep(POLLING);
        }
        join(self.writing);
    }
}

/// Waits for a thread to end as long as it is `needed`, until `until` at most: a thread that hangs
/// in a device or the storage must not keep the program alive.
fn join_while(
    thread: JoinHandle<()>,
    until: Instant,
    progress: &Progress,
    needed: &dyn Fn() -> bool,
) {
    while !thread.is_finished() {
        if !needed() {
            return;
        }
        if Instant::now() > until {
            let name = thread.thread().name().unwrap_or_default();
            progress.warn(&format!(
                "the thread {name} does not end and is left behind"
            ));
            return;
        }
        std::thread::sleep(POLLING);
    }
    // The message of a panic is in the log already.
    drop(thread.join());
}
