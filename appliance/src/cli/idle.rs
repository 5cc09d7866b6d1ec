//! `fringed idle`: leaves the output lines at their idle levels, for the service manager after the
//! daemon was killed.

use crate::config::Config;
use crate::error::Result;
use crate::production::backend;
use std::path::PathBuf;

/// Leave the output lines at their idle levels: no trigger pulse, busy and ok off, fault on.
#[derive(Debug, clap::Args)]
pub struct Idle {
    /// Configuration file (TOML), which names the lines.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl Idle {
    /// Opens each line at its idle level and releases it.
    ///
    /// # Errors
    /// If the configuration is wrong, or a line cannot be used, for example because a running
    /// station holds it (69).
    pub fn run(&self) -> Result<()> {
        let config = self.config.as_deref().map(Config::read).transpose()?;
        backend::leave_lines_idle(&config.unwrap_or_default())
    }
}
