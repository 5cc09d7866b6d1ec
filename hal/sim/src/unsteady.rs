//! What changes in time: lamps on the mains, flashes, a projector whose lamp is not constant, and a part
//! that shakes.
//!
//! Other light is `ambient` · (1 + depth · cos 2π(f t + phase)), integrated over each exposure, plus a
//! flash in some; the projector's light has a random factor in each refresh. The part is off its place
//! by `shake_mm` · sin 2π f t, and each exposure sees all places that it goes through. Times are those
//! of the frames' stamps.

use super::random::normal;
use hal::bounded;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

bounded! {
    /// What changes while frames are taken. The defaults change nothing.
    #[derive(Copy)]
    pub struct Unsteady: Default {
        /// How often the other light gets brighter and darker, Hz: lamps do twice per period of the
        /// mains, 0…1000.
        pub lamp_hz: f64 = 0.0..=1000.0 => 100.0,
        /// By which share of `light.ambient` it does, 0…1.
        pub lamp_depth: f64 = 0.0..=1.0,
        /// At which part of its period it begins, turns, 0…1.
        pub lamp_phase: f64 = 0.0..=1.0,
        /// Chance of a flash per frame, 0…1.
        pub flash: f64 = 0.0..=1.0,
        /// How much light a flash adds to the other light, 1 = full scale on white, 0…100.
        pub flash_light: f64 = 0.0..=100.0 => 0.8,
        /// σ of the projector's light per refresh, as a share, 0…0.5.
        pub projector_noise: f64 = 0.0..=0.5,
        /// Amplitude with which the part shakes along x, y and z, mm, 0…1.
        pub shake_mm: [f64; 3] = 0.0..=1.0,
        /// How often it does, Hz, 0…1000.
        pub shake_hz: f64 = 0.0..=1000.0 => 30.0,
        /// Seed of flashes and projector.
        pub seed: u64 => 1,
    }
}

/// Moments of an exposure in which a part that shakes is seen.
const MOMENTS: u32 = 64;

/// An exposure in time, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposed {
    pub start: f64,
    pub length: f64,
    /// Number of the frame.
    pub count: u64,
}

/// Separates the random numbers of flashes from those of the projector.
const FLASHES: u64 = 0x464c_4153;

