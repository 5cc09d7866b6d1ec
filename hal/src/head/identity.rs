//! Whether a frame is new, by the camera's count, and which pattern it shows, by when patterns were in
//! view and when the frame was exposed.
//!
//! A gap in the count means lost frames, a repeated count means the same frame.
//!
//! A pattern is in view from its flip plus the flip-to-light delay until the next flip plus that
//! delay. A frame shows a pattern if its whole exposure lies within that time, widened by the
//! tolerance. Before the next flip has been reported, the view lasts at least until that flip was
//! queued, because no flip happens before it is queued. A frame that cannot be decided yet waits
//! for the flip.

use std::time::Duration;

use super::pacing::Pacing;
use crate::projector::Flip;
use crate::trigger::keep_latest;
use crate::units::Timestamp;

/// How far below the newest count a count is remembered, frames.
const REMEMBERED_COUNTS: u64 = 64;
/// Views that are remembered. A frame older than all of them is stale.
const MAX_VIEWS: usize = 16;
/// Over how many refreshes the time of a flip is computed from its count: the nominal period is not
/// exact.
const MAX_COUNTED: u64 = 8;

/// Which counts of a camera have arrived.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameCount {
    newest: Option<u64>,
    lowest: u64,
    /// Bit n: newest − n has been seen.
    seen: u64,
    missing: u32,
}

impl FrameCount {
    /// Records a frame's count and returns whether it is new.
    pub fn see(&mut self, count: u64) -> bool {
        let Some(newest) = self.newest else {
            (self.newest, self.lowest, self.seen) = (Some(count), count, 1);
            return true;
        };
        if count > newest {
            let ahead = count - newest;
            self.seen = if ahead < REMEMBERED_COUNTS {
                self.seen << ahead | 1
            } else {
                1
            };
            self.newest = Some(count);
            let gap = u32::try_from(ahead - 1).unwrap_or(u32::MAX);
            self.missing = self.missing.saturating_add(gap);
            return true;
        }
        let behind = newest - count;
        if behind >= REMEMBERED_COUNTS || self.seen >> behind & 1 == 1 {
            return false;
        }
        self.seen |= 1 << behind;
        self.lowest = self.lowest.min(count);
        self.missing = self.missing.saturating_sub(1);
        true
    }

    /// Frames that have not arrived, by the gaps in the count.
    pub fn missing(&self) -> u32 {
        self.missing
    }

    /// How many frames were exposed before the one with this count, from the lowest count that
    /// arrived on.
    pub fn before(&self, count: u64) -> u64 {
        count.saturating_sub(self.lowest)
    }

    /// Whether any frame has arrived.
    pub fn any(&self) -> bool {
        self.newest.is_some()
    }
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// Exposed while only the pattern of this position was in view; the time is when it came into
    /// view.
    Of(usize, Timestamp),
    /// Exposed during a change of patterns.
    Straddles,
    /// Begun before the first pattern that is remembered.
    Stale,
    /// The flip that ends the view has been queued but not yet reported.
    Undecided,
}

/// A pattern in view. The time of its light by the flip's stamp and that by the flip's count may
/// differ; the truth lies between.
#[derive(Clone, Copy, Debug)]
struct View {
    position: usize,
    earliest: Timestamp,
    latest: Timestamp,
    flip: Flip,
}

/// The latest patterns in view, oldest first.
#[derive(Debug, Default)]
pub(super) struct Views {
    views: heapless::Deque<View, MAX_VIEWS>,
    /// When the flip that was not yet reported was queued.
    queued: Option<Timestamp>,
    flip_to_light: Duration,
    tolerance: Duration,
    refresh: Duration,
}

impl Views {
    /// No views yet, of a head with these times.
    pub fn new(pacing: &Pacing) -> Self {
        Self {
            flip_to_light: pacing.flip_to_light,
            tolerance: pacing.tolerance,
            refresh: pacing.refresh,
            ..Self::default()
        }
    }

    /// A flip is queued now.
    pub fn queue(&mut self, now: Timestamp) {
        self.queued = Some(now);
    }

    /// The queued flip happened and shows `position`. Returns the difference of its stamp from its
    /// time by the count of refreshes.
    pub fn flipped(&mut self, position: usize, flip: Flip) -> Duration {
        let queued = self.queued.take().unwrap_or(flip.timestamp);
        let known = self.counted(flip);
        let counted = known.unwrap_or(flip.timestamp);
        let off = flip.timestamp.off(counted);
        let (mut earliest, mut latest) = (flip.timestamp, flip.timestamp);
        if known.is_none() {
            // Nothing confirms the stamp, but no flip happens before it is queued.
            earliest = earliest.min(queued);
        } else if off > self.tolerance {
            // Stamp or count is wrong. Only what holds for both is certain.
            (earliest, latest) = (earliest.min(counted), latest.max(counted));
        }
        let view = View {
            position,
            earliest: earliest + self.flip_to_light,
            latest: latest + self.flip_to_light,
            flip,
        };
        keep_latest(&mut self.views, view);
        off
    }

    /// The time of a flip by its count, from the stamps of the flips before it. A stamp is taken at
    /// its flip or too late, never too early, so the earliest time that follows from any of them is
    /// used: one correct stamp is enough.
    fn counted(&self, flip: Flip) -> Option<Timestamp> {
        let expected = |view: &View| {
            let refreshes = flip.count.saturating_sub(view.flip.count);
            // At most 8, so the cast loses nothing.
            (refreshes <= MAX_COUNTED)
                .then(|| view.flip.timestamp + self.refresh * refreshes as u32)
        };
        self.views.iter().filter_map(expected).min()
    }

    /// What a frame exposed from `start` to `end` shows, as far as is known at `now`.
    pub fn identify(&self, start: Timestamp, end: Timestamp, now: Timestamp) -> Identity {
        // The flip that was not yet reported cannot change what is in view before this.
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
            // Before any flip was reported: a frame that ends after the first light is possible may
            // show the first pattern.
            (open, false) if end > open => Identity::Undecided,
            (_, false) => Identity::Stale,
            (first, true) if end > first => Identity::Straddles,
            (_, true) => Identity::Stale,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FrameCount;

    #[test]
    fn a_frame_is_new_once_however_its_count_comes() {
        let mut count = FrameCount::default();
        let new: Vec<bool> = [7, 9, 8, 8, 9, 6, 300, 299, 100, 300]
            .map(|n| count.see(n))
            .into();
        assert_eq!(
            new,
            [
                true, true, true, false, false, true, true, true, false, false
            ]
        );
    }

    #[test]
    fn gaps_are_missing_until_their_frames_come_after_all() {
        let mut count = FrameCount::default();
        let missing: Vec<u32> = [3, 4, 7, 6, 10]
            .map(|n| (count.see(n), count.missing()).1)
            .into();
        assert_eq!(missing, [0, 0, 2, 1, 3]);
    }
}
