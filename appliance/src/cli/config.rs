//! `fringed config check [FILE]` and `fringed config keys`.

use super::Common;
use crate::backend;
use crate::calibration::place::Place;
use crate::config::{Backend, Config, keys, table};
use crate::error::{Exit, Failure};
use hal::replay::Recording;
use std::path::PathBuf;

/// Check a configuration, or list its keys.
#[derive(Debug, clap::Subcommand)]
pub enum ConfigCommand {
    /// Read a configuration and every file that it names, and say what is wrong.
    Check {
        /// The file; without it, the one of --config.
        file: Option<PathBuf>,
    },
    /// List every key with its unit, range and default.
    Keys,
}

impl ConfigCommand {
    /// Checks or lists.
    ///
    /// # Errors
    /// What is wrong with the configuration.
    pub fn run(&self, common: &Common) -> Result<(), Failure> {
        match self {
            Self::Keys if common.json => {
                let keys: Vec<_> = keys()
                    .map(|key| {
                        serde_json::json!({
                            "name": key.name, "unit": key.unit, "range": key.range,
                            "default": key.default, "meaning": key.meaning,
                        })
                    })
                    .collect();
                say!("{:#}", serde_json::Value::from(keys));
            }
            Self::Keys => say!("{}", table().trim_end()),
            Self::Check { file } => {
                let Some(path) = file.as_ref().or(common.config.as_ref()) else {
                    return Err(Failure::new(
                        Exit::Usage,
                        "config check: name a file: `fringed config check FILE`",
                    ));
                };
                check_named_files(&Config::read(path)?)?;
                if !common.quiet {
                    say!("{} is right", path.display());
                }
            }
        }
        Ok(())
    }
}

fn check_named_files(config: &Config) -> Result<(), Failure> {
    backend::built_for(config)?;
    if let Some(calibration) = &config.head.calibration {
        let wrong = |problem| Failure::new(Exit::Content, problem);
        // It need not be there yet.
        Place::at(calibration).load().map_err(wrong)?;
    }
    match config.head.backend {
        Backend::Sim => drop(backend::scenario(config.head.scenario.as_deref())?),
        Backend::Replay => {
            for folder in &config.head.recordings {
                Recording::open(folder)?;
            }
        }
        // It names no files. Its devices are not opened: a station that runs may hold them.
        Backend::Rpi => {}
    }
    Ok(())
}
