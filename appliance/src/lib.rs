//! The daemon `fringed` and its command line.
pub mod cli;
pub mod modbus;
pub mod output;
pub mod station;
pub mod web;
