//! The lines between a station and the machine that starts it by wire, as traits: start as input;
//! busy, ok and fault as outputs. [`Debounce`] says which edges of a start line are a start.

use std::os::fd::AsFd;
use std::time::Duration;

use crate::error::Error;
use crate::units::Timestamp;

/// A line that starts cycles. Its descriptor is readable as long as there are edges that were not
/// fetched.
pub trait StartLine: AsFd + Send {
    /// The start that has come since the last call, if any: the time since which the line is
    /// active. Does not wait.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn poll_start(&mut self) -> Result<Option<Timestamp>, Error>;

    /// When to call [`StartLine::poll_start`] again even if the descriptor is not readable: the
    /// line may have settled by then.
    fn settles(&self) -> Option<Timestamp>;
}

/// A line that shows a state of the station.
pub trait OutputLine: Send {
    /// Switches it on or off.
    ///
    /// # Errors
    /// `Disconnected` if the line's chip is gone.
    fn set(&mut self, on: bool) -> Result<(), Error>;
}

/// The state of a start line, from its edges.
///
/// A level counts when the line has kept it for the debounce time, so neither the bounces of a
/// contact nor the spike of a press's motor start a cycle. The kernel queues 16 edges and drops
/// further ones without notice. So the level after the last edge counts only if the line is read at
/// the same level when it has settled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Debounce {
    quiet: Duration,
    settled: bool,
    /// The last edge since the line settled, and the level after it.
    moved: Option<(Timestamp, bool)>,
}

impl Debounce {
    /// A line that is settled at `active`; a new level counts once the line has kept it for
    /// `quiet`.
    #[must_use]
    pub fn new(quiet: Duration, active: bool) -> Self {
        Self {
            quiet,
            settled: active,
            moved: None,
        }
    }

    /// An edge, after which the line was at `active`.
    pub fn edge(&mut self, at: Timestamp, active: bool) {
        self.moved = Some((at, active));
    }

    /// When the line will have settled if no further edge comes.
    #[must_use]
    pub fn due(&self) -> Option<Timestamp> {
        self.moved.map(|(at, _)| at + self.quiet)
    }

    /// The line was read at `active` at time `now`, after all its edges. Returns since when it is
    /// active, if that is a start.
    pub fn found(&mut self, now: Timestamp, active: bool) -> Option<Timestamp> {
        let (at, level) = self.moved?;
        if now < at + self.quiet {
            return None;
        }
        if level != active {
            // An edge was lost, at an unknown time: the line has to keep its level from now on.
            self.moved = Some((now, active));
            return None;
        }
        self.moved = None;
        let rose = active && !self.settled;
        self.settled = active;
        rose.then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: Duration = Duration::from_millis(5);

    fn ms(ms: u64) -> Timestamp {
        Timestamp(ms * 1_000_000)
    }

    /// The starts of a line with these edges (ms, level after the edge), read every millisecond.
    fn starts(edges: &[(u64, bool)]) -> Vec<u64> {
        let mut line = Debounce::new(QUIET, false);
        let mut found = Vec::new();
        let mut level = false;
        for now in 0..200 {
            for (at, active) in edges.iter().filter(|(at, _)| *at == now) {
                line.edge(ms(*at), *active);
                level = *active;
            }
            found.extend(line.found(ms(now), level).map(|at| at.0 / 1_000_000));
        }
        found
    }

    #[test]
    fn a_clean_press_is_one_start_at_its_edge() {
        assert_eq!(starts(&[(10, true), (60, false), (100, true)]), [10, 100]);
    }

    #[test]
    fn bounces_of_press_and_release_start_nothing_more() {
        let edges = [
            (10, true),
            (11, false),
            (12, true),
            (14, false),
            (15, true),
            (60, false),
            (62, true),
            (63, false),
        ];
        assert_eq!(starts(&edges), [15]);
    }

    #[test]
    fn a_spike_starts_nothing() {
        assert!(starts(&[(10, true), (12, false)]).is_empty());
    }

    #[test]
    fn edges_that_the_kernel_names_alike_are_still_edges() {
        // The kernel names each edge by the level that it read afterwards.
        assert_eq!(starts(&[(10, true), (13, true)]), [13]);
    }

    #[test]
    fn a_lost_edge_is_found_by_the_level_and_waited_for_again() {
        let mut line = Debounce::new(QUIET, false);
        line.edge(ms(10), false);
        assert_eq!(line.found(ms(15), true), None);
        assert_eq!(line.due(), Some(ms(20)));
        assert_eq!(line.found(ms(20), true), Some(ms(15)));
        assert_eq!(line.due(), None);
    }

    #[test]
    fn a_line_that_is_active_from_the_first_has_not_started_anything() {
        let mut line = Debounce::new(QUIET, true);
        line.edge(ms(10), true);
        assert_eq!(line.found(ms(30), true), None);
    }

    #[test]
    fn without_a_quiet_time_an_edge_counts_at_once() {
        let mut line = Debounce::new(Duration::ZERO, false);
        line.edge(ms(10), true);
        assert_eq!(line.found(ms(10), true), Some(ms(10)));
    }
}
