//! The program `fringed-lab`: benchmarks and experiments on what the daemon `fringed` is made of.

pub mod accuracy;
pub mod benchmark;
pub mod cli;
pub mod experiment;
mod plot;
