//! The times of a head: those that are measured ([`Timing`]), and when to flip and when to trigger,
//! planned from the refresh, the flip-to-light delay and the timing of the camera.
//!
//! The next pattern's light may come when the exposure of the pattern in view ends. With the
//! flip-to-light delay L and refreshes of period r after the flip at T, an exposure that ends at E
//! allows the flip at T + m r, where m is the smallest whole number with T + m r + L ≥ E (within
//! the tolerance). So the flip is often queued while this pattern's frame is still being exposed or
//! read out, and with a delay longer than an exposure even before the trigger fires. These plans do
//! not decide which pattern a frame shows (`identity` does): a plan that fails costs a retake.

use std::time::Duration;

use crate::camera::{CameraTiming, Starts};
use crate::projector::Flip;
use crate::trigger::{REMEMBERED, Spoiled, SpoiledPulses, keep_latest};
use crate::units::Timestamp;

/// Default of [`Timing::tolerance`]: an exposure of exactly one refresh leaves no slack for jitter
/// otherwise.
pub const TOLERANCE: Duration = Duration::from_micros(200);
/// Refreshes per pattern where a trigger or the projector starts the exposures and nothing is
/// measured yet. After an exposure of one refresh (16.667 ms at 60 Hz) an IMX296 is read out for 1118
/// lines of 14.8148 µs (16.563 ms): of two refreshes 0.1 ms would be left for its own delays.
const TRIGGERED_HOLD: u32 = 3;
/// Refreshes per pattern where the camera runs by itself: an exposure of one whole refresh fits two
/// from wherever it starts.
const OWN_HOLD: u32 = 2;

/// The moment that a camera's stamp marks. It depends on the driver, so it is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stamp {
    /// The start of the exposure.
    #[default]
    ExposureStart,
    /// The end of the exposure.
    ExposureEnd,
    /// The end of the readout.
    ReadoutEnd,
}

/// Measured times of a head, from which follows what was in view when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From the time of a flip to the light of its pattern.
    pub flip_to_light: Duration,
    /// What the camera's stamps mark.
    pub stamp: Stamp,
    /// From the moment that a stamp marks to the stamp itself: a driver that stamps in an interrupt
    /// is late by a constant time.
    pub stamp_late: Duration,
    /// From the end of an exposure to the end of its readout; used only where stamps mark the end
    /// of the readout.
    pub readout: Duration,
    /// How far an exposure may reach beyond its pattern's time in view, at each end.
    pub tolerance: Duration,
    /// Refreshes that each pattern stays in view, at least. A camera that is triggered once in so
    /// many refreshes must lose no trigger.
    pub hold: u32,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            flip_to_light: Duration::ZERO,
            stamp: Stamp::default(),
            stamp_late: Duration::ZERO,
            readout: Duration::ZERO,
            tolerance: TOLERANCE,
            hold: 1,
        }
    }
}

impl Timing {
    /// The times of a real head that is not calibrated.
    #[must_use]
    pub fn unproven(starts: Starts) -> Self {
        Self {
            hold: match starts {
                Starts::OnTrigger | Starts::ByProjector => TRIGGERED_HOLD,
                Starts::ByItself => OWN_HOLD,
            },
            ..Self::default()
        }
    }

    /// The start of an exposure of `camera` with this stamp.
    #[must_use]
    pub fn exposure_start(&self, camera: &CameraTiming, stamp: Timestamp) -> Timestamp {
        let marked = stamp - self.stamp_late;
        match self.stamp {
            Stamp::ExposureStart => marked,
            Stamp::ExposureEnd => marked - camera.exposure,
            Stamp::ReadoutEnd => marked - (camera.exposure + self.readout),
        }
    }

    /// The tolerance for exposures of this length: at most a quarter of it, so that no exposure
    /// fits two patterns.
    fn tolerance_for(&self, exposure: Duration) -> Duration {
        self.tolerance.min(exposure / 4)
    }
}

/// One attempt to take the frame of a position: its pattern is shown and the camera triggered once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attempt {
    pub position: usize,
    pub flip: Flip,
    /// When its light comes into view.
    pub light: Timestamp,
    /// When its trigger fired.
    pub fired: Option<Timestamp>,
    /// Its frame has arrived or is no longer expected.
    pub done: bool,
}

