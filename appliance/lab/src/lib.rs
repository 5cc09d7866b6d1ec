//! The program `fringed-lab`: benchmarks and experiments on what the daemon `fringed` is made of,
//! and the workbench for recordings of other pictures and patterns for a part.

pub mod adapt;
pub mod benchmark;
pub mod cli;
pub mod description;
pub mod experiment;
pub mod import;
pub mod layout;
pub mod lists;
pub mod shifts;

/// Why a benchmark failed: an error of what it times. Only a person reads it.
pub type Failed = Box<dyn std::error::Error + Send + Sync>;
