//! The stored recipes of a station: a folder with a file `NNNN.recipe` for each, and its previous
//! generation.
//!
//! No recipe is ever half stored: a temporary name, sync, rename, sync of the folder. The generation
//! before stays.

mod error;
pub mod exchange;
pub mod generations;
pub mod incoming;

pub(crate) use error::write;
pub use error::{ChangeError, LoadError};

use crate::error::{Exit, Result};
use crate::recipe::file::archive;
use crate::recipe::file::refusal::refused;
use crate::recipe::{Recipe, RecipeFile, Refusal};
use crate::storage::folder::write_whole;
use crate::storage::state::StateFolder;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The folder of recipes.
#[derive(Clone, Debug)]
pub struct Store {
    pub(crate) folder: PathBuf,
}

/// Identifies the content of a stored recipe's file without reading all of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    number: u16,
    bytes: u64,
    modified: std::time::SystemTime,
    fingerprint: String,
}

impl Stamp {
    /// The file's size.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// A loaded recipe.
#[derive(Clone, Debug)]
pub struct LoadedRecipe {
    /// Its manifest.
    pub file: RecipeFile,
    /// Its checked form.
    pub recipe: Recipe,
    /// If this is the previous generation: why the newest could not be used.
    pub fallback: Option<String>,
}

impl Store {
    /// The store in a folder; one that does not exist yet has no recipes.
    pub fn at(folder: &Path) -> Self {
        Self {
            folder: folder.to_path_buf(),
        }
    }

    /// Opens the folder, creating it where it does not exist.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn open(folder: &Path) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        Ok(Self::at(folder))
    }

    /// Opens the recipes of a state folder and removes what an interrupted import left behind.
    ///
    /// # Errors
    /// If the folder cannot be created or written (exit code 73).
    pub fn of_state(state: &StateFolder) -> Result<Self> {
        let folder = state.path().join("recipes");
        let opened =
            Self::open(&folder).and_then(|store| store.remove_left_behind().map(|()| store));
        let what = format!("open the state folder {}", state.path().display());
        let remedy = "name one that can be written with --state";
        opened.map_err(Exit::CannotCreate.advising(what, remedy))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub(crate) fn path(&self, number: u16) -> PathBuf {
        self.folder.join(format!("{number:04}.recipe"))
    }

    /// The paths of a recipe's generations, the newest first; the files need not exist.
    pub fn generations(&self, number: u16) -> [PathBuf; 3] {
        [self.path(number), self.previous(number), self.kept(number)]
    }

    /// Stores a packed recipe under its number; the recipe that had it stays as the previous
    /// generation.
    ///
    /// # Errors
    /// Errors of the file system; the stored recipe is then unchanged.
    pub fn save(&self, number: u16, bytes: &[u8]) -> io::Result<()> {
        let _alone = self.lock()?;
        self.put(number, bytes)
    }

    /// Stores a packed recipe in place of the one with the fingerprint `base`. Returns `false`,
    /// storing nothing, if another one was stored or the recipe was deleted since `base` was read.
    /// Comparing and storing happen under one lock, so that one of two clients with the same base
    /// is refused.
    ///
    /// # Errors
    /// As [`Store::save`].
    pub fn replace(&self, number: u16, base: &str, bytes: &[u8]) -> io::Result<bool> {
        let _alone = self.lock()?;
        let stored = self.is_newest(number, base);
        if stored {
            self.put(number, bytes)?;
        }
        Ok(stored)
    }

    pub(crate) fn put(&self, number: u16, bytes: &[u8]) -> io::Result<()> {
        self.keep_previous(number)?;
        write_whole(&self.path(number), bytes)
    }

    /// Whether the newest generation that is whole has this fingerprint.
    fn is_newest(&self, number: u16, fingerprint: &str) -> bool {
        let has =
            |path: &Path| manifest_at(path).is_some_and(|file| file.fingerprint == fingerprint);
        // Almost always it is the newest file; the whole file is hashed only if that one does not
        // have the fingerprint.
        has(&self.path(number)) || self.whole(number).is_ok_and(|whole| has(&whole))
    }

    /// Keeps other processes from changing the recipes until the returned file is dropped.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn lock(&self) -> io::Result<fs::File> {
        let lock = fs::File::create(self.folder.join("lock"))?;
        lock.lock()?;
        Ok(lock)
    }

