//! The program `fringed-fleet`: collects the results of many heads into one store, says how the
//! heads are, and keeps their recipes.
//!
//! Heads open no connection; they answer. A collector asks each for the results behind the last
//! that the store has, so it keeps no state of its own, and whatever it writes twice the store
//! folds by the key (serial, history, seq).

/// Prints a line of the result. A pipe that the reader has closed is not an error.
macro_rules! say {
    ($($argument:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($argument)*);
    }};
}

/// ms since 1970 UTC; 0 if the clock is before that.
fn now_ms() -> u64 {
    let since = std::time::UNIX_EPOCH.elapsed();
    since.map_or(0, |since| since.as_millis() as u64)
}

pub mod answer;
pub mod backup;
pub mod collect;
pub mod config;
pub mod error;
pub mod http;
pub mod log;
pub mod part;
pub mod status;
pub mod store;

use backup::Backup;
use clap::{CommandFactory as _, Parser, Subcommand};
use collect::Collect;
use error::{Exit, Result};
use log::Severity;
use status::Status;
use std::path::PathBuf;
use std::process::ExitCode;
use store::{Kind, schema};

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
    /// Print the tables and views of a store.
    Schema {
        /// What the store is made of.
        #[arg(long, value_enum)]
        store: Kind,
    },
    /// Write the manual pages.
    #[command(hide = true)]
    Manual {
        /// The folder for them.
        folder: PathBuf,
    },
}

/// At the end of the program's page: [`Exit`] in words.
const EXIT_STATUS: &str = "Exit status:

0: done.

64: the command line is wrong.

65: an answer or a store has wrong content.

66: the named file does not exist, or the store has no heads.

69: a head or the store cannot be reached, or a port is in use.

70: the program itself is at fault.

73: output cannot be created.

78: the configuration is wrong.";

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
        Command::Schema { store } => {
            say!("{}", schema(store).trim_end());
            Ok(())
        }
        Command::Manual { folder } => {
            let program = Arguments::command().after_long_help(EXIT_STATUS);
            let what = format!("write manual pages to {}", folder.display());
            clap_mangen::generate_to(program, folder).map_err(Exit::CannotCreate.because(what))
        }
    }
}
