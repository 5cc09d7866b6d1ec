//! `fringed-fleet schema`: print the tables and views of a store.

use crate::error::{Exit, Result};

/// Print the tables and views of a store.
#[derive(Debug, clap::Args)]
pub struct Schema {}

impl Schema {
    /// Runs the command.
    ///
    /// # Errors
    /// Always: it is not there yet.
    pub fn run(&self) -> Result<()> {
        Exit::Software.fail("not there yet")
    }
}
