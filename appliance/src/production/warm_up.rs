//! Whether the head is still warming up, by the temperatures that its devices report.

use std::time::{Duration, Instant};

/// A head is warm once no device has changed by more than [`STEADY_C`] for so long.
const STEADY_FOR: Duration = Duration::from_secs(300);
/// °C. A projector's lamp shifts its picture by some hundredths of a pixel per degree; a steady
/// head scatters by less than half of that.
const STEADY_C: f64 = 1.0;

/// The temperature of each device since when it has been steady; a head without temperatures is
/// taken to be warm.
#[derive(Debug, Default)]
pub struct WarmUp {
    /// The temperatures of the camera and of the projector.
    devices: [Option<Steady>; 2],
    under_way: bool,
}

#[derive(Clone, Copy, Debug)]
struct Steady {
    celsius: f64,
    since: Instant,
}

impl WarmUp {
    /// Notes the temperatures of camera and projector, where they are known. Answers whether the
    /// head's state has changed.
    pub fn note(&mut self, celsius: [Option<f64>; 2], now: Instant) -> bool {
        for (device, celsius) in self.devices.iter_mut().zip(celsius) {
            let Some(celsius) = celsius else {
                *device = None;
                continue;
            };
            let steady = device.filter(|of| (of.celsius - celsius).abs() <= STEADY_C);
            *device = steady.or(Some(Steady {
                celsius,
                since: now,
            }));
        }
        let known = self.devices.iter().flatten();
        let under_way = known
            .map(|of| now.duration_since(of.since))
            .any(|steady| steady < STEADY_FOR);
        std::mem::replace(&mut self.under_way, under_way) != under_way
    }

    /// Whether the head is warming up.
    pub fn is_under_way(&self) -> bool {
        self.under_way
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_warm_five_minutes_after_its_last_change_of_a_degree() {
        let mut warm_up = WarmUp::default();
        let start = Instant::now();
        let mut note = |celsius, s| {
            let changed = warm_up.note([celsius, Some(40.0)], start + Duration::from_secs(s));
            (changed, warm_up.is_under_way())
        };
        assert_eq!(note(Some(25.0), 0), (true, true));
        assert_eq!(note(Some(28.0), 200), (false, true));
        assert_eq!(note(Some(28.8), 499), (false, true));
        assert_eq!(note(Some(28.2), 500), (true, false));
        assert_eq!(note(Some(29.5), 900), (true, true));
    }

    #[test]
    fn a_head_without_temperatures_is_warm() {
        let mut warm_up = WarmUp::default();
        assert!(!warm_up.note([None, None], Instant::now()));
        assert!(!warm_up.is_under_way());
    }
}
