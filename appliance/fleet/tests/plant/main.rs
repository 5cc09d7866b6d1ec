//! The program on simulated heads: nothing is missing and nothing there twice, whatever is killed;
//! heads that answer what no head answers are named, and harm no other.

#![allow(clippy::unwrap_used, clippy::panic)]

mod clickhouse;
mod commands;
mod embedded;
#[path = "../../examples/plant/heads/mod.rs"]
mod heads;
mod hostile;
mod impostor;
mod program;
