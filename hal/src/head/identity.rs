//! Which pattern a frame shows: proved by when patterns were in view and when the frame was exposed.
//!
//! A pattern is in view from its flip plus the flip-to-light delay until the next flip plus that delay. A frame is a pattern's
//! if its whole exposure lies within that, widened by the tolerance. When the next flip has not come yet, the view lasts at
//! least until that flip was queued: no flip comes before it is asked for. What cannot be decided yet waits for the flip.

use std::collections::VecDeque;
use std::time::Duration;

use crate::projector::Flip;
use crate::units::Timestamp;

/// Views that are remembered. A frame that is older than all of them is stale.
const MAX_VIEWS: usize = 16;
/// A count of refreshes tells the time of the next flip only over so many: the nominal period is not exact.
const MAX_COUNTED: u64 = 8;

/// What a frame turned out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// Wholly exposed while this position of the sequence was in view, which came into view at that time.
    Of(usize, Timestamp),
    /// Exposed over a change of patterns.
    Straddles,
    /// Begun before the first pattern that is remembered.
    Stale,
    /// The flip that ends the view has been queued and has not come yet.
    Undecided,
}

/// A pattern in view. By time and by count its light may come at two different times; the truth lies between.
#[derive(Clone, Copy, Debug)]
struct View {
    position: usize,
    earliest: Timestamp,
    latest: Timestamp,
    flip: Flip,
}

/// The latest patterns in view, oldest first.
#[derive(Debug)]
pub(super) struct Views {
    views: VecDeque<View>,
    /// When the flip that has not come yet was queued.
    queued: Option<Timestamp>,
    flip_to_light: Duration,
    tolerance: Duration,
    refresh: Duration,
}

impl Views {
    pub fn new() -> Self {
        Self {
            views: VecDeque::with_capacity(MAX_VIEWS),
            queued: None,
            flip_to_light: Duration::ZERO,
            tolerance: Duration::ZERO,
            refresh: Duration::ZERO,
        }
    }

    /// Forgets all views; from now on this is how light follows flips.
    pub fn restart(&mut self, flip_to_light: Duration, tolerance: Duration, refresh: Duration) {
        self.views.clear();
        self.queued = None;
        (self.flip_to_light, self.tolerance, self.refresh) = (flip_to_light, tolerance, refresh);
    }

    /// A flip is queued now.
    pub fn queue(&mut self, now: Timestamp) {
        self.queued = Some(now);
    }

    /// The queued flip came and shows `position`. Answers how far its time is off what the count of refreshes says.
    pub fn flipped(&mut self, position: usize, flip: Flip) -> Duration {
        let queued = self.queued.take().unwrap_or(flip.timestamp);
        let known = self.counted(flip);
        let counted = known.unwrap_or(flip.timestamp);
        let off = flip
            .timestamp
            .since(counted)
            .max(counted.since(flip.timestamp));
        let (mut earliest, mut latest) = (flip.timestamp, flip.timestamp);
        if known.is_none() {
            // Nothing confirms the stamp, but no flip comes before it is queued.
            earliest = earliest.min(queued);
        } else if off > self.tolerance {
            // One of the two is wrong. Only what holds for both is proved.
            (earliest, latest) = (earliest.min(counted), latest.max(counted));
        }
        if self.views.len() == MAX_VIEWS {
            self.views.pop_front();
        }
        self.views.push_back(View {
            position,
            earliest: earliest + self.flip_to_light,
            latest: latest + self.flip_to_light,
            flip,
        });
        off
    }

    /// When the flip should have come by its count, told from the ones before. Stamps are taken at a flip or too late, so the
    /// one that says the earliest is believed: one right stamp among them is enough.
    fn counted(&self, flip: Flip) -> Option<Timestamp> {
        let told = |view: &View| {
            let steps = flip.sequence.saturating_sub(view.flip.sequence);
            // At most 8 periods.
            (steps <= MAX_COUNTED).then(|| view.flip.timestamp + self.refresh * steps as u32)
        };
        self.views.iter().filter_map(told).min()
    }

    /// What a frame exposed from `start` to `end` shows, as far as it is known `now`.
    pub fn identify(&self, start: Timestamp, end: Timestamp, now: Timestamp) -> Identity {
        // No flip that has not come yet can change what is in view before this.
        let open = self.queued.unwrap_or(now) + self.flip_to_light;
        let mut until = (open, false);
        for view in self.views.iter().rev() {
            if start + self.tolerance >= view.latest {
                return match until {
                    (until, _) if end <= until + self.tolerance => {
                        Identity::Of(view.position, view.latest)
                    }
                    (_, true) => Identity::Straddles,
                    (_, false) => Identity::Undecided,
                };
            }
            until = (view.earliest, true);
        }
        match until {
            // Before any flip: what ends after the first one could have come may be the first pattern's.
            (open, false) if end > open => Identity::Undecided,
            (_, false) => Identity::Stale,
            (first, true) if end > first => Identity::Straddles,
            (_, true) => Identity::Stale,
        }
    }
}
