//! When to flip and when to trigger: planned from the refresh, the flip-to-light delay and the camera's way of taking frames.
//!
//! The next pattern's light may come when the exposure of the one in view ends. With the flip-to-light delay L and refreshes
//! of period r after the flip at T, an exposure that ends at E allows the flip at T + m r, where m is the smallest whole
//! number with T + m r + L ≥ E (within the tolerance). So the flip is often queued while this pattern's frame is still being
//! exposed or read out, and with a delay of more than an exposure even before it is triggered. None of this decides whose a
//! frame is: a plan that fails costs a retake.

use std::time::Duration;

use super::Timing;
use crate::camera::{CameraTiming, Starts};
use crate::projector::Flip;
use crate::trigger::{REMEMBERED, Spoiled};
use crate::units::Timestamp;

/// Triggers that are remembered; a frame that comes later than so many others is nobody's.
const TRIGGERS: usize = REMEMBERED;

/// One showing of a pattern.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shot {
    pub position: usize,
    pub flip: Flip,
    /// When its light comes.
    pub light: Timestamp,
    pub fired: Option<Timestamp>,
    /// Nothing is awaited of it any more.
    pub done: bool,
}

impl Shot {
    pub fn waits_for_trigger(&self) -> bool {
        !self.done && self.fired.is_none()
    }
}

/// The times of a head, and what of the camera is known so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pacing {
    pub refresh: Duration,
    pub flip_to_light: Duration,
    pub tolerance: Duration,
    pub exposure: Duration,
    hold: u32,
    period: Duration,
    delivery: Duration,
    triggered: bool,
    /// A triggered camera can start its next exposure.
    free: Timestamp,
    /// The latest triggers, and how many there were.
    triggers: [Timestamp; TRIGGERS],
    count: usize,
    /// The latest of their pulses that were spoiled, and how many there were.
    spoiled: [Option<Spoiled>; TRIGGERS],
    told: usize,
    /// An exposure starts this soon after its trigger, or never.
    promptness: Duration,
    /// The start of the latest exposure of a camera that runs by itself.
    phase: Option<Timestamp>,
}

impl Pacing {
    pub fn new(refresh: Duration, camera: &CameraTiming, timing: &Timing) -> Self {
        Self {
            refresh: refresh.max(Duration::from_nanos(1)),
            flip_to_light: timing.flip_to_light,
            tolerance: timing.tolerance_for(camera.exposure),
            exposure: camera.exposure,
            hold: timing.hold.max(1),
            period: camera.period.max(Duration::from_nanos(1)),
            delivery: camera.delivery,
            triggered: camera.starts == Starts::OnTrigger,
            free: Timestamp(0),
            triggers: [Timestamp(0); TRIGGERS],
            count: 0,
            spoiled: [None; TRIGGERS],
            told: 0,
            promptness: timing.tolerance,
            phase: None,
        }
    }

    /// How long a sequence of so many patterns takes when nothing goes wrong, at most.
    pub fn planned(&self, patterns: usize) -> Duration {
        // A camera that runs by itself starts up to a period after the light.
        let waits = if self.triggered {
            Duration::ZERO
        } else {
            self.period
        };
        let each = (self.exposure + waits)
            .max(self.period)
            .max(self.refresh * self.hold);
        let refreshes = each.as_nanos().div_ceil(self.refresh.as_nanos()) + 1;
        let refreshes = u32::try_from(refreshes).unwrap_or(u32::MAX);
        let patterns = u32::try_from(patterns).unwrap_or(u32::MAX);
        let each = self.refresh.saturating_mul(refreshes);
        each.saturating_mul(patterns.saturating_add(1)) + self.flip_to_light + self.delivery
    }

    pub fn end(&self, start: Timestamp) -> Timestamp {
        start + self.exposure
    }

    /// How much of the tolerance a plan may use. The rest is for a trigger that fires a little late, and for the jitter of a camera that
    /// runs by itself.
    fn slack(&self) -> Duration {
        self.tolerance / 2
    }

