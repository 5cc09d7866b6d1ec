//! The virtual projector: flips happen with its refreshes; their reports and their light follow
//! with delays.

use std::time::Duration;

use super::faults::Kind;
use super::{Bench, Scene, VirtualDevice, lock};
use crate::error::{DeviceKind, Error};
use crate::projector::{Flip, Projector, Raster, all_kept, all_of_size};
use crate::units::Timestamp;

const DEVICE: DeviceKind = DeviceKind::Projector;

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
        if dice.happens(Kind::LateFlip, n, faults.late_flip) {
            let more = dice.up_to(
                Kind::LateFlip,
                n ^ 1 << 40,
                1.0,
                Duration::from_nanos(1 << 20),
            );
            count += 1 + ((more.as_nanos() as u64 * u64::from(faults.late_refreshes)) >> 20);
        }
        let at = Timestamp(count.saturating_mul(period));
        let news = dice.up_to(
            Kind::LateNews,
            n,
            faults.late_news,
            Duration::from_micros(faults.late_news_us),
        );
        let jitter = Duration::from_micros(faults.flip_jitter_us);
        let mut timestamp = at + dice.up_to(Kind::FlipJitter, n, 1.0, 2 * jitter) - jitter;
        let wrong = |n| dice.happens(Kind::WrongStamp, n, faults.wrong_stamp);
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
