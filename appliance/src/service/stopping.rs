//! Stops the daemon: asks every thread to end, and waits for each with a limit.

use super::Daemon;
use crate::production::Order;
use crate::station::Event;
use crate::system::progress::Progress;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two checks whether a thread has ended.
const POLLING: Duration = Duration::from_millis(2);
/// A measuring task that has not ended after this time is abandoned: each wait for a device ends after 2 s.
const MEASURING: Duration = Duration::from_secs(3);
/// A thread that has not ended after this time is abandoned: a stop takes at most 5 s, whatever hangs.
const STOPPING: Duration = Duration::from_millis(4500);

impl Daemon {
    /// Stops everything: the cycle in flight ends with its result, INVALID if it was still exposing; then the sockets close.
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
        let needed = || !self.computing.is_under_way();
        join_while(
            &needed,
            "measuring",
            measuring,
            began + MEASURING,
            &self.progress,
        );
        // A cycle that has no result by now gets none from the measuring task.
        self.station.event(Event::Stop);
        let _ = self.sockets.send(true);
        join("sockets", serving, until, &self.progress);
        join("lines", wiring, until, &self.progress);
        drop(self.survey);
        join("survey", surveying, until, &self.progress);
        // Last, so that the results of the others are stored.
        self.history.stop(self.station.snapshot().result_seq);
        join("history", self.writing, until, &self.progress);
    }
}

/// Waits for a thread to end, until `until` at most: a thread that hangs in a device or the storage must not keep the program alive.
fn join(name: &str, thread: JoinHandle<()>, until: Instant, progress: &Progress) {
    join_while(&|| true, name, thread, until, progress);
}

/// The same as long as the thread is `needed`: one that only computes may end with the program.
fn join_while(
    needed: &dyn Fn() -> bool,
    name: &str,
    thread: JoinHandle<()>,
    until: Instant,
    progress: &Progress,
) {
    while !thread.is_finished() {
        if !needed() {
            return;
        }
        if Instant::now() > until {
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
