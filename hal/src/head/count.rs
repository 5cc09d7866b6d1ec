//! The camera's count of frames: a gap means lost frames, a repeated count means the same frame.

/// How far below the newest count a count is remembered.
const REMEMBERED: u64 = 64;

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
            self.seen = if ahead < REMEMBERED {
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
        if behind >= REMEMBERED || self.seen >> behind & 1 == 1 {
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
