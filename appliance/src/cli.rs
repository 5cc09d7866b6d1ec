//! The command line.

/// Prints a line of the answer. Whoever closes the pipe early has read enough: that is no error.
macro_rules! say {
    ($($argument:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($argument)*);
    }};
}

mod adapt;
mod bench;
mod calibrate;
mod config;
mod demo;
mod doctor;
mod experiment;
mod history;
mod measure;
mod recipe;
mod record;
mod replay;
mod serve;
mod teach;

use crate::config::{Config, HeadConfig};
use crate::error::{Exit, Failure};
use crate::journal::{self, Severity};
use crate::modbus::{registers_csv, registers_json};
use crate::progress::Progress;
use clap::{Parser, Subcommand};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

/// The open 3-D smart sensor.
#[derive(Debug, Parser)]
#[command(name = "fringed", version = env!("FRINGED_VERSION"))]
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
    /// Configuration file (TOML); `fringed config keys` lists its keys.
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// State folder: recipes, history, result counter, serial.
    #[arg(long, global = true, value_name = "DIR")]
    pub state: Option<PathBuf>,
    /// Where to serve Modbus TCP.
    #[arg(long, global = true, value_name = "ADDR:PORT")]
    pub modbus: Option<SocketAddr>,
    /// Where to serve the page.
    #[arg(long, global = true, value_name = "ADDR:PORT")]
    pub http: Option<SocketAddr>,
    /// Computing threads; 0 = one per core.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// No progress, no log, no table.
    #[arg(long, global = true)]
    pub quiet: bool,
    /// Print JSON where a table would be printed.
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the station: Modbus TCP for the PLC, a page for the technician.
    Serve,
    /// Run the station and play the PLC: ten parts, three of them defective.
    Demo(demo::Demo),
    /// Measure a recording: phase, height, picture, point cloud and report.
    Measure(measure::Measure),
    /// Make a pattern for the part of a preliminary recording.
    Adapt(adapt::Adapt),
    /// Examine the head step by step.
    Doctor(doctor::Doctor),
    /// Calibrate the head: import its models, measure the rest.
    Calibrate(calibrate::Calibrate),
    /// Record a sequence from the configured head.
    Record(record::Record),
    /// Repeat the paper's experiments on the simulated head.
    Experiment(experiment::Experiment),
    /// Time the kernels, time against error, and trigger to verdict.
    Bench(bench::Bench),
    /// Make a recipe from a good part in front of the head, or from recordings.
    Teach(teach::Teach),
    /// Show or export stored results.
    History(history::History),
    /// Judge a kept part again and compare with the history.
    Replay(replay::Replay),
    /// List, export, import or delete recipes.
    #[command(subcommand)]
    Recipe(recipe::RecipeCommand),
    /// Check a configuration, or list its keys.
    #[command(subcommand)]
    Config(config::ConfigCommand),
    /// Print the register map as CSV (or JSON with --json).
    Registers,
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
            journal::write(Severity::Error, &failure.to_string());
            failure.exit.into()
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let common = arguments.common;
    match arguments.command.unwrap_or(Command::Serve) {
        Command::Serve => serve::run(&common),
        Command::Demo(command) => command.run(&common),
        Command::Measure(command) => command.run(&common),
        Command::Adapt(command) => command.run(&common),
        Command::Doctor(command) => command.run(&common),
        Command::Calibrate(command) => command.run(&common),
        Command::Record(command) => command.run(&common),
        Command::Experiment(command) => command.run(&common),
        Command::Bench(command) => command.run(&common),
        Command::Teach(command) => command.run(&common),
        Command::History(command) => command.run(&common),
        Command::Replay(command) => command.run(&common),
        Command::Recipe(command) => command.run(&common),
        Command::Config(command) => command.run(&common),
        Command::Registers => {
            registers(&common);
            Ok(())
        }
    }
}

fn registers(common: &Common) {
    if common.json {
        say!("{:#}", registers_json());
    } else {
        say!("{}", registers_csv().trim_end());
    }
}

impl Common {
    /// The configuration file, if one is named, with the command line's options over it.
    ///
    /// # Errors
    /// If the file is missing or wrong.
    pub fn configuration(&self) -> Result<Config, Failure> {
        let mut config = match &self.config {
            Some(path) => Config::read(path)?,
            None => Config::default(),
        };
        if let Some(state) = &self.state {
            config.state = Some(state.clone());
        }
        if let Some(listen) = self.modbus {
            config.modbus.listen = listen;
        }
        if let Some(listen) = self.http {
            config.http.listen = listen;
        }
        if let Some(threads) = self.threads {
            config.threads = threads;
        }
        config
            .check()
            .map_err(|error| Failure::new(Exit::Configuration, error))?;
        Ok(config)
    }

    /// The state folder as configured, else the platform's.
    ///
    /// # Errors
    /// If the configuration is wrong or the platform has none.
    pub fn state_folder(&self) -> Result<PathBuf, Failure> {
        match self.configuration()?.state {
            Some(path) => Ok(path),
            None => crate::state::StateFolder::default_path(),
        }
    }

    /// The devices, with the calibration in the state folder unless the configuration names another.
    fn head(&self, config: &Config) -> HeadConfig {
        match self.state_folder() {
            Ok(state) => config.head_in(&state),
            Err(_) => config.head.clone(),
        }
    }

    /// Progress as the user wants it.
    pub fn progress(&self) -> Progress {
        Progress::new(self.quiet)
    }
}

/// A pool of computing threads; 0 = one per core.
///
/// # Errors
/// If the system gives no threads (exit code 70).
fn pool(threads: usize) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|at| format!("computing-{at}"))
        .build()
        .map_err(|error| Failure::because(Exit::Software, "start the computing threads", error))
}
