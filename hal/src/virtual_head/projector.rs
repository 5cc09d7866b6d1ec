//! The virtual projector: flips happen with its refreshes; their reports and their light follow
//! with delays. Its light is remembered, so that an exposure gets the pattern of each moment.

use std::collections::VecDeque;
use std::time::Duration;

use super::mechanics::Mishap;
use super::{Bench, InView, Scene, VirtualDevice, lock};
use crate::error::{DeviceKind, Error};
use crate::projector::{Flip, Projector, Raster, all_kept, all_of_size};
use crate::units::Timestamp;

/// Capacity for changes of light; more than are normally remembered.
const CAPACITY: usize = 64;
const DEVICE: DeviceKind = DeviceKind::Projector;

/// The changes of light, oldest first.
pub(super) struct LightHistory {
    /// When a pattern came into view, or none.
    changes: VecDeque<(Timestamp, Option<usize>)>,
    seen: Vec<InView>,
}

impl LightHistory {
    pub fn new() -> Self {
        let mut changes = VecDeque::with_capacity(CAPACITY);
        changes.push_back((Timestamp(0), None));
        Self {
            changes,
            seen: Vec::with_capacity(CAPACITY),
        }
    }

    /// From `at` on, `pattern` is in view. Later changes are removed, and those that no exposure
    /// since `needed` can receive.
    pub fn change(&mut self, at: Timestamp, pattern: Option<usize>, needed: Timestamp) {
        while self.changes.len() > 1 && self.changes[1].0 <= needed {
            self.changes.pop_front();
        }
        while self.changes.len() > 1 && self.changes.back().is_some_and(|last| last.0 >= at) {
            self.changes.pop_back();
        }
        self.changes.push_back((at, pattern));
    }

    /// The patterns that were in view for `length` from `start` on, in order, each with its time as
    /// a share of `planned`.
    pub fn seen(&mut self, start: Timestamp, length: Duration, planned: Duration) -> &[InView] {
        self.seen.clear();
        let end = start + length;
        let whole = planned.as_nanos().max(1) as f64;
        let last = self.changes.len() - 1;
        for (at, (from, pattern)) in self.changes.iter().enumerate() {
            // The first state has no beginning, the last no end.
            let from = if at == 0 { start } else { (*from).max(start) };
            let until = if at == last {
                end
            } else {
                self.changes[at + 1].0.min(end)
            };
            let share = (until.since(from).as_nanos() as f64 / whole) as f32;
            if share > 0.0 {
                let pattern = *pattern;
                match self.seen.last_mut() {
                    Some(before) if before.pattern == pattern => before.share += share,
                    _ => self.seen.push(InView { pattern, share }),
                }
            }
        }
        if let [alone] = self.seen.as_mut_slice() {
            alone.share = (length.as_nanos().max(1) as f64 / whole) as f32;
        }
        &self.seen
    }
}

/// The state of the projector's flips.
#[derive(Default)]
pub(super) struct Screen {
    waiting: Option<Waiting>,
    flips: u64,
}

/// A flip that has not been reported.
#[derive(Clone, Copy)]
struct Waiting {
    flip: Flip,
    /// When it can be fetched; none if it never happens.
    news: Option<Timestamp>,
}

impl Screen {
    /// When the next flip can be fetched.
    pub fn next(&self) -> Option<Timestamp> {
        self.waiting.and_then(|waiting| waiting.news)
    }
}

impl<S: Scene> Bench<S> {
    /// Shows nothing from now on.
    pub(super) fn blank(&mut self) {
        self.screen.waiting = None;
        self.light.change(self.now, None, self.now);
    }

    /// Queues a pattern: computes the flip with which it will be shown, and its light.
    fn flip(&mut self, index: usize) {
        let (faults, dice) = (&self.mechanics.faults, self.dice);
        self.screen.flips += 1;
        let n = self.screen.flips;
        if faults.flips_until_stuck > 0 && n > faults.flips_until_stuck {
            let flip = Flip {
                timestamp: self.now,
                count: 0,
            };
            self.screen.waiting = Some(Waiting { flip, news: None });
            return;
        }
        let period = u64::try_from(self.mechanics.refresh.as_nanos())
            .unwrap_or(u64::MAX)
            .max(1);
        let mut count = self.now.0 / period + 1;
        if dice.happens(Mishap::LateFlip, n, faults.late_flip) {
            let more = dice.up_to(
                Mishap::LateFlip,
                n ^ 1 << 40,
                1.0,
                Duration::from_nanos(1 << 20),
            );
            count += 1 + ((more.as_nanos() as u64 * u64::from(faults.late_refreshes)) >> 20);
        }
        let at = Timestamp(count.saturating_mul(period));
        let news = dice.up_to(
            Mishap::LateNews,
            n,
            faults.late_news,
            Duration::from_micros(faults.late_news_us),
        );
        let jitter = Duration::from_micros(faults.flip_jitter_us);
        let mut timestamp = at + dice.up_to(Mishap::FlipJitter, n, 1.0, 2 * jitter) - jitter;
        let wrong = |n| dice.happens(Mishap::WrongStamp, n, faults.wrong_stamp);
        if wrong(n) && !wrong(n - 1) {
            timestamp = timestamp + self.mechanics.refresh;
        }
        self.screen.waiting = Some(Waiting {
            flip: Flip { timestamp, count },
            news: Some(at + news),
        });
        let needed = self.sensor.oldest(self.now, &self.mechanics);
        let lit = (at + self.mechanics.flip_to_light).max(self.first_light);
        self.light.change(lit, Some(index), needed);
    }
}

