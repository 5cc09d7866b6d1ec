//! A result of a head.

use super::gauge::{DOUBTFUL, HIGH, LOW, mixed};
use super::head::Head;
use crate::answer::Row;
use serde::Serialize;

/// Of so many results one has a gauge without a value, or cannot be judged at all.
const UNSEEN: u64 = 500;
const FAILED: u64 = 3000;
/// Results after which the recipe of a head that makes two parts changes.
const CHANGEOVER: u32 = 500;
/// ERROR_CODE of a result without a measurement: frames that fit no pattern.
const NO_MEASUREMENT: u16 = 302;
/// RESULT flags: the full sequence, a simulated head, a doubtful decision.
const FLAGS: u16 = 1 << 3 | 1 << 5;
const IS_DOUBTFUL: u16 = 1 << 7;

/// Result `seq` of a head.
pub(super) fn row(head: &Head, seq: u32) -> Row {
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
    let shift = |at: u32| Some(((luck >> at) as i64 % 256 - 128) as f64 / 1e3);
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
pub(super) fn line(of: &impl Serialize) -> Vec<u8> {
    // Only a map whose keys are no text could not be written.
    let mut line = serde_json::to_vec(of).unwrap_or_default();
    line.push(b'\n');
    line
}

/// The recipe of result `seq`: one head in four makes two parts in turns.
pub(super) fn recipe(head: &Head, seq: u32) -> u16 {
    let second = head.number.is_multiple_of(4) && (seq / CHANGEOVER) % 2 == 1;
    1 + u16::from(second)
}

/// The first 8 hexadecimal digits of a recipe's fingerprint: the same recipe on all heads.
pub(super) fn fingerprint(head: &Head, recipe: u16) -> String {
    let seed = mixed(head.plant.options.seed);
    format!("{:08x}", mixed(seed ^ u64::from(recipe)) as u32)
}
