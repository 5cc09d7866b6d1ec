//! The daemon `fringed` and its command line: joins devices (`hal`) and computation (`algo`).

pub mod access;
pub mod adapt;
pub mod archive;
pub mod backend;
#[cfg(test)]
mod boundaries;
pub mod calibration;
pub mod cli;
pub mod clock;
pub mod computing;
pub mod config;
pub mod daemon;
pub mod doctor;
pub mod error;
pub mod examine;
pub mod history;
pub mod journal;
pub mod kept;
pub mod latest;
pub mod lines;
pub mod logbook;
pub mod measure;
pub mod memory;
pub mod modbus;
pub mod notify;
pub mod output;
pub mod plan;
pub mod priority;
pub mod progress;
pub mod recipe;
pub mod rig;
pub mod seam;
pub mod shelf;
pub mod simulation;
pub mod socket;
pub mod state;
pub mod station;
pub mod survey;
pub mod tally;
pub mod told;
pub mod unpack;
pub mod web;
pub mod worker;

/// The version of this build with its commit, where that is known.
pub const VERSION: &str = env!("FRINGED_VERSION");
