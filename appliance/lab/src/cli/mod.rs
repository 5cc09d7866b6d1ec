//! The command line.

mod accuracy;
mod adapt;
mod bench;
mod capture;
mod experiment;
mod import;
mod patterns;

use appliance::VERSION;
use appliance::cli::{Completions, Manual, start};
use appliance::error::Result;
use clap::{CommandFactory as _, Parser, Subcommand};
use std::process::ExitCode;

/// Benchmarks and experiments on what `fringed` is made of, recordings of other pictures, patterns
/// for a part.
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
    /// Divide the error of heights into noise and what remains without it, and find the smallest
    /// dents that are seen.
    Accuracy(accuracy::Accuracy),
    /// Make a pattern for the part of a preliminary recording.
    Adapt(adapt::Adapt),
    /// Write the pictures to project: fringes, adaptive fringes, Gray code.
    Patterns(patterns::Patterns),
    /// Make a recording of pictures that other programs took.
    Import(import::Import),
    /// Take pictures with a head that need not be calibrated.
    Capture(capture::Capture),
    /// Print what makes a shell complete the command line.
    Completions(Completions),
    /// Write the manual pages.
    #[command(hide = true)]
    Manual(Manual),
}

/// Runs the program `fringed-lab`.
pub fn main() -> ExitCode {
    start(run)
}

fn run(arguments: Arguments) -> Result<()> {
    match arguments.command {
        Command::Experiment(command) => command.run(),
        Command::Bench(command) => command.run(),
        Command::Accuracy(command) => command.run(),
        Command::Adapt(command) => command.run(),
        Command::Patterns(command) => command.run(),
        Command::Import(command) => command.run(),
        Command::Capture(command) => command.run(),
        Command::Completions(command) => command.run(Arguments::command()),
        Command::Manual(command) => command.run(Arguments::command()),
    }
}

#[cfg(test)]
mod tests;
