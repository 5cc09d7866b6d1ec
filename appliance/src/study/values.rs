//! The values that a study is made of.

use super::decimal::Decimal;
use std::sync::Arc;

/// All values of one characteristic, in the order in which they were measured.
#[derive(Clone, Debug, Default)]
pub struct Characteristic {
    /// What was measured, a gauge for instance.
    pub name: String,
    /// The unit's symbol, or empty.
    pub unit: String,
    /// The values.
    pub readings: Vec<Reading>,
    /// How many results were left out.
    pub left_out: LeftOut,
}

/// How many results have no value of a characteristic, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    /// INVALID ones.
    pub invalid: u64,
    /// Judged ones whose gauge found no value.
    pub not_measured: u64,
    /// Those of guided studies.
    pub of_studies: u64,
}

/// One value.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Its result's SEQ, else the line of the file.
    pub at: u64,
    /// Which part.
    pub part: Arc<str>,
    /// Who placed it; empty if nobody is named.
    pub appraiser: Arc<str>,
    /// Which repetition of part and appraiser.
    pub trial: Arc<str>,
    /// The value.
    pub value: Decimal,
    /// The predicted 1 σ.
    pub sigma: Option<f64>,
    /// The predicted U = 2 u.
    pub uncertainty: Option<f64>,
    /// Lower limit.
    pub low: Option<Decimal>,
    /// Upper limit.
    pub high: Option<Decimal>,
}
