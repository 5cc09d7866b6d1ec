//! The integration suite: one binary, one module per topic.

mod adapt;
mod bad_input;
mod bench;
mod cases;
mod cli;
mod experiment;
mod formats;
mod fuzz;
mod gauges;
mod house;
mod measured;
mod outputs;
mod placement;
mod precision;
mod production;
mod promises_own;
mod promises_shared;
mod station;
mod station_plc;
mod stress;
mod triangulation;
mod twin;
mod written;
