//! The integration suite: one binary, one module per topic.

mod adapt;
mod bad_input;
mod bench;
mod cases;
mod changeover;
mod cli;
mod experiment;
mod formats;
mod fuzz;
mod history;
mod hostile;
mod house;
mod measured;
mod outputs;
mod page;
mod placement;
mod production;
mod promises_own;
mod promises_shared;
mod recovery;
mod station;
mod station_plc;
mod stress;
mod triangulation;
mod twin;
mod written;
