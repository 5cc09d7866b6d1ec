//! The pulses of the virtual trigger: how long each lasts, and what is told of those that last too long.

use std::collections::VecDeque;
use std::time::Duration;

use super::Mechanics;
use super::faults::{Dice, Kind};
use crate::trigger::{Edges, REMEMBERED, Spoiled};
use crate::units::Timestamp;

/// The line of the trigger. A pulse lasts as long as the exposure that it makes.
pub(super) struct Pulses {
    begun: u64,
    /// The end of the latest pulse that lasts too long. All others end before the camera takes the next one.
    on_until: Timestamp,
    /// Spoiled pulses that nobody has asked about, and when they end.
    spoiled: VecDeque<(Timestamp, Spoiled)>,
}

impl Pulses {
    pub fn new() -> Self {
        Self {
            begun: 0,
            on_until: Timestamp(0),
            spoiled: VecDeque::with_capacity(REMEMBERED),
        }
    }

    /// Begins a pulse and answers how long it will last; none if one is still on.
    pub fn begin(&mut self, now: Timestamp, mechanics: &Mechanics, dice: Dice) -> Option<Duration> {
        if now < self.on_until {
            return None;
        }
        self.begun += 1;
        let faults = &mechanics.faults;
        let longest = Duration::from_micros(faults.long_pulse_us);
        let longer = dice.up_to(Kind::LongPulse, self.begun, faults.long_pulse, longest);
        if longer.is_zero() {
            return Some(mechanics.exposure);
        }
        let end = now + (mechanics.exposure + longer);
        self.on_until = end;
        let edges = Edges {
            rise: (now, now),
            fall: (end, end),
        };
        if let Some(spoiled) = Spoiled::by(&edges, mechanics.exposure) {
            if self.spoiled.len() == REMEMBERED {
                self.spoiled.pop_front();
            }
            self.spoiled.push_back((end, spoiled));
        }
        Some(mechanics.exposure + longer)
    }

    /// The next spoiled pulse that has ended.
    pub fn poll(&mut self, now: Timestamp) -> Option<Spoiled> {
        let ended = |(end, _): &(Timestamp, Spoiled)| *end <= now;
        self.spoiled.front().is_some_and(ended).then_some(())?;
        self.spoiled.pop_front().map(|(_, spoiled)| spoiled)
    }
}
