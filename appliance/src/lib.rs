//! The daemon `fringed` and its command line: joins devices (`hal`) and computation (`algo`).
//!
//! ARCHITECTURE.md describes the modules below, here called rooms, and the order in which they may
//! import each other; `tests/suite/rooms.rs` checks it.

pub mod access;
pub mod backup;
pub mod cli;
pub mod config;
pub mod error;
pub mod head;
pub mod history;
pub mod lines;
pub mod measure;
pub mod modbus;
pub mod output;
pub mod production;
pub mod recipe;
pub mod service;
pub mod station;
pub mod storage;
pub mod study;
pub mod system;
pub mod web;

#[cfg(test)]
mod tests;

/// The version of this build with its commit, where that is known.
pub const VERSION: &str = env!("FRINGED_VERSION");
