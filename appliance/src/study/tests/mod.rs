//! Studies against published figures and exact arithmetic, and figures that cannot be formed.

mod distributions;
mod files;
mod published;
mod undefined;

use super::table;
use super::values::Characteristic;

/// The values of a CSV file, which must be one characteristic.
fn measured(csv: &str) -> Characteristic {
    let mut all = table::read(csv.as_bytes(), "values.csv").unwrap();
    assert_eq!(all.len(), 1);
    all.remove(0)
}

/// Fails unless both agree to this share of the larger one.
#[track_caller]
fn close(found: f64, expected: f64, share: f64) {
    let largest = found.abs().max(expected.abs());
    assert!(
        (found - expected).abs() <= share * largest,
        "{found:e} instead of {expected:e}"
    );
}
