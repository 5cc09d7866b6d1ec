//! The daemon `fringed` and its command line: joins devices (`hal`) and computation (`algo`).

pub mod calibration;
pub mod cli;
pub mod error;
pub mod measure;
pub mod modbus;
pub mod output;
pub mod plan;
pub mod recipe;
pub mod seam;
pub mod station;
pub mod web;
