//! When the geometry is to be checked between two cycles.

/// Signs of life without an order before the first attempt: a second.
const SHORTEST: u32 = 10;
/// Signs of life without an order before an attempt, at most, after orders have ended attempts:
/// about a minute.
const LONGEST: u32 = 640;

/// Counts cycles and signs of life. An attempt that an order ended is made again after twice the
/// rest, so that a line with short pauses is not lit in each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// Cycles between two checks; 0 = there are none.
    every: u32,
    cycles: u32,
    /// Signs of life since the last order.
    rested: u32,
    /// How many signs of life there must be before an attempt.
    pause: u32,
}

impl Due {
    /// A check after so many cycles; 0 = never.
    pub fn every(cycles: u32) -> Self {
        Self {
            every: cycles,
            cycles: 0,
            rested: 0,
            pause: SHORTEST,
        }
    }

    /// Whether there are checks at all.
    pub fn is_on(&self) -> bool {
        self.every > 0
    }

    /// A part was measured.
    pub fn cycle(&mut self) {
        self.cycles = self.cycles.saturating_add(1);
    }

    /// A part was measured that a head out of adjustment would explain: the check need not wait for
    /// more cycles.
    pub fn suspect(&mut self) {
        self.cycles = self.cycles.max(self.every);
    }

    /// There was an order.
    pub fn disturbed(&mut self) {
        self.rested = 0;
    }

    /// A sign of life without an order. Answers whether to check now; a doubtful result is checked
    /// again without more cycles.
    pub fn rests(&mut self, doubtful: bool) -> bool {
        self.rested = self.rested.saturating_add(1);
        self.is_on() && (doubtful || self.cycles >= self.every) && self.rested >= self.pause
    }

    /// The frames of a check were taken; `doubtful` as before.
    pub fn done(&mut self, doubtful: bool) {
        self.cycles = 0;
        match doubtful {
            // The part may be gone, so that the doubt stays.
            true => self.ended(),
            false => (self.rested, self.pause) = (0, SHORTEST),
        }
    }

    /// An order ended the check.
    pub fn ended(&mut self) {
        self.rested = 0;
        self.pause = (2 * self.pause).min(LONGEST);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signs of life until a check is due; none within an hour.
    fn rest(due: &mut Due, doubtful: bool) -> Option<u32> {
        (1..36_000).find(|_| due.rests(doubtful))
    }

    #[test]
    fn a_check_is_due_after_its_cycles_and_a_second_without_an_order() {
        let mut due = Due::every(3);
        assert_eq!(rest(&mut due, false), None);
        for _ in 0..2 {
            due.cycle();
            assert!(!due.rests(false));
        }
        due.cycle();
        due.disturbed();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
        due.done(false);
        assert_eq!(rest(&mut due, false), None);
        let mut never = Due::every(0);
        never.cycle();
        assert_eq!(
            (rest(&mut never, false), rest(&mut never, true)),
            (None, None)
        );
    }

    #[test]
    fn a_check_that_orders_end_waits_for_longer_and_longer_rests() {
        let mut due = Due::every(1);
        due.cycle();
        let mut rests = Vec::new();
        for _ in 0..8 {
            rests.push(rest(&mut due, false).unwrap());
            due.ended();
        }
        assert_eq!(rests, [10, 20, 40, 80, 160, 320, 640, 640]);
        due.done(false);
        due.cycle();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
    }

    #[test]
    fn a_suspicion_is_checked_without_more_cycles() {
        let mut due = Due::every(100);
        due.suspect();
        assert_eq!(rest(&mut due, false), Some(SHORTEST));
        let mut never = Due::every(0);
        never.suspect();
        assert_eq!(rest(&mut never, false), None);
    }

    #[test]
    fn a_doubtful_result_is_checked_again_without_more_cycles_but_not_all_the_time() {
        let mut due = Due::every(100);
        assert_eq!(rest(&mut due, true), Some(SHORTEST));
        due.done(true);
        assert_eq!(rest(&mut due, true), Some(2 * SHORTEST));
    }
}
