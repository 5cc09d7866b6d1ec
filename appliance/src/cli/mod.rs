//! The command line.

/// Prints a line of the result, which may have text of a file: nothing of it commands a terminal. A
/// pipe that the reader has closed is not an error.
macro_rules! say {
    ($($argument:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($argument)*);
        let _ = writeln!(std::io::stdout(), "{}", crate::system::stderr::plain(&text));
    }};
}

mod backup;
mod calibrate;
mod changes;
mod completions;
mod config;
mod demo;
mod doctor;
mod history;
mod measure;
pub mod names;
pub mod numbers;
mod options;
mod recipe;
mod record;
mod registers;
mod replay;
mod serve;
mod study;
mod teach;

pub use calibrate::model_files;
pub use completions::{Completions, Manual};
pub use options::{Files, Output, Quiet, Threads};

use crate::VERSION;
use crate::error::{Exit, Result};
use crate::system::journal::{self, Severity};
use crate::system::stderr;
use algo::phase::DecodeError;
use algo::simd::Backend;
use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory as _, Parser, Subcommand};
use std::process::ExitCode;

/// The open 3-D smart sensor.
#[derive(Debug, Parser)]
#[command(name = "fringed", version = VERSION, after_help = MORE)]
struct Arguments {
    /// What to do; without a command: serve.
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    serve: serve::Serve,
}

/// Below the options of `fringed --help`, which are those of `serve`.
const MORE: &str = "These are the options of serve; `fringed help COMMAND` lists those of a command. They may stand before the command \
                    as well as behind it.";

/// Defines the commands, each by the struct that runs it.
macro_rules! commands {
    ($($(#[$meta:meta])* $name:ident($options:ty);)*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($(#[$meta])* $name($options),)*
            /// Print what makes a shell complete the command line.
            Completions(Completions),
            /// Write the manual pages.
            #[command(hide = true)]
            Manual(Manual),
        }

        impl Command {
            fn run(self) -> Result<()> {
                match self {
                    $(Self::$name(options) => options.run(),)*
                    Self::Completions(options) => options.run(Arguments::command()),
                    Self::Manual(options) => options.run(Arguments::command()),
                }
            }
        }
    };
}

commands! {
    /// Run the station: Modbus TCP for the PLC, a page for the technician.
    Serve(serve::Serve);
    /// Run the station and play the PLC: ten parts, three of them defective.
    Demo(demo::Demo);
    /// Measure a recording: phase, height, picture, point cloud and report.
    Measure(measure::Measure);
    /// Examine the head step by step.
    Doctor(doctor::Doctor);
    /// Calibrate the head: make models from a board or import them, measure the rest.
    Calibrate(calibrate::Calibrate);
    /// Draw a checkerboard to print, for `calibrate --board`.
    Board(calibrate::Print);
    /// Record a sequence from the configured head.
    Record(record::Record);
    /// Make a recipe from a good part in front of the head, or from recordings.
    Teach(teach::Teach);
    /// Show or export stored results.
    History(history::HistoryOptions);
    /// Release a station for production: capability of a gauge, Gage R&R, process.
    #[command(subcommand)]
    Study(study::StudyCommand);
    /// Show or check the record of changes: who changed what and when.
    Changes(changes::Changes);
    /// Back up what the device has learned, or check a backup.
    Backup(backup::Backup);
    /// Judge a part that did not pass again and compare with the history.
    Replay(replay::Replay);
    /// List, export, import or delete recipes, undo that, or change the gauges of one.
    #[command(subcommand)]
    Recipe(recipe::RecipeCommand);
    /// Check a configuration, or list its keys.
    #[command(subcommand)]
    Config(config::ConfigCommand);
    /// Leave the output lines at their idle levels: no trigger pulse, busy and ok off, fault on.
    Idle(serve::Idle);
    /// Print the register map as CSV (or JSON with --json), or as tags to import.
    Registers(registers::Registers);
}

/// Commands of `fringed-lab` that `fringed` once had.
const LABORATORY: [&str; 6] = [
    "adapt",
    "bench",
    "capture",
    "experiment",
    "import",
    "patterns",
];

/// Runs the program `fringed`.
pub fn main() -> ExitCode {
    start(run)
}

/// Parses the arguments of this process, runs the command and returns its exit code. Options may
/// stand before the command or after it.
pub fn start<A: Parser>(run: impl FnOnce(A) -> Result<()>) -> ExitCode {
    crate::system::computing::give_back();
    journal::take_panics();
    let code = carry_out(run);
    stderr::end();
    code
}

fn carry_out<A: Parser>(run: impl FnOnce(A) -> Result<()>) -> ExitCode {
    let words = options::behind_the_command(&A::command(), std::env::args_os());
    let arguments = match A::try_parse_from(words) {
        Ok(arguments) => arguments,
        Err(error) => return refused(&error),
    };
    match known_processor().and_then(|()| run(arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            journal::write_of(
                A::command().get_name(),
                Severity::Error,
                &failure.to_string(),
            );
            failure.exit.into()
        }
    }
}

/// Refuses a processor that phases cannot be computed with.
fn known_processor() -> Result<()> {
    match Backend::best() {
        Some(_) => Ok(()),
        None => Exit::Unavailable.fail(DecodeError::Processor),
    }
}

/// Reports what is wrong with the arguments, or prints the help or version that they ask for.
fn refused(error: &clap::Error) -> ExitCode {
    if let Some(ContextValue::String(name)) = error.get(ContextKind::InvalidSubcommand)
        && LABORATORY.contains(&name.as_str())
    {
        let remedy = format!("{name} is a command of another program: run fringed-lab {name}");
        journal::write(Severity::Error, &remedy);
        return Exit::Usage.into();
    }
    // If stdout or stderr is closed, there is nothing to do about it.
    let _ = error.print();
    if error.use_stderr() {
        Exit::Usage.into()
    } else {
        ExitCode::SUCCESS
    }
}

fn run(arguments: Arguments) -> Result<()> {
    match arguments.command {
        None => arguments.serve.run(),
        Some(command) => command.run(),
    }
}

#[cfg(test)]
mod tests;
