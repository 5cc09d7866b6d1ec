//! `fringed completions SHELL` and the hidden `fringed manual FOLDER`: what a package says of the
//! command line, to a shell and to man(1).

use crate::error::{Exit, Result};
use clap_complete::{Shell, generate};
use std::path::PathBuf;

/// Print what makes a shell complete the command line.
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// The shell that the script is for.
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    /// Prints the script for all commands and options of `program`.
    ///
    /// # Errors
    /// None.
    pub fn run(&self, mut program: clap::Command) -> Result<()> {
        let name = program.get_name().to_owned();
        let mut script = Vec::new();
        generate(self.shell, &mut program, name, &mut script);
        say!("{}", String::from_utf8_lossy(&script).trim_end());
        Ok(())
    }
}

/// Write the manual pages.
#[derive(Debug, clap::Args)]
pub struct Manual {
    /// The folder for them.
    folder: PathBuf,
}

/// At the end of a program's page: [`Exit`] in words.
const EXIT_STATUS: &str = "Exit status:

0: done.

64: the command line is wrong.

65: a recording, recipe or calibration has wrong content.

66: the named folder or file does not exist.

69: a port is in use or a device missing, or the processor is older than SSSE3.

70: the program itself is at fault.

73: output or state cannot be created.

78: the configuration is wrong.";

impl Manual {
    /// Writes a page for `program` and one for each of its commands.
    ///
    /// # Errors
    /// If they cannot be written (exit code 73).
    pub fn run(&self, program: clap::Command) -> Result<()> {
        let what = format!("write manual pages to {}", self.folder.display());
        let before = program.get_after_help().map(ToString::to_string);
        let paragraphs = before.into_iter().chain([EXIT_STATUS.to_owned()]);
        let end = paragraphs.collect::<Vec<_>>().join("\n\n");
        clap_mangen::generate_to(program.after_long_help(end), &self.folder)
            .map_err(Exit::CannotCreate.because(what))
    }
}