impl Unsteady {
    /// The places between which the part shakes, as shares of the amplitude: of one that rests alone.
    pub(super) fn places(&self) -> &'static [f64] {
        let far = self.shake_mm.iter().map(|mm| mm * mm).sum::<f64>().sqrt();
        match far {
            0.0 => &[0.0],
            ..=0.1 => &[-1.0, 0.0, 1.0],
            _ => &[-1.0, -0.5, 0.0, 0.5, 1.0],
        }
    }

    /// How long the part is at each of [`Self::places`] in an exposure, as shares: between two of them
    /// light changes in proportion to the way.
    pub(super) fn stays(&self, exposed: Exposed) -> Vec<f64> {
        let places = self.places();
        let mut stays = vec![0.0; places.len()];
        let last = places.len() - 1;
        if last == 0 {
            return vec![1.0];
        }
        for at in 0..MOMENTS {
            let time = exposed.start + exposed.length * (f64::from(at) + 0.5) / f64::from(MOMENTS);
            let way = (TAU * (self.shake_hz * time).fract()).sin();
            let place = (way + 1.0) / 2.0 * last as f64;
            let before = (place.floor() as usize).min(last - 1);
            let beyond = place - before as f64;
            stays[before] += (1.0 - beyond) / f64::from(MOMENTS);
            stays[before + 1] += beyond / f64::from(MOMENTS);
        }
        stays
    }

    /// Whether the light does not change.
    pub(super) fn is_steady(&self) -> bool {
        self.lamp_depth == 0.0 && self.flash == 0.0 && self.projector_noise == 0.0
    }

    /// The other light, of which there is `ambient` in the mean, and the projector's in an exposure,
    /// over their means.
    pub(super) fn light(&self, ambient: f64, exposed: Exposed, refresh: f64) -> [f64; 2] {
        let Exposed {
            start,
            length,
            count,
        } = exposed;
        // The mean of the cosine over the exposure.
        let turns = |at: f64| (self.lamp_hz * at).fract() + self.lamp_phase;
        let half = std::f64::consts::PI * self.lamp_hz * length;
        let washed = if half > 0.0 { half.sin() / half } else { 1.0 };
        let lamp = self.lamp_depth * washed * (TAU * turns(start + length / 2.0)).cos();
        let flashes = self.random(FLASHES ^ count) < self.flash;
        let flash = if flashes {
            self.flash_light / ambient.max(1e-3)
        } else {
            0.0
        };
        [
            1.0 + lamp + flash,
            1.0 + self.projector(start, length, refresh),
        ]
    }

    /// The mean over the exposure of what each refresh of the projector has more.
    fn projector(&self, start: f64, length: f64, refresh: f64) -> f64 {
        let (first, last) = (start / refresh, (start + length) / refresh);
        let refreshes = first.floor() as u64..last.ceil() as u64;
        let more = refreshes.map(|at| {
            let share = (last.min(at as f64 + 1.0) - first.max(at as f64)).max(0.0);
            let mut random = SplitMix64::seed_from_u64(self.seed ^ at.rotate_left(20));
            share * f64::from(normal(random.next_u64()))
        });
        self.projector_noise * more.sum::<f64>() / (last - first).max(f64::MIN_POSITIVE)
    }

    /// A number from 0 to 1.
    fn random(&self, of: u64) -> f64 {
        let mut random = SplitMix64::seed_from_u64(self.seed ^ of.rotate_left(17));
        (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REFRESH: f64 = 1.0 / 60.0;

    fn exposed(start: f64, length: f64) -> Exposed {
        let count = 0;
        Exposed {
            start,
            length,
            count,
        }
    }

    #[test]
    fn a_lamp_is_integrated_over_the_exposure() {
        let lamp = Unsteady {
            lamp_depth: 0.4,
            lamp_phase: 0.2,
            ..Unsteady::default()
        };
        for (start, length) in [(0.0, 0.001), (0.0137, 0.0167), (1.3, 0.0334)] {
            let steps = 20_000;
            let mean = (0..steps).map(|at| {
                let time = start + length * (f64::from(at) + 0.5) / f64::from(steps);
                1.0 + 0.4 * (TAU * (100.0 * time + 0.2)).cos()
            });
            let mean = mean.sum::<f64>() / f64::from(steps);
            let [other, shown] = lamp.light(0.1, exposed(start, length), REFRESH);
            assert!(
                (other - mean).abs() < 1e-6 && shown == 1.0,
                "{start}: {other}, {mean}"
            );
        }
        // Whole periods of the lamp see no change.
        let [whole, _] = lamp.light(0.1, exposed(0.0123, 0.02), REFRESH);
        assert!((whole - 1.0).abs() < 1e-9, "{whole}");
    }

    #[test]
    fn the_projector_changes_from_refresh_to_refresh_by_as_much_as_is_asked() {
        let noisy = Unsteady {
            projector_noise: 0.03,
            ..Unsteady::default()
        };
        for (refreshes, sigma) in [(1.0, 0.03), (2.0, 0.03 / 2_f64.sqrt())] {
            let more = (0..2000).map(|at| {
                let start = f64::from(at) * 2.0 * REFRESH;
                noisy.light(0.1, exposed(start, refreshes * REFRESH), REFRESH)[1] - 1.0
            });
            let variance = more.map(|more| more * more).sum::<f64>() / 2000.0;
            assert!((variance.sqrt() / sigma - 1.0).abs() < 0.06, "{variance}");
        }
    }

    #[test]
    fn flashes_come_as_often_as_is_asked() {
        let flashing = Unsteady {
            flash: 0.1,
            ..Unsteady::default()
        };
        let flashed = (0..2000).filter(|&count| {
            let exposed = Exposed {
                count,
                ..exposed(0.0, 0.01)
            };
            flashing.light(0.1, exposed, REFRESH)[0] > 8.9
        });
        let flashed = flashed.count();
        assert!((160..240).contains(&flashed), "{flashed}");
    }
}
