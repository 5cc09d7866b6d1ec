//! The command line.

use crate::backup::Backup;
use crate::collect::Collect;
use crate::error::{Exit, Result};
use crate::log::{self, Severity};
use crate::schema::Schema;
use crate::simulate::Simulate;
use crate::status::Status;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Collects the results of many heads into one store.
#[derive(Debug, Parser)]
#[command(name = "fringed-fleet", version)]
struct Arguments {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fetch the results of every head and write them to the store, until it is stopped.
    Collect(Collect),
    /// Show a line per head: reachable, state, recipe, results, yield, worst gauge, drift.
    Status(Status),
    /// Write recipes, calibration and configuration of each head as files.
    Backup(Backup),
    /// Answer as many heads would, without light.
    Simulate(Simulate),
    /// Print the tables and views of a store.
    Schema(Schema),
}

/// Runs the program `fringed-fleet`: parses the arguments of this process, runs the command and
/// returns its exit code.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // If stdout or stderr is closed, there is nothing to do about it.
            let _ = error.print();
            let wrong = error.use_stderr();
            return if wrong {
                Exit::Usage.into()
            } else {
                ExitCode::SUCCESS
            };
        }
    };
    match run(arguments.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::write(Severity::Error, &failure.to_string());
            failure.exit.into()
        }
    }
}

fn run(command: Command) -> Result<()> {
    match command {
        Command::Collect(command) => command.run(),
        Command::Status(command) => command.run(),
        Command::Backup(command) => command.run(),
        Command::Simulate(command) => command.run(),
        Command::Schema(command) => command.run(),
    }
}
