//! The command line.

mod measure;

use crate::error::{Exit, Failure};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// The open 3-D smart sensor.
#[derive(Debug, Parser)]
#[command(name = "fringed", version, about, subcommand_required = false)]
struct Arguments {
    /// What to do; without a command: serve.
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    common: Common,
}

/// Options that every command knows.
#[derive(Clone, Debug, clap::Args)]
pub struct Common {
    /// Computing threads; 0 = one per core.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// No progress, no table.
    #[arg(long, global = true)]
    pub quiet: bool,
    /// Print JSON where a table would be printed.
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Measure a recording: phase, height, picture, point cloud and report.
    Measure(measure::Measure),
}

/// Parses the arguments, runs the command and answers with its exit code.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // `--help` and `--version` come this way as well; they are no errors.
            let _ = error.print();
            return if error.use_stderr() {
                Exit::Usage.into()
            } else {
                ExitCode::SUCCESS
            };
        }
    };
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("fringed: {failure}");
            failure.exit.into()
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let common = arguments.common;
    match arguments.command {
        Some(Command::Measure(command)) => command.run(&common),
        None => Ok(()),
    }
}

impl Common {
    /// A pool of computing threads of the size asked for.
    ///
    /// # Errors
    /// If the system gives no threads (exit code 70).
    pub fn pool(&self) -> Result<rayon::ThreadPool, Failure> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.unwrap_or(0))
            .build()
            .map_err(|error| Failure::because(Exit::Software, "start the computing threads", error))
    }
}