impl<S: Scene> Projector for VirtualDevice<S> {
    fn size(&self) -> (u32, u32) {
        lock(&self.bench).scene.projector_size()
    }

    fn refresh(&self) -> Duration {
        lock(&self.bench).mechanics.refresh
    }

    fn present(&self) -> Result<(), Error> {
        self.plugged(DEVICE, "looking for the projector")
            .map(|_| ())
    }

    fn starts_dark(&self) -> bool {
        !lock(&self.bench).mechanics.first_light.is_zero()
    }

    fn load_behind(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        let mut bench = self.plugged(DEVICE, "loading patterns")?;
        all_of_size(&rasters, bench.scene.projector_size())?;
        all_kept(kept, bench.scene.loaded())?;
        bench.blank();
        bench.scene.load(kept, rasters)
    }

    fn queue(&mut self, index: usize) -> Result<(), Error> {
        let mut bench = self.plugged(DEVICE, "showing a pattern")?;
        let loaded = bench.scene.loaded();
        if index >= loaded {
            return Err(Error::protocol(
                format!("showing pattern {index} of {loaded} loaded (counted from 0)"),
                "load the patterns first",
            ));
        }
        if bench.screen.waiting.is_some() {
            return Err(Error::protocol(
                format!("showing pattern {index} while another one waits for its refresh"),
                "fetch its flip first",
            ));
        }
        bench.flip(index);
        Ok(())
    }

    fn poll_flip(&mut self) -> Result<Option<Flip>, Error> {
        let mut bench = self.plugged(DEVICE, "waiting for a flip")?;
        let now = bench.now;
        let came = bench.screen.next().is_some_and(|news| news <= now);
        Ok(if came {
            bench.screen.waiting.take().map(|waiting| waiting.flip)
        } else {
            None
        })
    }

    fn blank(&mut self) -> Result<(), Error> {
        self.plugged(DEVICE, "blanking the projector")?.blank();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_sees_each_pattern_for_its_share_of_the_planned_time_and_one_alone_for_all() {
        let mut light = LightHistory::new();
        light.change(Timestamp(100), Some(3), Timestamp(0));
        light.change(Timestamp(200), Some(4), Timestamp(0));
        light.change(Timestamp(300), Some(4), Timestamp(0));
        let ns = Duration::from_nanos;
        let pair = |seen: &InView| (seen.pattern, seen.share);
        let mut seen = |start, end| {
            let length = ns(end - start);
            light
                .seen(Timestamp(start), length, length)
                .iter()
                .map(pair)
                .collect::<Vec<_>>()
        };
        assert_eq!(seen(20, 90), [(None, 1.0)]);
        assert_eq!(seen(100, 200), [(Some(3), 1.0)]);
        assert_eq!(
            seen(50, 250),
            [(None, 0.25), (Some(3), 0.5), (Some(4), 0.25)]
        );
        assert_eq!(seen(210, 900), [(Some(4), 1.0)]);
        let mut longer = |start, length| {
            light
                .seen(Timestamp(start), length, ns(80))
                .iter()
                .map(pair)
                .collect::<Vec<_>>()
        };
        assert_eq!(longer(210, ns(100)), [(Some(4), 1.25)]);
        assert_eq!(longer(120, ns(100)), [(Some(3), 1.0), (Some(4), 0.25)]);
    }

    #[test]
    fn what_no_exposure_can_see_any_more_is_forgotten() {
        let mut light = LightHistory::new();
        for at in 1..1000 {
            light.change(
                Timestamp(100 * at),
                Some(at as usize),
                Timestamp((100 * at).saturating_sub(350)),
            );
        }
        assert!(light.changes.len() < 8, "{}", light.changes.len());
        assert_eq!(
            light.seen(
                Timestamp(99_650),
                Duration::from_nanos(10),
                Duration::from_nanos(10)
            ),
            [InView {
                pattern: Some(996),
                share: 1.0
            }]
        );
    }
}