    pub fn fired(&mut self, at: Timestamp) {
        self.free = at + self.period;
        self.triggers[self.count % TRIGGERS] = at;
        self.count += 1;
    }

    /// Whether a frame's exposure may have started then, with so many exposures before it in this sequence: a triggered camera starts
    /// one at a trigger, and each takes a trigger of its own. Else the stamp is not to be believed.
    pub fn explains(&self, start: Timestamp, before: u64) -> bool {
        let known = self.count.saturating_sub(TRIGGERS)..self.count;
        let prompt = |at: Timestamp| start.0.abs_diff(at.0) <= self.promptness.as_nanos() as u64;
        !self.triggered
            || known
                .filter(|index| *index as u64 >= before)
                .any(|index| prompt(self.triggers[index % TRIGGERS]))
    }

    /// A pulse did not last as long as it should. That matters to a camera that exposes for as long as its pulses last.
    pub fn spoiled(&mut self, pulse: Spoiled) {
        if !self.triggered || !pulse.decides(self.exposure) {
            return;
        }
        // The camera is busy for as much longer.
        self.free = self.free.max(pulse.fired + (pulse.longer + self.period));
        self.spoiled[self.told % TRIGGERS] = Some(pulse);
        self.told += 1;
    }

    /// The pulse that spoiled an exposure that seems to have started then, if one did.
    pub fn spoiled_by(&self, start: Timestamp) -> Option<Spoiled> {
        let mut known = self.spoiled.iter().flatten();
        known.find(|pulse| self.spoils(pulse, start)).copied()
    }

    /// Whether this pulse spoiled an exposure that seems to have started then: its own, whose stamp may mark the end and so be off
    /// by as much as the pulse; or the next one, if that was triggered while the camera was busy for longer than planned.
    pub fn spoils(&self, pulse: &Spoiled, start: Timestamp) -> bool {
        let from = pulse.fired - (pulse.shorter + self.promptness);
        let busy = self.period.saturating_sub(self.promptness);
        let until = pulse.fired + (pulse.longer + busy.max(self.promptness));
        (from..=until).contains(&start)
    }

    pub fn exposed(&mut self, start: Timestamp) {
        self.phase = self.phase.max(Some(start));
    }

    /// When the trigger of this shot is due, if all before it were fired; none for a camera that runs by itself.
    pub fn trigger(&self, shot: &Shot) -> Option<Timestamp> {
        self.triggered.then(|| shot.light.max(self.free))
    }

    /// When the exposure of this shot starts, as far as that is known.
    pub fn expected(&self, shot: &Shot) -> Option<Timestamp> {
        if self.triggered {
            return shot.fired;
        }
        self.phase
            .map(|phase| self.next_exposure(phase, shot.light - self.slack()))
    }

    /// The first exposure of a camera that runs by itself that starts at `from` or later.
    fn next_exposure(&self, phase: Timestamp, from: Timestamp) -> Timestamp {
        // Nanoseconds of u64 fit i128 with room for their sums.
        let period = i128::try_from(self.period.as_nanos()).unwrap_or(i128::MAX);
        let ahead = i128::from(from.0) - i128::from(phase.0);
        let steps = ahead.div_euclid(period) + i128::from(ahead.rem_euclid(period) != 0);
        let at = i128::from(phase.0) + steps * period;
        Timestamp(u64::try_from(at.max(0)).unwrap_or(u64::MAX))
    }

    /// When nothing is to be hoped for from this shot any more.
    pub fn overdue(&self, shot: &Shot) -> Option<Timestamp> {
        if shot.done {
            return None;
        }
        // One period and a half more: its frame may come after the next one.
        let patience = self.exposure + self.delivery + self.period * 3 / 2 + self.tolerance;
        match self.expected(shot) {
            Some(start) => Some(start + patience),
            None if self.triggered => None,
            None => Some(shot.light + (self.period + patience)),
        }
    }

