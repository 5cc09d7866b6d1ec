//! `fringed completions SHELL`: what makes a shell complete the command line.

use clap_complete::{Shell, generate};

/// Print what makes a shell complete the command line.
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    /// Prints the script for all commands and options of `program`.
    pub fn run(&self, program: &mut clap::Command) {
        let mut script = Vec::new();
        generate(self.shell, program, "fringed", &mut script);
        say!("{}", String::from_utf8_lossy(&script).trim_end());
    }
}
