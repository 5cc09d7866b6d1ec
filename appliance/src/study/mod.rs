//! Studies: what releases a station for production, as pure functions of tables of values.
//!
//! ```text
//! CSV, history, guided study ──► table ──► capability     C_g, C_gk, Q_MS of one reference part
//!                                     ├──► repeatability  Gage R&R of parts, appraisers and trials
//!                                     └──► process        P_p, P_pk, C_p, C_pk, control limits, marks (group, drift)
//! ```
//!
//! They know no station, recipe or database. Numbers stay decimal until they are differences ([`decimal`]); distributions
//! are in [`distribution`].

mod balanced;
pub mod capability;
pub mod decimal;
pub mod distribution;
pub mod drift;
pub mod group;
pub mod marks;
pub mod process;
pub mod repeatability;
pub mod spread;
pub mod table;
mod text;
pub mod values;
pub mod verdict;

#[cfg(test)]
mod tests;

pub use capability::{CapabilityLimits, GaugeCapability};
pub use decimal::Decimal;
pub use process::{Course, Process};
pub use repeatability::{Repeatability, StudyLimits};
pub use values::{Characteristic, LeftOut, Reading};

use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Writes reports as JSON, as they are made: a hundred thousand results with 64 gauges have a gigabyte of figures.
///
/// # Errors
/// Whatever `out` answers.
pub fn write_json<T: Serialize>(mut out: &mut dyn Write, reports: &[T]) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut out, &BTreeMap::from([("studies", reports)]))?;
    writeln!(out)
}