impl Attempt {
    pub fn waits_for_trigger(&self) -> bool {
        !self.done && self.fired.is_none()
    }
}

/// The times of a head, and what is known of its camera so far.
#[derive(Debug, Default)]
pub(super) struct Pacing {
    pub refresh: Duration,
    pub flip_to_light: Duration,
    pub tolerance: Duration,
    pub exposure: Duration,
    hold: u32,
    period: Duration,
    delivery: Duration,
    triggered: bool,
    /// When a triggered camera can start its next exposure.
    free: Timestamp,
    /// The latest triggers, and how many there were in all.
    triggers: heapless::Deque<Timestamp, REMEMBERED>,
    count: usize,
    spoiled: SpoiledPulses,
    /// The longest time from a trigger to the start of its exposure.
    promptness: Duration,
    /// The start of the latest exposure of a camera that runs by itself.
    phase: Option<Timestamp>,
}

impl Pacing {
    pub fn new(refresh: Duration, camera: &CameraTiming, timing: &Timing) -> Self {
        let refresh = refresh.max(Duration::from_nanos(1));
        let period = match camera.starts {
            // The exposure starts with the first refresh for which the camera is ready.
            Starts::ByProjector => {
                let refreshes = camera.period.as_nanos().div_ceil(refresh.as_nanos());
                refresh.saturating_mul(u32::try_from(refreshes).unwrap_or(u32::MAX))
            }
            Starts::OnTrigger | Starts::ByItself => camera.period,
        };
        Self {
            refresh,
            flip_to_light: timing.flip_to_light,
            tolerance: timing.tolerance_for(camera.exposure),
            exposure: camera.exposure,
            hold: timing.hold.max(1),
            period: period.max(Duration::from_nanos(1)),
            delivery: camera.delivery,
            triggered: camera.starts == Starts::OnTrigger,
            promptness: timing.tolerance,
            ..Self::default()
        }
    }

    /// The longest time that a sequence of so many patterns takes when nothing goes wrong.
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

    /// The part of the tolerance that a plan may use. The rest is left for a trigger that fires a
    /// little late, and for the jitter of a camera that runs by itself.
    fn slack(&self) -> Duration {
        self.tolerance / 2
    }

    pub fn fired(&mut self, at: Timestamp) {
        self.free = at + self.period;
        keep_latest(&mut self.triggers, at);
        self.count += 1;
    }

    /// Triggers so far.
    pub fn triggers(&self) -> usize {
        self.count
    }

    /// Whether a trigger explains an exposure that started at `start`, with `before` exposures
    /// before it in this sequence: a triggered camera starts an exposure at a trigger, and each
    /// exposure needs a trigger of its own. Otherwise its stamp is wrong.
    pub fn explains(&self, start: Timestamp, before: u64) -> bool {
        let oldest = self.count - self.triggers.len();
        let prompt = |at: Timestamp| start.off(at) <= self.promptness;
        !self.triggered
            || (oldest as u64..)
                .zip(&self.triggers)
                .any(|(index, at)| index >= before && prompt(*at))
    }

    /// A pulse was too long or too short. This matters to a camera that exposes for as long as its
    /// pulses last.
    pub fn spoiled(&mut self, pulse: Spoiled) {
        if !self.triggered || !pulse.decides(self.exposure) {
            return;
        }
        // The camera is busy for that much longer.
        self.free = self.free.max(pulse.fired + (pulse.longer + self.period));
        keep_latest(&mut self.spoiled, pulse);
    }

    /// The pulse that spoiled an exposure which started at `start` by its stamp, if one did.
    pub fn spoiled_by(&self, start: Timestamp) -> Option<Spoiled> {
        let mut known = self.spoiled.iter();
        known.find(|pulse| self.spoils(pulse, start)).copied()
    }

    /// Whether this pulse spoiled an exposure which started at `start` by its stamp: its own
    /// exposure, whose stamp may mark the end and then is off by as much as the pulse; or the next
    /// one, if it was triggered while the camera was busy for longer than planned.
    pub fn spoils(&self, pulse: &Spoiled, start: Timestamp) -> bool {
        let from = pulse.fired - (pulse.shorter + self.promptness);
        let busy = self.period.saturating_sub(self.promptness);
        let until = pulse.fired + (pulse.longer + busy.max(self.promptness));
        (from..=until).contains(&start)
    }

