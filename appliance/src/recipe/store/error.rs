//! Why stored recipes cannot be loaded or changed.

use crate::recipe::Refusal;
use std::io;
use std::path::{Path, PathBuf};

/// A recipe that could not be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// There is no such recipe.
    #[error("there is no recipe {0}: teach or import it")]
    Unknown(String),
    /// No generation can be used, and the newer one is damaged.
    #[error("recipe file {path}: {reason}", path = path.display())]
    Corrupt {
        /// The newer file.
        path: PathBuf,
        /// What is wrong with it.
        reason: Refusal,
    },
    /// The newer generation is not damaged, and cannot be used.
    #[error("recipe file {path}: {reason}", path = path.display())]
    Unfit {
        /// The newer file.
        path: PathBuf,
        /// Why it cannot be used, with the remedy.
        reason: Refusal,
    },
    /// Several recipes have the part number, so it selects none of them.
    #[error(
        "recipes {numbers:?} have the part number {part_number:?}: give each its own on the page (Recipes, Edit)"
    )]
    Shared {
        /// The part number.
        part_number: String,
        /// Their numbers.
        numbers: Vec<u16>,
    },
}

/// A change to the stored recipes, an edit, an import or an export that failed; the recipes are
/// unchanged.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// There is no such recipe, or it is damaged.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// There is no generation to restore.
    #[error(
        "undo recipe {0}: no previous generation of it is stored, and it was not deleted: teach or import it"
    )]
    Nothing(u16),
    /// The number has a recipe, which is not to be replaced without being asked for: in words, with
    /// the remedy.
    #[error("{refusal}")]
    Taken {
        /// The number.
        number: u16,
        /// Which recipe has the number, how to replace it, and a number that is free.
        refusal: Refusal,
    },
    /// Another change was stored since the recipe that is edited was read.
    #[error(
        "recipe {0} was changed or deleted by somebody else: load it again and repeat the change"
    )]
    Outdated(u16),
    /// The recipe that is edited, imported or restored cannot be used: why, with the remedy.
    #[error(transparent)]
    Unfit(#[from] Refusal),
    /// The edited recipe cannot be stored.
    #[error("store recipe: {0}: free space")]
    Store(io::Error),
    /// The file that is imported cannot be read.
    #[error("import {path}: {source}: name a recipe file", path = path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file cannot be written, renamed or removed.
    #[error("write {path}: {source}: free space or name another place", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// The failure to write a file.
pub(crate) fn write(path: &Path) -> impl Fn(io::Error) -> ChangeError {
    let path = path.to_path_buf();
    move |source| ChangeError::Write {
        path: path.clone(),
        source,
    }
}