    /// Loads a recipe by number. If the newest generation is damaged, the previous one is loaded,
    /// and [`LoadedRecipe::fallback`] says why.
    ///
    /// # Errors
    /// If there is none, no generation can be used, or the recipe cannot judge. The previous
    /// generation is not used in the last case: it may judge by other limits.
    pub fn load(&self, number: u16) -> Result<LoadedRecipe, LoadError> {
        let loaded = self.load_to_edit(number)?;
        refuse_judging(&self.path(number), &loaded.file)?;
        Ok(loaded)
    }

    /// As [`Self::load`] without checking whether the recipe can judge: an edit may be about to
    /// correct it.
    ///
    /// # Errors
    /// If there is none, or no generation can be used.
    pub fn load_to_edit(&self, number: u16) -> Result<LoadedRecipe, LoadError> {
        let path = self.path(number);
        let newest = Self::read(&path, number);
        if let Some(Ok((file, recipe))) = newest {
            return Ok(LoadedRecipe {
                file,
                recipe,
                fallback: None,
            });
        }
        let reason = newest.and_then(Result::err);
        match Self::read(&self.previous(number), number) {
            Some(Ok((file, recipe))) => Ok(LoadedRecipe {
                file,
                recipe,
                fallback: Some(format!(
                    "recipe file {} {}; the previous generation is used",
                    path.display(),
                    reason
                        .as_ref()
                        .map_or("is missing", |reason| &*reason.words)
                )),
            }),
            _ => match reason {
                None => Err(LoadError::Unknown(number.to_string())),
                Some(reason) if is_undamaged(&path) => Err(LoadError::Unfit { path, reason }),
                Some(reason) => Err(LoadError::Corrupt { path, reason }),
            },
        }
    }

    /// Loads the generation of a recipe that has this fingerprint.
    ///
    /// # Errors
    /// If no stored generation has it.
    pub fn load_fingerprint(&self, number: u16, fingerprint: &str) -> Result<Recipe, LoadError> {
        let same = |(file, _): &(RecipeFile, Recipe)| file.fingerprint == fingerprint;
        let paths = self.generations(number);
        let found = paths
            .iter()
            .find_map(|path| Some((path, Self::read(path, number)?.ok().filter(same)?)));
        let (path, (file, recipe)) = found.ok_or_else(|| {
            let digits = fingerprint.get(..8).unwrap_or(fingerprint);
            LoadError::Unknown(format!("{number} with fingerprint {digits}"))
        })?;
        refuse_judging(path, &file)?;
        Ok(recipe)
    }

    /// The stamp of a recipe's newest file; while it stays equal, loading gives the same recipe.
    pub fn stamp(&self, number: u16) -> Option<Stamp> {
        let file = fs::File::open(self.path(number)).ok()?;
        let found = file.metadata().ok()?;
        Some(Stamp {
            number,
            bytes: found.len(),
            modified: found.modified().ok()?,
            fingerprint: archive::manifest(file).ok()?.fingerprint,
        })
    }

    /// The recipe in a file and its manifest, if the file exists.
    pub(crate) fn read(path: &Path, number: u16) -> Option<Result<(RecipeFile, Recipe), Refusal>> {
        let opened = fs::File::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (size, file) = match opened {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => return Some(Err(error.into())),
            Ok(opened) => opened,
        };
        Some(match Recipe::read_to_edit(io::BufReader::new(file), size) {
            Ok((file, _)) if file.number != number => refused!(
                "holds recipe {}: rename it to {:04}.recipe",
                file.number,
                file.number
            ),
            read => read,
        })
    }

    /// The manifest of a recipe, without checking the rest: for lists.
    ///
    /// # Errors
    /// In words: there is none, or it cannot be read.
    pub fn manifest(&self, number: u16) -> Result<RecipeFile, Refusal> {
        let file = fs::File::open(self.path(number))
            .map_err(|error| format!("recipe {number}: {error}: teach or import it"))?;
        archive::manifest(file)
    }

