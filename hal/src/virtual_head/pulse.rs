//! The pulses of the virtual trigger: how long each lasts, and reports of those that last too long.

use std::time::Duration;

use super::Mechanics;
use super::faults::{Dice, Kind};
use crate::latest;
use crate::trigger::{Edges, Spoiled, SpoiledPulses};
use crate::units::Timestamp;

/// The line of the trigger. The exposure lasts as long as the pulse.
#[derive(Default)]
pub(super) struct Pulses {
    begun: u64,
    /// The end of the latest pulse that lasts too long. All other pulses end before the camera can
    /// take the next one.
    on_until: Timestamp,
    /// Spoiled pulses that were not fetched yet.
    spoiled: SpoiledPulses,
}

impl Pulses {
    /// Begins a pulse and returns how long it will last; none if one is still on.
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
            latest::keep(&mut self.spoiled, spoiled);
        }
        Some(mechanics.exposure + longer)
    }

    /// The next spoiled pulse that has ended.
    pub fn poll(&mut self, now: Timestamp) -> Option<Spoiled> {
        self.spoiled.pop_front_if(|pulse| pulse.ended() <= now)
    }
}
