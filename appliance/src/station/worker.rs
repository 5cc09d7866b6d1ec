//! What the station knows of the measuring task (the worker): its last order, its last sign of
//! life, and the HEARTBEAT that shows to the PLC that it lives.

use super::clock::Micros;
use super::event::JobId;

/// The HEARTBEAT register advances once in this time.
const BEAT: Micros = Micros::from_millis(100);

/// The worker as seen from the station.
#[derive(Debug, Clone)]
pub(super) struct WorkerState {
    /// The last order.
    pub(super) last_job: JobId,
    /// The time of its last event.
    pub(super) last_alive: Micros,
    /// HEARTBEAT.
    pub(super) heartbeat: u16,
    next_beat: Micros,
}

impl WorkerState {
    /// A worker that was started at `now` and has no orders yet.
    pub(super) fn new(now: Micros) -> Self {
        Self {
            last_job: JobId(0),
            last_alive: now,
            heartbeat: 0,
            next_beat: now.after(BEAT),
        }
    }

    /// The number of a new order.
    pub(super) fn next_job(&mut self) -> JobId {
        self.last_job = JobId(self.last_job.0.wrapping_add(1));
        self.last_job
    }

    /// Advances HEARTBEAT to `now`, or holds it while the worker misses its deadlines. Beats missed
    /// that way are not made up for.
    pub(super) fn beat(&mut self, in_time: bool, now: Micros) {
        if !in_time {
            self.next_beat = now.after(BEAT);
        } else if self.next_beat <= now {
            let beats = now.since(self.next_beat).0 / BEAT.0 + 1;
            // The register is the low 16 bits of the count.
            self.heartbeat = self.heartbeat.wrapping_add((beats & 0xFFFF) as u16);
            self.next_beat = self.next_beat.after(Micros(beats.saturating_mul(BEAT.0)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_made_up_for_and_missed_deadlines_are_not() {
        let mut worker = WorkerState::new(Micros(0));
        let ms = Micros::from_millis;
        worker.beat(true, ms(99));
        assert_eq!(worker.heartbeat, 0);
        worker.beat(true, ms(350));
        assert_eq!(worker.heartbeat, 3);
        worker.beat(false, ms(1000));
        worker.beat(true, ms(1099));
        assert_eq!(worker.heartbeat, 3);
        worker.beat(true, ms(1100));
        assert_eq!(worker.heartbeat, 4);
    }
}
