//! The integration suite: one binary, one module per topic.

mod bad_input;
mod cases;
mod experiment;
mod fuzz;
mod house;
mod measured;
mod outputs;
mod promises_own;
mod promises_shared;
mod triangulation;
mod twin;
mod written;
