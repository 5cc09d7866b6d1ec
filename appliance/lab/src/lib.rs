//! The program `fringed-lab`: benchmarks and experiments on what the daemon `fringed` is made of,
//! and the workbench for recordings of other pictures and patterns for a part.

pub mod accuracy;
pub mod benchmark;
pub mod cli;
pub mod experiment;
pub mod workbench;
