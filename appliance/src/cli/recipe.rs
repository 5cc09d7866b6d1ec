//! `fringed recipe`: list, export, import and delete the station's recipes. Works while the station runs: it takes up an
//! imported recipe when it is selected.

use super::names;
use super::options::{Files, Json, Quiet};
use crate::backend;
use crate::error::{Exit, Failure};
use crate::plan::Plan;
use crate::recipe::exchange::{ImportError, Listed};
use crate::recipe::{LoadError, Store};
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
    /// Write a recipe to a file.
    Export {
        /// Its number.
        #[arg(value_parser = clap::value_parser!(u16).range(1..=9999))]
        number: u16,
        /// The file, NAME.recipe; one that is there is replaced.
        #[arg(value_parser = names::file("recipe"))]
        file: PathBuf,
        #[command(flatten)]
        files: Files,
        #[command(flatten)]
        quiet: Quiet,
    },
    /// Take a recipe from a file; the one of the same number stays as the previous generation.
    Import {
        /// The file.
        file: PathBuf,
        #[command(flatten)]
        files: Files,
        #[command(flatten)]
        quiet: Quiet,
    },
    /// Delete a recipe with its previous generation.
    Delete {
        /// Its number.
        #[arg(value_parser = clap::value_parser!(u16).range(1..=9999))]
        number: u16,
        #[command(flatten)]
        files: Files,
        #[command(flatten)]
        quiet: Quiet,
    },
}

impl RecipeCommand {
    /// Does it.
    ///
    /// # Errors
    /// If the recipe does not exist (66), is damaged or of another calibration (65), or the store cannot be written (73).
    pub fn run(&self) -> Result<(), Failure> {
        match self {
            Self::List { files, json } => {
                list(&store(files)?.list(), json.json);
                Ok(())
            }
            Self::Export {
                number,
                file,
                files,
                quiet,
            } => {
                store(files)?.export(*number, file).map_err(refused)?;
                quiet.say(|| format!("recipe {number} is in {}", file.display()));
                Ok(())
            }
            Self::Import { file, files, quiet } => {
                let store = store(files)?;
                let head = files.head(&files.configuration()?);
                let calibration = backend::calibration(&head)?;
                let fits = |recipe| {
                    let tried = Plan::try_out(recipe, &calibration);
                    tried.map_err(|error| error.to_string())
                };
                let imported = store.import(file, fits).map_err(refused)?;
                let digits = imported.fingerprint.get(..8).unwrap_or_default();
                quiet.say(|| {
                    format!(
                        "imported recipe {} ({}), fingerprint {digits}",
                        imported.number, imported.name
                    )
                });
                Ok(())
            }
            Self::Delete {
                number,
                files,
                quiet,
            } => {
                store(files)?.delete(*number).map_err(refused)?;
                quiet.say(|| format!("recipe {number} is deleted"));
                Ok(())
            }
        }
    }
}

/// The recipes of the station's state.
fn store(files: &Files) -> Result<Store, Failure> {
    let folder = files.state_folder()?.join("recipes");
    Store::open(&folder).map_err(|error| {
        let what = format!("use the recipes in {}", folder.display());
        Failure::because(Exit::CannotCreate, what, error)
    })
}

fn refused(error: ImportError) -> Failure {
    let exit = match &error {
        ImportError::Load(LoadError::Unknown(_)) => Exit::Missing,
        ImportError::Load(LoadError::Corrupt { .. }) | ImportError::Refused { .. } => Exit::Content,
        ImportError::Missing { .. } => Exit::Missing,
        ImportError::Write { .. } => Exit::CannotCreate,
    };
    Failure::new(exit, error.to_string())
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
