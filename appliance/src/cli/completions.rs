//! `fringed completions SHELL`: a script with which a shell completes the command line.

use crate::error::Result;
use clap_complete::{Shell, generate};

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
