//! `fringed config check [FILE]` and `fringed config keys`.

use super::options::{Json, Output};
use crate::config::{Backend, Config, keys, table};
use crate::error::Result;
use crate::head::calibration::place::CalibrationPlace;
use crate::production::backend;
use hal::replay::Recording;
use std::path::PathBuf;

/// Check a configuration, or list its keys.
#[derive(Debug, clap::Subcommand)]
pub enum ConfigCommand {
    /// Read a configuration and every file that it names, and say what is wrong.
    Check {
        /// The file.
        file: PathBuf,
        #[command(flatten)]
        output: Output,
    },
    /// List every key with its unit, range and default.
    Keys {
        #[command(flatten)]
        json: Json,
    },
}

impl ConfigCommand {
    /// Checks or lists.
    ///
    /// # Errors
    /// What is wrong with the configuration.
    pub fn run(&self) -> Result<()> {
        match self {
            Self::Keys { json } if json.json => {
                let keys: Vec<_> = keys().collect();
                say!("{:#}", serde_json::json!(keys));
                Ok(())
            }
            Self::Keys { .. } => {
                say!("{}", table().collect::<Vec<_>>().join("\n"));
                Ok(())
            }
            Self::Check { file, output } => {
                let checked = Config::read(file).and_then(|config| check_named_files(&config));
                let problem = checked.as_ref().err();
                let problem = problem.map(|failure| failure.to_string());
                let document = serde_json::json!({
                    "file": file.display().to_string(), "valid": problem.is_none(), "problem": problem,
                });
                if output.is_json() || checked.is_ok() {
                    output.answer(&document, || format!("{} is right", file.display()))?;
                }
                checked
            }
        }
    }
}

fn check_named_files(config: &Config) -> Result<()> {
    backend::built_for(config)?;
    if let Some(calibration) = &config.head.calibration {
        // The file need not exist yet.
        CalibrationPlace::at(calibration).load()?;
    }
    match config.head.backend {
        Backend::Sim => drop(backend::scenario(config.head.scenario.as_deref())?),
        Backend::Replay => {
            for folder in &config.head.recordings {
                Recording::open(folder)?;
            }
        }
        // This back-end names no files. Its devices are not opened, because a running station may
        // hold them.
        Backend::Rpi => {}
    }
    Ok(())
}
