//! The daemon `fringed` and its command line: joins devices (`hal`) and computation (`algo`).
//!
//! The rooms, each of which imports only those below it (`tests/suite/house.rs` holds the order):
//!
//! ```text
//! cli                    one file per command
//! service                the running daemon: start, stop, what it looks at once a second
//! web | modbus | lines   the station for people, for a PLC, for wires
//! production             the measuring task: cycles, recovery of the head, recipes made ready
//! history | measure      stored results and recordings | a recording to heights and a report
//! recipe                 what one part number needs; taught, stored, planned
//! config                 the configuration file
//! head                   calibration, what can be measured on a head, the doctor
//! output                 pictures, plots, point clouds
//! storage                the state folder, whole files, archives
//! system                 clock, log, signals, sockets, service manager
//! station                decisions, results, snapshot: pure
//! ```

#[cfg(test)]
mod boundaries;

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
pub mod system;
pub mod web;

/// The version of this build with its commit, where that is known.
pub const VERSION: &str = env!("FRINGED_VERSION");
