//! What the simulated heads measure: gauges with limits, and values that scatter and drift.
//!
//! Values are whole millionths of their unit, so that no rounding depends on a language.

use super::figures::{SPREAD, bell, millionths, mixed};

/// Bits of a decision: those of registers 1116–1179.
pub(super) mod decision {
    pub const PASS: u16 = 1;
    pub const VALID: u16 = 2;
    pub const LOW: u16 = 4;
    pub const HIGH: u16 = 8;
    pub const DOUBTFUL: u16 = 16;
}

/// Why a value is missing.
pub(super) const REASON: &str = "less than half of its region is resolved";
/// Results in which a drift comes and goes.
const DRIFT: i64 = 3600;

/// A gauge of every head; lengths and so on in millionths of the unit.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    pub slot: u16,
    pub name: String,
    pub unit: &'static str,
    centre: i64,
    /// Standard deviation of the scatter.
    spread: i64,
    pub low: Option<i64>,
    pub high: Option<i64>,
    /// Its JSON up to the value, and from behind the value to the decision.
    pub before: Vec<u8>,
    pub behind: Vec<u8>,
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

/// Name, unit, centre, spread, lower and upper limit.
type Row = (
    &'static str,
    &'static str,
    i64,
    i64,
    Option<i64>,
    Option<i64>,
);

const TABLE: [Row; 8] = [
    ("deviation", "mm", 0, 12_000, Some(-100_000), Some(100_000)),
    (
        "opening 1",
        "mm",
        6_000_000,
        10_000,
        Some(5_920_000),
        Some(6_080_000),
    ),
    ("flatness", "mm", 30_000, 5_000, None, Some(80_000)),
    (
        "bend",
        "°",
        90_000_000,
        60_000,
        Some(89_500_000),
        Some(90_500_000),
    ),
    (
        "cup volume",
        "mm³",
        250_000_000,
        1_000_000,
        Some(242_000_000),
        Some(258_000_000),
    ),
    (
        "step, left",
        "mm",
        1_500_000,
        6_000,
        Some(1_450_000),
        Some(1_550_000),
    ),
    ("rim \"A\"", "", 970_000, 8_000, Some(900_000), None),
    (
        "height",
        "mm",
        12_000_000,
        7_000,
        Some(11_940_000),
        Some(12_060_000),
    ),
];

impl Gauge {
    /// The gauges of every head: the eight of the table, then lengths.
    pub(super) fn table(count: u16) -> Vec<Self> {
        let row = |slot: u16| match TABLE.get(usize::from(slot) - 1) {
            Some(&(name, unit, centre, spread, low, high)) => {
                (name.to_owned(), unit, centre, spread, low, high)
            }
            None => {
                let [.., (_, unit, centre, spread, low, high)] = TABLE;
                (format!("gauge {slot}"), unit, centre, spread, low, high)
            }
        };
        (1..=count)
            .map(|slot| {
                let (name, unit, centre, spread, low, high) = row(slot);
                let limit = |limit: Option<i64>| limit.map_or("null".into(), millionths);
                let escaped = name.replace('"', "\\\"");
                let before =
                    format!(r#"{{"slot":{slot},"name":"{escaped}","unit":"{unit}","value":"#);
                let behind = format!(
                    r#","sigma":{},"u":{},"low":{},"high":{},"decision":"#,
                    millionths(spread / 2),
                    millionths(spread),
                    limit(low),
                    limit(high)
                );
                Self {
                    slot,
                    name,
                    unit,
                    centre,
                    spread,
                    low,
                    high,
                    before: before.into_bytes(),
                    behind: behind.into_bytes(),
                }
            })
            .collect()
    }

    /// 1 σ of a value.
    pub(super) fn sigma(&self) -> i64 {
        self.spread / 2
    }

    /// U of a value.
    pub(super) fn u(&self) -> i64 {
        self.spread
    }

    /// The value of result `seq` of a head.
    pub(super) fn value(&self, head: Character, seq: u32) -> i64 {
        let place = mixed(head.key ^ u64::from(self.slot));
        let offset = match self.high {
            Some(high) if head.scraps && self.slot == 1 => {
                high - self.centre - self.spread * 13 / 10
            }
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

    /// The bits of the decision about a value.
    pub(super) fn decision(&self, value: i64) -> u16 {
        let below = self.low.is_some_and(|low| value < low);
        let above = self.high.is_some_and(|high| value > high);
        let near = |limit: Option<i64>| {
            limit.is_some_and(|limit| (value - limit).abs() < 2 * self.sigma())
        };
        let set = [
            (decision::PASS, !below && !above),
            (decision::LOW, below),
            (decision::HIGH, above),
            (decision::DOUBTFUL, near(self.low) || near(self.high)),
        ];
        set.iter()
            .filter(|(_, set)| *set)
            .fold(decision::VALID, |bits, (bit, _)| bits | bit)
    }
}
