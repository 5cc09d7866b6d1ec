//! The camera's count of frames: gaps are lost frames, a count that comes again is the same frame.

/// Counts below the newest that are remembered.
const REMEMBERED: u64 = 64;

/// What has been seen of a camera's count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameCount {
    newest: Option<u64>,
    lowest: u64,
    /// Bit n: newest − n has been seen.
    seen: u64,
    missing: u32,
}

impl FrameCount {
    /// Takes a frame's count; whether it is a frame that was not seen before.
    pub fn see(&mut self, count: u64) -> bool {
        let Some(newest) = self.newest else {
            (self.newest, self.lowest, self.seen) = (Some(count), count, 1);
            return true;
        };
        if count > newest {
            let step = count - newest;
            self.seen = if step < REMEMBERED {
                self.seen << step | 1
            } else {
                1
            };
            self.newest = Some(count);
            let gap = u32::try_from(step - 1).unwrap_or(u32::MAX);
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

    /// Frames that have not come, by the gaps.
    pub fn missing(&self) -> u32 {
        self.missing
    }

    /// How many frames are known to have been exposed before the one of this count, since the first that came.
    pub fn before(&self, count: u64) -> u64 {
        count.saturating_sub(self.lowest)
    }

    /// Whether any frame has come.
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
