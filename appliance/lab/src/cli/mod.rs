//! The command line.

mod accuracy;
mod bench;
mod experiment;

use appliance::VERSION;
use appliance::cli::{Completions, start};
use appliance::error::Failure;
use clap::{CommandFactory as _, Parser, Subcommand};
use std::process::ExitCode;

/// Benchmarks and experiments on what `fringed` is made of.
#[derive(Debug, Parser)]
#[command(name = "fringed-lab", version = VERSION)]
struct Arguments {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Repeat the paper's experiments on the simulated head.
    Experiment(experiment::Experiment),
    /// Time the kernels, time against error, and trigger to verdict.
    Bench(bench::Bench),
    /// Divide the error of heights into noise and what remains without it, and find the smallest dents that are seen.
    Accuracy(accuracy::Accuracy),
    /// Print what makes a shell complete the command line.
    Completions(Completions),
}

/// Runs the program `fringed-lab`.
pub fn main() -> ExitCode {
    start(run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.command {
        Command::Experiment(command) => command.run(),
        Command::Bench(command) => command.run(),
        Command::Accuracy(command) => command.run(),
        Command::Completions(command) => {
            command.run(Arguments::command());
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests;
