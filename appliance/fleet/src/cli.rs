//! The command line.

use crate::backup::Backup;
use crate::collect::Collect;
use crate::error::{Exit, Result};
use crate::log::{self, Severity};
use crate::simulate::Simulate;
use crate::status::Status;
use crate::store::{Kind, schema};
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
    Schema {
        /// What the store is made of.
        #[arg(long, value_enum)]
        store: Kind,
    },
}

/// Runs the program `fringed-fleet`: parses the arguments of this process, runs the command and
/// returns its exit code.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // If stdout or stderr is closed, there is nothing to do about it.
            let _ = error.print();
            return match error.use_stderr() {
                true => Exit::Usage.into(),
                false => ExitCode::SUCCESS,
            };
        }
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(Exit::Software.because("start"));
    match runtime.and_then(|runtime| runtime.block_on(run(arguments.command))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::write(Severity::Error, &failure);
            failure.exit.into()
        }
    }
}

async fn run(command: Command) -> Result<()> {
    match command {
        Command::Collect(command) => command.run().await,
        Command::Status(command) => command.run().await,
        Command::Backup(command) => command.run().await,
        Command::Simulate(command) => command.run().await,
        Command::Schema { store } => {
            say!("{}", schema(store).trim_end());
            Ok(())
        }
    }
}