    /// When to queue the flip after `last`, and the count it should come with; none while that cannot be planned.
    pub fn next_flip<'a>(
        &self,
        shots: impl Iterator<Item = &'a Shot>,
        last: &Shot,
        now: Timestamp,
    ) -> Option<(Timestamp, u64)> {
        let refreshes = if last.done {
            1
        } else {
            let start = self.planned_start(shots, last, now)?;
            let light_until = self.end(start) - self.slack();
            let shown = light_until.since(last.light).as_nanos();
            u64::try_from(shown.div_ceil(self.refresh.as_nanos())).unwrap_or(u64::MAX)
        };
        let refreshes = refreshes.max(u64::from(self.hold)).max(1);
        let before = u32::try_from(refreshes - 1).unwrap_or(u32::MAX);
        let mut due = last.flip.timestamp + self.refresh.saturating_mul(before);
        if before > 0 {
            // Not before the refresh that this flip is to come after, whatever the jitter of its stamp.
            due = due + self.refresh / 8;
        }
        // Queued late it comes with the next refresh after now.
        let passed = now.since(last.flip.timestamp).as_nanos() / self.refresh.as_nanos();
        let comes = refreshes.max(u64::try_from(passed).unwrap_or(u64::MAX).saturating_add(1));
        Some((due, last.flip.sequence.saturating_add(comes)))
    }

    /// When the exposure of the last shot will start if all goes to plan.
    fn planned_start<'a>(
        &self,
        shots: impl Iterator<Item = &'a Shot>,
        last: &Shot,
        now: Timestamp,
    ) -> Option<Timestamp> {
        if !self.triggered || last.fired.is_some() {
            return self.expected(last);
        }
        let mut free = self.free.max(now);
        let mut start = free;
        for shot in shots.filter(|shot| shot.waits_for_trigger()) {
            start = shot.light.max(free);
            free = start + self.period;
        }
        Some(start)
    }

    /// The first refresh after `now`, counted from this shot's flip.
    pub fn next_refresh(&self, shot: &Shot, now: Timestamp) -> Timestamp {
        let passed = now.since(shot.flip.timestamp).as_nanos() / self.refresh.as_nanos();
        let steps = u32::try_from(passed + 1).unwrap_or(u32::MAX);
        shot.flip.timestamp + self.refresh.saturating_mul(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    /// The reference head: a camera that exposes for 16 667 µs and then is read out.
    fn pacing(starts: Starts) -> Pacing {
        let camera = CameraTiming {
            starts,
            exposure: us(16_667),
            period: us(33_333),
            delivery: us(20_000),
        };
        Pacing::new(us(16_667), &camera, &Timing::default())
    }

    fn pulse(fired: Timestamp, width: Duration, longer: Duration) -> Spoiled {
        Spoiled {
            fired,
            width,
            shorter: us(2),
            longer,
        }
    }

    #[test]
    fn a_long_pulse_spoils_its_frame_whatever_its_stamp_marks_and_the_next_one_that_came_too_soon()
    {
        let (fired, longer) = (Timestamp(1_000_000_000), us(40_000));
        let mut pacing = pacing(Starts::OnTrigger);
        pacing.fired(fired);
        pacing.spoiled(pulse(fired, us(16_653), longer));
        let free = fired + (us(33_333) + longer);
        assert_eq!(pacing.free, free, "no trigger while the camera is busy");
        for (start, spoiled) in [
            (fired - us(33_133), false),
            (fired, true),
            (fired + longer, true),
            // Triggered when the camera should have been free.
            (fired + us(33_333), true),
            (free - us(300), true),
            (free - us(100), false),
        ] {
            assert_eq!(pacing.spoiled_by(start).is_some(), spoiled, "{start}");
        }
    }

    #[test]
    fn pulses_that_do_not_decide_the_exposure_spoil_nothing() {
        let fired = Timestamp(1_000_000_000);
        for (starts, width) in [(Starts::ByItself, us(16_653)), (Starts::OnTrigger, us(100))] {
            let mut pacing = pacing(starts);
            pacing.spoiled(pulse(fired, width, us(5_000)));
            assert_eq!(pacing.spoiled_by(fired), None);
        }
    }
}