    /// Opens the newest file of a recipe as it is, to be exported.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn file(&self, number: u16) -> io::Result<fs::File> {
        fs::File::open(self.path(number))
    }

    /// The number of the recipe taught for a part number.
    ///
    /// # Errors
    /// If no recipe has it, or several have.
    pub fn find(&self, part_number: &str) -> Result<u16, LoadError> {
        let numbers = self.holders(part_number);
        let part_number = part_number.to_owned();
        match *numbers {
            [number] => Ok(number),
            [] => Err(LoadError::Unknown(format!(
                "for part number {part_number:?}"
            ))),
            _ => Err(LoadError::Shared {
                part_number,
                numbers,
            }),
        }
    }

    /// The numbers of the recipes that have this part number, in order; none have an empty one.
    fn holders(&self, part_number: &str) -> Vec<u16> {
        let mut numbers = self.numbers();
        numbers.retain(|&number| {
            let file = manifest_at(&self.path(number)).filter(|_| !part_number.is_empty());
            file.is_some_and(|file| file.part_number == part_number)
        });
        numbers
    }

    /// Refuses to give a recipe a part number that another one has: a PLC selects by it. A recipe
    /// may keep the one that it has.
    ///
    /// # Errors
    /// In words: which recipe has it, with the remedy.
    pub fn refuse_shared(&self, number: u16, part_number: &str) -> Result<(), Refusal> {
        match self.other_holder(number, part_number) {
            None => Ok(()),
            Some(other) => refused!(
                "recipe {other} has the part number {part_number:?}, by which a PLC selects: give one of them another part number, or \
                 delete recipe {other}"
            ),
        }
    }

    /// The recipe that has a part number which recipe `number` does not have; `None` if it may have
    /// it.
    pub(crate) fn other_holder(&self, number: u16, part_number: &str) -> Option<u16> {
        let holders = self.holders(part_number);
        match holders.contains(&number) {
            true => None,
            false => holders.first().copied(),
        }
    }

    /// The numbers of all stored recipes, in order.
    pub fn numbers(&self) -> Vec<u16> {
        self.numbers_with(&["", ".previous"])
    }

    /// The numbers of the files that end in `.recipe` and one of `endings`, in order.
    pub(crate) fn numbers_with(&self, endings: &[&str]) -> Vec<u16> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut numbers: Vec<u16> = entries
            .filter_map(|entry| {
                let name = entry.file_name();
                let (number, rest) = name.to_str()?.split_once(".recipe")?;
                // Other endings are files that a loss of power left half written.
                endings.contains(&rest).then(|| number.parse().ok())?
            })
            .collect();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    }
}

/// The manifest of a recipe's file, if it can be read.
pub(crate) fn manifest_at(path: &Path) -> Option<RecipeFile> {
    archive::manifest(fs::File::open(path).ok()?).ok()
}

/// Whether the content of a recipe's file agrees with its fingerprint.
pub(crate) fn is_sound(path: &Path) -> bool {
    fs::File::open(path).is_ok_and(|file| archive::is_sound(io::BufReader::new(file)))
}

/// Whether the content of a recipe's file agrees with the fingerprint that it states, even if it
/// cannot be used.
fn is_undamaged(path: &Path) -> bool {
    fs::File::open(path).is_ok_and(|file| archive::is_undamaged(io::BufReader::new(file)))
}

/// Refuses a stored recipe that cannot judge.
fn refuse_judging(path: &Path, file: &RecipeFile) -> Result<(), LoadError> {
    file.check_judging().map_err(|reason| LoadError::Unfit {
        path: path.to_path_buf(),
        reason: format!("{reason}; edit it on the page (Recipes, Edit)").into(),
    })
}

/// Refuses to `attempt` something under a number that is taken, naming the recipe, how to `replace`
/// it, and a number that is free, after `instead`.
///
/// # Errors
/// In words: the number is taken.
pub fn refuse_taken(
    recipes: &Store,
    number: u16,
    (attempt, replace, instead): (&str, &str, &str),
) -> Result<(), Refusal> {
    if !recipes.numbers().contains(&number) {
        return Ok(());
    }
    let count = |number: usize, what: &str| match number {
        1 => format!("1 {what}"),
        _ => format!("{number} {what}s"),
    };
    let has = match recipes.present(number) {
        Some(file) => format!(
            "{:?} with {} and {}",
            file.name,
            count(file.features.len(), "feature"),
            count(file.gauges.len(), "gauge")
        ),
        None => "a file that cannot be read".into(),
    };
    let free = recipes.free();
    let free = free.map(|free| format!(", or {instead} {free}, which is free"));
    refused!(
        "{attempt}: recipe {number} has {has}: {replace}{}",
        free.unwrap_or_default()
    )
}
