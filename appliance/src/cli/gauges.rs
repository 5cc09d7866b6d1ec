//! `fringed recipe gauges`: features, datum systems and gauges of a recipe's file as text.

use super::options::Json;
use crate::error::{Exit, Failure, Result};
use crate::recipe::RecipeFile;
use crate::recipe::Refusal;
use crate::recipe::file::archive;
use crate::recipe::file::archive::Arrays;
use crate::recipe::file::gauges_toml::{Gauging, MAX_TEXT};
use crate::recipe::plan::Plan;
use crate::recipe::teach::golden::TaughtRecipe;
use crate::station::GaugeValue;
use crate::storage::folder::write_whole;
use crate::system::headway::Headway;
use serde_json::{Value, json};
use std::fs::{File, Metadata, TryLockError};
use std::io::{ErrorKind, Read as _};
use std::os::unix::fs::MetadataExt as _;
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
    /// Replace them by those of this file, and print what the part that was taught has.
    #[arg(long, value_name = "FILE.toml")]
    set: Option<PathBuf>,
    #[command(flatten)]
    json: Json,
}

impl Gauges {
    /// Prints or replaces them. On an error nothing is written.
    ///
    /// # Errors
    /// If a file is missing (66) or has wrong content (65), another program changes the recipe (69), or it cannot be
    /// written (73).
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
        let what = format!("set the gauges of {}", self.recipe.display());
        // A link stays, and what it leads to is replaced.
        let target = self.recipe.canonicalize();
        let target = target.map_err(Exit::Missing.because(&what))?;
        let _alone = alone(&target, &what)?;
        let (before, arrays) = self.unpacked()?;
        let unfit = |error: Refusal| Failure::because(Exit::Content, &what, error);
        let TaughtRecipe {
            bytes,
            manifest,
            recipe,
            ..
        } = gauging.set(&before, arrays).map_err(unfit)?;
        let head = manifest.head().map_err(unfit)?;
        let golden = Plan::golden(recipe, &head, Headway::silent());
        let mut golden = golden.map_err(|error| unfit(error.into()))?;
        let (golden, features) = golden.judged((&manifest).into());
        let changed = manifest.differences(&before);
        let same = RecipeFile {
            fingerprint: before.fingerprint.clone(),
            ..manifest.clone()
        } == before;
        let fingerprint = match same {
            true => before.fingerprint,
            false => {
                let what = format!("write {}", self.recipe.display());
                write_whole(&target, &bytes).map_err(Exit::CannotCreate.because(what))?;
                manifest.fingerprint
            }
        };
        if self.json.json {
            let gauges: Vec<Value> = golden.gauges.iter().map(of_golden).collect();
            let answer = json!({
                "fingerprint": fingerprint, "changed": changed, "gauges": gauges, "features": features,
            });
            say!("{answer:#}");
            return Ok(());
        }
        say!("fingerprint {fingerprint:.8}: {changed}");
        for gauge in &golden.gauges {
            say!("{}", words(gauge));
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
}

/// Keeps other programs from changing this file until the answer is dropped: what two of them read would be
/// written by the last one alone.
fn alone(recipe: &Path, what: &str) -> Result<File> {
    let file = open(recipe)?;
    let busy = "another program is changing it: try again when that has ended";
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Exit::Unavailable.fail(format!("{what}: {busy}"));
    }
    // Replaced between opening and locking.
    let id = |about: std::io::Result<Metadata>| about.map(|about| (about.dev(), about.ino())).ok();
    match id(file.metadata()) == id(recipe.metadata()) {
        true => Ok(file),
        false => Exit::Unavailable.fail(format!("{what}: {busy}")),
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