    pub fn exposed(&mut self, start: Timestamp) {
        self.phase = self.phase.max(Some(start));
    }

    /// When the trigger of this attempt is due, provided that all earlier ones have fired; none for
    /// a camera that runs by itself.
    pub fn trigger(&self, attempt: &Attempt) -> Option<Timestamp> {
        self.triggered.then(|| attempt.light.max(self.free))
    }

    /// When the exposure of this attempt starts, as far as that is known.
    pub fn expected(&self, attempt: &Attempt) -> Option<Timestamp> {
        if self.triggered {
            return attempt.fired;
        }
        self.phase
            .map(|phase| self.next_exposure(phase, attempt.light - self.slack()))
    }

    /// When a camera that runs by itself starts its first exposure at `from` or later.
    fn next_exposure(&self, phase: Timestamp, from: Timestamp) -> Timestamp {
        // Nanoseconds of u64 fit i128 with room for their sums.
        let period = i128::try_from(self.period.as_nanos()).unwrap_or(i128::MAX);
        let ahead = i128::from(from.0) - i128::from(phase.0);
        let periods = ahead.div_euclid(period) + i128::from(ahead.rem_euclid(period) != 0);
        let at = i128::from(phase.0) + periods * period;
        Timestamp(u64::try_from(at.max(0)).unwrap_or(u64::MAX))
    }

    /// When this attempt is given up; none if that is not known yet or it is done.
    pub fn overdue(&self, attempt: &Attempt) -> Option<Timestamp> {
        if attempt.done {
            return None;
        }
        // One and a half periods more, as its frame may arrive after the next one.
        let patience = self.exposure + self.delivery + self.period * 3 / 2 + self.tolerance;
        match self.expected(attempt) {
            Some(start) => Some(start + patience),
            None if self.triggered => None,
            None => Some(attempt.light + (self.period + patience)),
        }
    }

    /// When to queue the flip after `last`, and the count of the refresh with which it should
    /// happen; none while that cannot be planned.
    pub fn next_flip<'a>(
        &self,
        attempts: impl Iterator<Item = &'a Attempt>,
        last: &Attempt,
        now: Timestamp,
    ) -> Option<(Timestamp, u64)> {
        let refreshes = if last.done {
            1
        } else {
            let start = self.planned_start(attempts, last, now)?;
            let light_until = self.end(start) - self.slack();
            let shown = light_until.since(last.light).as_nanos();
            u64::try_from(shown.div_ceil(self.refresh.as_nanos())).unwrap_or(u64::MAX)
        };
        let refreshes = refreshes.max(u64::from(self.hold)).max(1);
        let before = u32::try_from(refreshes - 1).unwrap_or(u32::MAX);
        let mut due = last.flip.timestamp + self.refresh.saturating_mul(before);
        if before > 0 {
            // Not before the refresh that precedes this flip, whatever the jitter of its stamp.
            due = due + self.refresh / 8;
        }
        // If it is queued late, it happens with the next refresh after now.
        let passed = now.since(last.flip.timestamp).as_nanos() / self.refresh.as_nanos();
        let comes = refreshes.max(u64::try_from(passed).unwrap_or(u64::MAX).saturating_add(1));
        Some((due, last.flip.count.saturating_add(comes)))
    }

    /// When the exposure of the last attempt will start according to plan.
    fn planned_start<'a>(
        &self,
        attempts: impl Iterator<Item = &'a Attempt>,
        last: &Attempt,
        now: Timestamp,
    ) -> Option<Timestamp> {
        if !self.triggered || last.fired.is_some() {
            return self.expected(last);
        }
        let mut free = self.free.max(now);
        let mut start = free;
        for attempt in attempts.filter(|attempt| attempt.waits_for_trigger()) {
            start = attempt.light.max(free);
            free = start + self.period;
        }
        Some(start)
    }

    /// The first refresh after `now`, counted from this attempt's flip.
    pub fn next_refresh(&self, attempt: &Attempt, now: Timestamp) -> Timestamp {
        let passed = now.since(attempt.flip.timestamp).as_nanos() / self.refresh.as_nanos();
        let refreshes = u32::try_from(passed + 1).unwrap_or(u32::MAX);
        attempt.flip.timestamp + self.refresh.saturating_mul(refreshes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    /// The reference head: a camera that exposes for 16 667 µs and is then read out.
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
