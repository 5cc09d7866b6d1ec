//! `fringed-fleet collect`: fetch the results of every head and write them to the store.

use crate::error::{Exit, Result};

/// Fetch the results of every head and write them to the store.
#[derive(Debug, clap::Args)]
pub struct Collect {}

impl Collect {
    /// Runs the command.
    ///
    /// # Errors
    /// Always: it is not there yet.
    pub fn run(&self) -> Result<()> {
        Exit::Software.fail("not there yet")
    }
}
