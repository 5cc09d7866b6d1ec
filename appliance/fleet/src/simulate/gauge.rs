//! What the simulated heads measure: gauges with limits, and values that scatter and drift.
//!
//! Values are made as whole millionths of their unit, so that no rounding depends on a language.

use crate::answer;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

/// Bits of a decision: those of registers 1116–1179.
const PASS: u16 = 1;
const VALID: u16 = 2;
pub(super) const LOW: u16 = 4;
pub(super) const HIGH: u16 = 8;
pub(super) const DOUBTFUL: u16 = 16;

/// Why a value is missing.
const REASON: &str = "less than half of its region is resolved";
/// Results in which a drift comes and goes.
const DRIFT: i64 = 3600;
/// Standard deviation of [`bell`]: √(4 · 65536² / 12).
const SPREAD: i64 = 37_837;

/// Name, unit, centre, standard deviation of the scatter, lower and upper limit.
type Shape = (
    &'static str,
    &'static str,
    f64,
    f64,
    Option<f64>,
    Option<f64>,
);

const TABLE: [Shape; 8] = [
    ("deviation", "mm", 0.0, 0.012, Some(-0.1), Some(0.1)),
    ("opening 1", "mm", 6.0, 0.01, Some(5.92), Some(6.08)),
    ("flatness", "mm", 0.03, 0.005, None, Some(0.08)),
    ("bend", "°", 90.0, 0.06, Some(89.5), Some(90.5)),
    ("cup volume", "mm³", 250.0, 1.0, Some(242.0), Some(258.0)),
    ("step, left", "mm", 1.5, 0.006, Some(1.45), Some(1.55)),
    ("rim \"A\"", "", 0.97, 0.008, Some(0.9), None),
    ("height", "mm", 12.0, 0.007, Some(11.94), Some(12.06)),
];

/// A gauge of every head.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    /// As it is in results, but for the value.
    pub shape: answer::Gauge,
    /// Millionths, as the standard deviation of the scatter.
    centre: i64,
    spread: i64,
}

/// How a head differs from the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Character {
    /// What its numbers are made of.
    pub key: u64,
    /// Its drift is four spreads wide, not half of one.
    pub drifts: bool,
    /// It makes scrap: its first gauge lies close to the upper limit.
    pub scraps: bool,
}

impl Gauge {
    /// The gauges of every head: the eight of the table, then lengths.
    pub(super) fn table(count: u16) -> Vec<Self> {
        let gauge = |slot: u16| {
            let place = usize::from(slot) - 1;
            let (name, unit, centre, spread, low, high) = TABLE[place.min(TABLE.len() - 1)];
            let name = match place < TABLE.len() {
                true => name.to_owned(),
                false => format!("gauge {slot}"),
            };
            let shape = answer::Gauge {
                slot,
                name,
                unit: unit.to_owned(),
                sigma: Some(spread / 2.0),
                u: Some(spread),
                low,
                high,
                ..answer::Gauge::default()
            };
            let [centre, spread] = [centre, spread].map(millionths);
            Self {
                shape,
                centre,
                spread,
            }
        };
        (1..=count).map(gauge).collect()
    }

    /// The value of result `seq` of a head, in millionths.
    pub(super) fn value(&self, head: Character, seq: u32) -> i64 {
        let slot = self.shape.slot;
        let place = mixed(head.key ^ u64::from(slot));
        let offset = match self.shape.high.map(millionths) {
            Some(high) if head.scraps && slot == 1 => high - self.centre - self.spread * 13 / 10,
            _ => (bell(place) * self.spread).div_euclid(2 * SPREAD),
        };
        let phase = (i64::from(seq) + (place >> 32) as i64 % DRIFT) % DRIFT;
        let wave = 4 * (phase - DRIFT / 2).abs() - DRIFT;
        let width = if head.drifts {
            4 * self.spread
        } else {
            self.spread / 2
        };
        let drift = (width * wave).div_euclid(2 * DRIFT);
        let scatter = bell(mixed(place ^ u64::from(seq)));
        self.centre + offset + drift + (scatter * self.spread).div_euclid(SPREAD)
    }

    /// The gauge with a value in millionths and the decision about it, or with the reason why there
    /// is none.
    pub(super) fn measured(&self, value: Option<i64>) -> answer::Gauge {
        let value = value.map(|value| value as f64 / 1e6);
        answer::Gauge {
            value,
            decision: value.map_or(0, |value| self.decision(value)),
            reason: value.is_none().then(|| REASON.to_owned()),
            ..self.shape.clone()
        }
    }

    fn decision(&self, value: f64) -> u16 {
        let (low, high) = (self.shape.low, self.shape.high);
        let below = low.is_some_and(|low| value < low);
        let above = high.is_some_and(|high| value > high);
        let is_near = |limit: f64| (value - limit).abs() * 1e6 < self.spread as f64;
        let set = [
            (PASS, !below && !above),
            (VALID, true),
            (LOW, below),
            (HIGH, above),
            (
                DOUBTFUL,
                low.is_some_and(is_near) || high.is_some_and(is_near),
            ),
        ];
        set.iter().map(|(bit, set)| bit * u16::from(*set)).sum()
    }
}

fn millionths(number: f64) -> i64 {
    (number * 1e6).round() as i64
}

/// A number that looks random, of another.
pub(super) fn mixed(number: u64) -> u64 {
    SplitMix64::seed_from_u64(number).next_u64()
}

/// The sum of the number's four 16-bit parts, less its mean: about normal.
fn bell(number: u64) -> i64 {
    let parts = [0, 16, 32, 48].map(|shift| number >> shift & 0xffff);
    parts.iter().sum::<u64>() as i64 - 131_070
}
