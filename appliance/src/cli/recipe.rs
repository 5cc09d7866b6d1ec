//! `fringed recipe`: lists, exports, imports and deletes the station's recipes, undoes changes, and
//! changes the gauges of a file and lists what gauges can measure.
//!
//! A running station uses an imported recipe when it is selected next. Deleting and undoing need a
//! stopped station or its page, because the recipe may be active.

use super::names;
use super::numbers::number;
use super::options::{Files, Json, Quiet};
use crate::access::Change;
use crate::error::{Exit, Failure, Result};
use crate::production::backend;
use crate::recipe::file::archive::{self, Arrays};
use crate::recipe::file::gauges_toml::{Gauging, MAX_TEXT};
use crate::recipe::file::kinds;
use crate::recipe::plan::Plan;
use crate::recipe::store::exchange::{Destination, Listed};
use crate::recipe::teach::golden::TaughtRecipe;
use crate::recipe::{ChangeError, LoadError, RecipeFile, Refusal, Store};
use crate::station::GaugeValue;
use crate::station::control::MAX_RECIPE;
use crate::storage::folder::write_whole;
use crate::storage::state::StateFolder;
use crate::system::headway::Headway;
use serde_json::{Value, json};
use std::fs::{File, Metadata, TryLockError};
use std::io::{ErrorKind, Read as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// What to do with recipes.
#[derive(Debug, clap::Subcommand)]
pub enum RecipeCommand {
    /// List the stored recipes.
    List {
        #[command(flatten)]
        files: Files,
        #[command(flatten)]
        json: Json,
    },
    /// List what gauges can measure, with the parameters of each kind.
    Kinds {
        #[command(flatten)]
        json: Json,
    },
    /// Write a recipe to a file.
    Export {
        #[command(flatten)]
        recipe: Numbered,
        /// The file, NAME.recipe; one that is there is replaced.
        #[arg(value_parser = names::file("recipe"))]
        file: PathBuf,
    },
    /// Take a recipe from a file.
    Import {
        /// The file.
        file: PathBuf,
        /// Store it under this number instead of the one in the file.
        #[arg(long, value_parser = number(1, MAX_RECIPE))]
        number: Option<u16>,
        /// Replace the recipe that has this number; it stays as the previous generation, `fringed
        /// recipe undo` brings it back.
        #[arg(long)]
        replace: bool,
        #[command(flatten)]
        files: Files,
        #[command(flatten)]
        quiet: Quiet,
    },
    Gauges(Gauges),
    /// Delete a recipe; `undo` brings it back. Not while a station runs: its page deletes recipes
    /// as well.
    Delete(Numbered),
    /// Bring back a deleted recipe, or the previous generation; the same again takes it back. Not
    /// while a station runs: its page undoes as well.
    Undo(Numbered),
}

/// A stored recipe by its number.
#[derive(Debug, clap::Args)]
pub struct Numbered {
    /// Its number.
    #[arg(value_parser = number(1, MAX_RECIPE))]
    number: u16,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    quiet: Quiet,
}

impl RecipeCommand {
    /// Does it.
    ///
    /// # Errors
    /// If the recipe does not exist (66), is damaged or of another calibration (65), a station has
    /// it in use (69), or the store cannot be written (73).
    pub fn run(&self) -> Result<()> {
        match self {
            Self::List { files, json } => {
                list(&store(files)?.list(), json.json);
                Ok(())
            }
            Self::Kinds { json } => {
                match json.json {
                    true => say!("{:#}", kinds::json()),
                    false => say!("{}", kinds::table()),
                }
                Ok(())
            }
            Self::Export { recipe, file } => {
                let number = recipe.number;
                store(&recipe.files)?.export(number, file)?;
                let words = || format!("recipe {number} is in {}", file.display());
                recipe.quiet.say(words);
                Ok(())
            }
            Self::Import {
                file,
                number,
                replace,
                files,
                quiet,
            } => {
                let store = store(files)?;
                let head = files.head(&files.configuration()?);
                let calibration = backend::calibration(&head)?;
                let fits = |recipe| Ok(Plan::try_out(recipe, &calibration)?);
                let to = Destination {
                    number: *number,
                    replace: *replace,
                };
                let imported = store.import(file, to, "add --replace", fits)?;
                let id = &imported.id;
                files.note(&Change {
                    changed: Some(imported.changed()),
                    fingerprint: Some(id.fingerprint.clone()),
                    ..Change::of_command("import recipe", format!("recipes/{}", id.number))
                });
                let digits = id.fingerprint.get(..8).unwrap_or_default();
                let note = imported.note();
                let note = note.map_or_else(String::new, |note| format!(": {note}"));
                quiet.say(|| {
                    format!(
                        "imported recipe {} ({}), fingerprint {digits}{note}",
                        id.number, id.name
                    )
                });
                Ok(())
            }
            Self::Gauges(gauges) => gauges.run(),
            Self::Delete(recipe) => {
                let number = recipe.number;
                let state = at_rest(&recipe.files, "Delete")?;
                Store::of_state(&state)?.delete(number)?;
                let subject = format!("recipes/{number}");
                recipe
                    .files
                    .note(&Change::of_command("delete recipe", subject));
                let undo = format!("`fringed recipe undo {number}` brings it back");
                let words = || format!("recipe {number} is deleted; {undo}");
                recipe.quiet.say(words);
                Ok(())
            }
            Self::Undo(recipe) => {
                let number = recipe.number;
                let state = at_rest(&recipe.files, "Undo")?;
                let head = recipe.files.head(&recipe.files.configuration()?);
                let calibration = backend::calibration(&head).ok();
                let calibration = calibration.map(|calibration| calibration.fingerprint());
                let store = Store::of_state(&state)?;
                let file = store.undo(number, calibration.as_deref())?;
                recipe.files.note(&Change {
                    changed: Some(format!("fingerprint {:.8}", file.fingerprint)),
                    ..Change::of_command("undo recipe", format!("recipes/{number}"))
                });
                let digits = file.fingerprint.get(..8).unwrap_or_default();
                recipe.quiet.say(|| {
                    format!(
                        "recipe {number} ({}) is the one with fingerprint {digits} again",
                        file.name
                    )
                });
                Ok(())
            }
        }
    }
}

/// The recipes of the station's state.
fn store(files: &Files) -> Result<Store> {
    let folder = files.state_folder()?.join("recipes");
    let what = format!("use the recipes in {}", folder.display());
    Store::open(&folder).map_err(Exit::CannotCreate.because(what))
}

/// The state folder, locked against stations.
fn at_rest(files: &Files, button: &str) -> Result<StateFolder> {
    let instead = format!("use *Recipes*, *{button}* on its page");
    StateFolder::open_unless_used(&files.state_folder()?, Exit::Unavailable, &instead)
}

impl From<ChangeError> for Failure {
    fn from(error: ChangeError) -> Self {
        let exit = match &error {
            ChangeError::Load(LoadError::Unknown(_))
            | ChangeError::Nothing(_)
            | ChangeError::Missing { .. } => Exit::Missing,
            ChangeError::Load(_) | ChangeError::Outdated(_) | ChangeError::Unfit(_) => {
                Exit::Content
            }
            ChangeError::Store(_) | ChangeError::Write { .. } | ChangeError::Taken { .. } => {
                Exit::CannotCreate
            }
        };
        Self::new(exit, error)
    }
}

fn list(recipes: &[Listed], json: bool) {
    if json {
        say!("{:#}", serde_json::json!({ "recipes": recipes }));
        return;
    }
    say!(
        "number  part number                       fingerprint  sequence      σ_z mm  gauges  name"
    );
    for recipe in recipes {
        match &recipe.problem {
            None => say!(
                "{:>6}  {:<32}  {:<11.8}  {:<12}  {:>6.4}  {:>6}  {}",
                recipe.number,
                recipe.part_number,
                recipe.fingerprint,
                recipe.sequence,
                recipe.sigma_mm,
                recipe.gauges,
                recipe.name
            ),
            Some(problem) => say!("{:>6}  cannot be used: {problem}", recipe.number),
        }
    }
}

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
        let golden = Plan::golden(recipe, &head, false, Headway::silent());
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
