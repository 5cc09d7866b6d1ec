//! `fringed recipe gauges`: features, datum systems and gauges of a recipe's file as text.

use super::options::{Files, Json};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::Calibration;
use crate::production::backend;
use crate::recipe::archive::{self, Arrays};
use crate::recipe::gauges_toml::{Gauging, MAX_TEXT};
use crate::recipe::golden::TaughtRecipe;
use crate::recipe::plan::{Plan, PlanError};
use crate::recipe::{Recipe, RecipeFile};
use crate::station::{GaugeValue, Inspection};
use crate::storage::folder::write_whole;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

/// Print or replace the features, datum systems and gauges of a recipe's file.
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("way").required(true).args(["get", "set"])))]
pub struct Gauges {
    /// The recipe's file, as `fringed recipe export` writes it.
    #[arg(value_name = "FILE.recipe")]
    recipe: PathBuf,
    /// Print them as TOML.
    #[arg(long)]
    get: bool,
    /// Replace them by those of this file, and print what the part that was taught has. Limits by
    /// golden, masters and these values are measured with the calibration of the configured head.
    #[arg(long, value_name = "FILE.toml")]
    set: Option<PathBuf>,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    json: Json,
}

impl Gauges {
    /// Prints or replaces them. On an error nothing is written.
    ///
    /// # Errors
    /// If a file is missing (66) or has wrong content (65), or the recipe cannot be written (73).
    pub fn run(&self) -> Result<()> {
        match &self.set {
            None => {
                let (file, _) = self.unpacked()?;
                let gauging = Gauging::of(&file);
                match self.json.json {
                    true => say!(
                        "{:#}",
                        json!({ "features": gauging.features, "datums": gauging.datums, "gauges": gauging.gauges })
                    ),
                    false => say!("{}", gauging.to_toml().trim_end()),
                }
                Ok(())
            }
            Some(text) => self.replace(text),
        }
    }

    fn replace(&self, text: &Path) -> Result<()> {
        let gauging = read(text)?;
        let (before, arrays) = self.unpacked()?;
        let what = format!("set the gauges of {}", self.recipe.display());
        let unfit = |error: String| Failure::because(Exit::Content, &what, error);
        // Opened only once it is known that the text fits the recipe.
        let mut opened = None;
        let mut head = || -> Result<Calibration, String> {
            let calibration = self.calibration().map_err(|error| error.to_string())?;
            opened = Some(calibration.clone());
            Ok(calibration)
        };
        let taught = gauging
            .set((before.clone(), arrays), &mut head)
            .map_err(unfit)?;
        let head = match opened {
            Some(calibration) => Ok(calibration),
            None => self.calibration().map_err(|error| error.to_string()),
        };
        let TaughtRecipe {
            bytes,
            manifest,
            recipe,
            ..
        } = taught;
        let (golden, note) = golden(recipe, head).map_err(unfit)?;
        let changed = manifest.differences(&before);
        let same = RecipeFile {
            fingerprint: before.fingerprint.clone(),
            ..manifest.clone()
        } == before;
        let fingerprint = match same {
            true => before.fingerprint,
            false => {
                let what = format!("write {}", self.recipe.display());
                write_whole(&self.recipe, &bytes).map_err(Exit::CannotCreate.because(what))?;
                manifest.fingerprint
            }
        };
        let gauges = golden.iter().flat_map(|golden| &golden.gauges);
        if self.json.json {
            let gauges: Vec<Value> = gauges.map(of_golden).collect();
            let answer = json!({
                "fingerprint": fingerprint, "changed": changed, "gauges": gauges, "note": note,
            });
            say!("{answer:#}");
            return Ok(());
        }
        say!("fingerprint {fingerprint:.8}: {changed}");
        for gauge in gauges {
            say!("{}", words(gauge));
        }
        if let Some(note) = note {
            say!("{note}");
        }
        Ok(())
    }

    fn unpacked(&self) -> Result<(RecipeFile, Arrays)> {
        let file = open(&self.recipe)?;
        let size = file.metadata().map(|found| found.len());
        let what = format!("read {}", self.recipe.display());
        let size = size.map_err(Exit::Missing.because(&what))?;
        archive::unpack(file, size).map_err(Exit::Content.because(&what))
    }

    fn calibration(&self) -> Result<Calibration> {
        backend::calibration(&self.files.head(&self.files.configuration()?))
    }
}

/// What golden has; or nothing, and why, if the recipe was not made on this head.
///
/// # Errors
/// In words: the recipe cannot be used.
fn golden(
    recipe: Recipe,
    head: Result<Calibration, String>,
) -> Result<(Option<Inspection>, Option<String>), String> {
    let unknown = |reason: String| {
        Ok((
            None,
            Some(format!("what golden has is not known: {reason}")),
        ))
    };
    match head.map(|head| Plan::judge_golden(recipe, &head)) {
        Ok(Ok(found)) => Ok((Some(found), None)),
        Ok(Err(error @ PlanError::Unfit { .. })) => Err(error.to_string()),
        Ok(Err(error)) => unknown(error.to_string()),
        Err(reason) => unknown(reason),
    }
}

fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(|error| {
        let exit = match error.kind() {
            ErrorKind::IsADirectory => Exit::Content,
            _ => Exit::Missing,
        };
        Failure::because(exit, format!("open {}", path.display()), error)
    })
}

/// Reads a text of features, datum systems and gauges.
fn read(path: &Path) -> Result<Gauging> {
    let mut text = String::new();
    let what = format!("read {}", path.display());
    let wrong = Exit::Content.because(&what);
    let mut bounded = open(path)?.take(MAX_TEXT + 1);
    bounded
        .read_to_string(&mut text)
        .map_err(Exit::Content.because(&what))?;
    Gauging::from_toml(&text).map_err(wrong)
}

/// What golden has of a gauge.
fn of_golden(gauge: &GaugeValue) -> Value {
    json!({
        "slot": gauge.slot, "name": &*gauge.name, "unit": gauge.unit.symbol(), "value": gauge.value,
        "sigma": gauge.sigma, "uncertainty": gauge.uncertainty, "low": gauge.low, "high": gauge.high,
        "reason": gauge.reason.as_deref(),
    })
}

fn words(gauge: &GaugeValue) -> String {
    let symbol = gauge.unit.symbol();
    let number = |number: Option<f64>| number.map_or("–".into(), |number| format!("{number:.4}"));
    let value = match (gauge.value, gauge.reason.as_deref()) {
        (None, Some(reason)) => reason.to_owned(),
        (value, _) => format!(
            "{} {symbol}, σ {}, U {}",
            number(value),
            number(gauge.sigma),
            number(gauge.uncertainty)
        ),
    };
    format!(
        "{:>2} {}: {value}, limits {} to {}",
        gauge.slot,
        gauge.name,
        number(gauge.low),
        number(gauge.high)
    )
}
