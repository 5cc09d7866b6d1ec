//! Which pattern's light was in view when, and how much of it an exposure received.

use std::collections::VecDeque;
use std::time::Duration;

use crate::units::Timestamp;

/// Capacity for changes of light; more than are normally remembered.
const CAPACITY: usize = 64;

/// The changes of light, oldest first.
pub(super) struct LightHistory {
    changes: VecDeque<(Timestamp, Option<usize>)>,
    seen: Vec<(Option<usize>, f32)>,
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
    pub fn seen(
        &mut self,
        start: Timestamp,
        length: Duration,
        planned: Duration,
    ) -> &[(Option<usize>, f32)] {
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
                match self.seen.last_mut() {
                    Some((before, sum)) if before == pattern => *sum += share,
                    _ => self.seen.push((*pattern, share)),
                }
            }
        }
        if let [(_, share)] = self.seen.as_mut_slice() {
            *share = (length.as_nanos().max(1) as f64 / whole) as f32;
        }
        &self.seen
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
        let mut seen = |start, end| {
            let length = ns(end - start);
            light.seen(Timestamp(start), length, length).to_vec()
        };
        assert_eq!(seen(20, 90), [(None, 1.0)]);
        assert_eq!(seen(100, 200), [(Some(3), 1.0)]);
        assert_eq!(
            seen(50, 250),
            [(None, 0.25), (Some(3), 0.5), (Some(4), 0.25)]
        );
        assert_eq!(seen(210, 900), [(Some(4), 1.0)]);
        let mut longer = |start, length| light.seen(Timestamp(start), length, ns(80)).to_vec();
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
            [(Some(996), 1.0)]
        );
    }
}
