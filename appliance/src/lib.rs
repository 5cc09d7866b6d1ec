//! The daemon `fringed` and its command line: joins devices (`hal`) and computation (`algo`).

pub mod adapt;
pub mod backend;
pub mod benchmark;
pub mod calibration;
pub mod cli;
pub mod clock;
pub mod config;
pub mod daemon;
pub mod error;
pub mod experiment;
pub mod history;
pub mod latest;
pub mod measure;
pub mod modbus;
pub mod output;
pub mod plan;
pub mod progress;
pub mod recipe;
pub mod rig;
pub mod seam;
pub mod state;
pub mod station;
pub mod survey;
pub mod web;
pub mod worker;
