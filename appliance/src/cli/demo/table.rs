//! The table of the demonstration.

use super::MeasuredPart;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// As aligned text.
pub fn text(rows: &[MeasuredPart]) -> String {
    let mut table = String::from(
        "part  placed           verdict  deviation  coverage  exposed    result  outside its limits\n",
    );
    for (at, row) in rows.iter().enumerate() {
        let result = &row.result;
        let value = |gauge: usize| result.values.get(gauge).copied().unwrap_or(f32::NAN);
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "{:>4}  {:<15}  {:<7}  {:>+6.3} mm  {:>6.2} %  {:>4} ms  {:>5} ms  {}",
            at + 1,
            row.placed.what,
            result.word(),
            value(0),
            value(1) * 100.0,
            result.exposure_us / 1000,
            result.total_us / 1000,
            outside(row),
        );
    }
    table
}

/// "slot 1 deviation, slot 3 opening"; "-" if no gauge is outside its limits.
fn outside(row: &MeasuredPart) -> String {
    let names = row.outside.iter();
    let names: Vec<_> = names
        .map(|(slot, name)| format!("slot {slot} {name}"))
        .collect();
    match names.is_empty() {
        true => "-".into(),
        false => names.join(", "),
    }
}

/// As JSON: one object per part.
pub fn json(rows: &[MeasuredPart]) -> Value {
    rows.iter()
        .enumerate()
        .map(|(at, row)| {
            json!({
                "part": at + 1,
                "placed": row.placed.what,
                "verdict": row.result.word(),
                "seq": row.result.seq,
                "values": row.result.values,
                "outside": row.outside.iter().map(|(_, name)| name).collect::<Vec<_>>(),
                "slots_outside": row.outside.iter().map(|(slot, _)| slot).collect::<Vec<_>>(),
                "exposure_us": row.result.exposure_us,
                "total_us": row.result.total_us,
            })
        })
        .collect()
}
