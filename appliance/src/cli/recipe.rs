//! `fringed recipe`: lists, exports, imports and deletes the station's recipes, undoes changes, and
//! changes the gauges of a file and lists what gauges can measure.
//!
//! A running station uses an imported recipe when it is selected next. Deleting and undoing need a
//! stopped station or its page, because the recipe may be active.

use super::gauges::Gauges;
use super::names;
use super::numbers::number;
use super::options::{Files, Json, Quiet};
use crate::error::{Exit, Failure, Result};
use crate::production::backend;
use crate::recipe::file::kinds;
use crate::recipe::plan::Plan;
use crate::recipe::store::exchange::{Destination, Listed};
use crate::recipe::{ChangeError, LoadError, Store};
use crate::station::control::MAX_RECIPE;
use crate::storage::state::StateFolder;
use std::path::PathBuf;

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
