//! What the heads measure: gauges whose values scatter and drift about their centre, decided by
//! limits, and the results that have them.
//!
//! Values are made as whole millionths of their unit, so that no rounding depends on a language.

use super::Head;
use fringed_fleet::answer::{Gauge, Row};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use serde::Serialize;

/// Bits of a decision: those of registers 1116–1179.
const PASS: u16 = 1;
const VALID: u16 = 2;
const LOW: u16 = 4;
const HIGH: u16 = 8;
const DOUBTFUL: u16 = 16;

/// Why a value is missing.
const REASON: &str = "less than half of its region is resolved";
/// Results in which a drift comes and goes.
const DRIFT: i64 = 3600;
/// Standard deviation of [`bell`]: √(4 · 65536² / 12).
const SPREAD: i64 = 37_837;

/// One result in this many has a gauge without a value.
const UNSEEN: u64 = 500;
/// One result in this many has no measurement.
const FAILED: u64 = 3000;
/// Results after which the recipe of a head that makes two parts changes.
const CHANGEOVER: u32 = 500;
/// ERROR_CODE of a result without a measurement: frames that fit no pattern.
const NO_MEASUREMENT: u16 = 302;
/// RESULT flags: the full sequence and a simulated head; a doubtful decision.
const FLAGS: u16 = 1 << 3 | 1 << 5;
const IS_DOUBTFUL: u16 = 1 << 7;

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

/// What a gauge of every head measures.
#[derive(Clone, Debug)]
pub struct GaugeModel {
    /// As it is in results, but for the value.
    pub shape: Gauge,
    /// Millionths, as the standard deviation of the scatter.
    centre: i64,
    spread: i64,
}

/// How a head differs from the others.
#[derive(Clone, Copy, Debug)]
pub struct Character {
    /// What its numbers are made of.
    pub key: u64,
    /// Its drift is four spreads wide, not half of one.
    pub drifts: bool,
    /// It makes scrap: its first gauge lies close to the upper limit.
    pub scraps: bool,
}

impl GaugeModel {
    /// The gauges of every head: the eight of the table, then lengths.
    pub fn table(count: u16) -> Vec<Self> {
        let gauge = |slot: u16| {
            let place = usize::from(slot) - 1;
            let (name, unit, centre, spread, low, high) = TABLE[place.min(TABLE.len() - 1)];
            let name = match place < TABLE.len() {
                true => name.to_owned(),
                false => format!("gauge {slot}"),
            };
            let shape = Gauge {
                slot,
                name,
                unit: unit.to_owned(),
                sigma: Some(spread / 2.0),
                u: Some(spread),
                low,
                high,
                ..Gauge::default()
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
    pub fn value(&self, head: Character, seq: u32) -> i64 {
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
    pub fn measured(&self, value: Option<i64>) -> Gauge {
        let value = value.map(|value| value as f64 / 1e6);
        Gauge {
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
pub fn mixed(number: u64) -> u64 {
    SplitMix64::seed_from_u64(number).next_u64()
}

/// The sum of the number's four 16-bit parts, less its mean: about normal.
fn bell(number: u64) -> i64 {
    let parts = [0, 16, 32, 48].map(|shift| number >> shift & 0xffff);
    parts.iter().sum::<u64>() as i64 - 131_070
}

/// Result `seq` of a head.
pub fn row(head: &Head, seq: u32) -> Row {
    let luck = mixed(mixed(head.character.key) ^ u64::from(seq));
    let recipe = recipe(head, seq);
    let clock = head.clock();
    let row = Row {
        serial: head.serial(),
        history: head.history(),
        seq,
        at_unix_ms: (clock != "none").then(|| head.at_ms(seq)),
        clock: clock.into(),
        recipe,
        fingerprint: fingerprint(head, recipe),
        part_id: head.number.wrapping_mul(1_000_000).wrapping_add(seq),
        press_stroke: seq,
        flags: FLAGS,
        exposure_us: 87_000 + (luck % 8_000) as u32,
        processing_us: 5_000 + (luck >> 16) as u32 % 3_000,
        ..Row::default()
    };
    if luck % FAILED == 1 {
        return Row {
            verdict: "INVALID".into(),
            error_code: NO_MEASUREMENT,
            ..row
        };
    }
    let gauges = &head.plant.gauges;
    let unseen = luck.is_multiple_of(UNSEEN);
    let unseen = unseen.then_some((luck >> 40) as usize % gauges.len());
    let gauges = gauges.iter().enumerate().map(|(place, gauge)| {
        let seen = unseen != Some(place);
        gauge.measured(seen.then(|| gauge.value(head.character, seq)))
    });
    let gauges: Vec<_> = gauges.collect();
    let bits = gauges.iter().fold(0, |bits, gauge| bits | gauge.decision);
    let verdict = match unseen {
        Some(_) => "INVALID",
        None if bits & (LOW | HIGH) != 0 => "FAIL",
        None => "PASS",
    };
    let doubtful = if bits & DOUBTFUL != 0 { IS_DOUBTFUL } else { 0 };
    // Thousandths of a mm and of a degree; the turn about z of a round part is not determined.
    let shift = |bit: u32| Some(((luck >> bit) as i64 % 256 - 128) as f64 / 1e3);
    let [x, y, z, a, b] = [16, 24, 32, 40, 48].map(shift);
    Row {
        verdict: verdict.into(),
        flags: FLAGS | doubtful,
        coverage: f64::from(900 + (luck >> 24) as u16 % 100) / 1e3,
        placement: (luck % 64 != 2).then_some([x, y, z, a, b, None]),
        gauges,
        ..row
    }
}

/// A line of an answer.
pub fn line(value: &impl Serialize) -> Vec<u8> {
    // Only a map whose keys are no text could not be written.
    let mut line = serde_json::to_vec(value).unwrap_or_default();
    line.push(b'\n');
    line
}

/// The recipe of result `seq`: one head in four makes two parts in turns.
pub fn recipe(head: &Head, seq: u32) -> u16 {
    let second = head.number.is_multiple_of(4) && (seq / CHANGEOVER) % 2 == 1;
    1 + u16::from(second)
}

/// The first 8 hexadecimal digits of a recipe's fingerprint: the same recipe on all heads.
pub fn fingerprint(head: &Head, recipe: u16) -> String {
    let seed = mixed(head.plant.options.seed);
    format!("{:08x}", mixed(seed ^ u64::from(recipe)) as u32)
}
