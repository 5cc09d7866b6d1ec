//! Lists, exports and imports stored recipes. A file is imported only if it is whole, and replaces
//! a recipe only on request.

use super::incoming::Incoming;
use super::{is_sound, manifest_at, refuse_taken, write};
use crate::recipe::file::archive;
use crate::recipe::file::archive::broken;
use crate::recipe::{
    ChangeError, LoadError, Recipe, RecipeFile, RecipeId, Refusal, SequenceKind, Store,
};
use crate::storage::folder::copy_whole;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// A stored recipe, for lists.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Listed {
    /// 1–9999.
    pub number: u16,
    /// The key that a PLC may select by.
    pub part_number: String,
    /// For people.
    pub name: String,
    /// SHA-256, 64 hexadecimal digits.
    pub fingerprint: String,
    /// Fingerprint of the calibration that it was made for.
    pub calibration: String,
    /// When it was taught, in seconds since 1970 UTC; 0 if not known.
    pub taught_at_unix_s: u64,
    /// Who or what taught it.
    pub taught_by: String,
    /// What its production sequence can unwrap.
    pub sequence: String,
    /// Predicted σ_z of that sequence, mm.
    pub sigma_mm: f64,
    /// Number of gauges.
    pub gauges: usize,
    /// Bytes of the newest generation.
    pub bytes: u64,
    /// Whether a previous generation of it is stored.
    pub previous: bool,
    /// Why the newest generation cannot be read.
    pub problem: Option<String>,
}

/// Where an imported recipe goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Destination {
    /// The number that it gets; none: the one in the file.
    pub number: Option<u16>,
    /// The recipe that has the number may be replaced; it stays as the previous generation.
    pub replace: bool,
}

/// An imported recipe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// What it is called now.
    pub id: RecipeId,
    /// Fingerprint of the recipe that it replaces.
    pub replaced: Option<String>,
    /// The recipe whose part number it had, which it was stored without.
    pub without_part_number_of: Option<u16>,
}

impl Imported {
    /// What was changed, in words.
    pub fn changed(&self) -> String {
        let RecipeId {
            number,
            name,
            fingerprint,
            ..
        } = &self.id;
        let replaced = match &self.replaced {
            Some(before) => format!(" in place of {before:.8}"),
            None => String::new(),
        };
        format!("recipe {number} ({name}), fingerprint {fingerprint:.8}{replaced}")
    }

    /// What is not as in the file, in words.
    pub fn note(&self) -> Option<String> {
        self.without_part_number_of.map(|other| {
            format!(
                "it has no part number, because recipe {other} has the one of the file: edit it"
            )
        })
    }
}

impl Store {
    /// All stored recipes by their manifests. Fingerprints are not checked here but when a recipe
    /// is loaded.
    pub fn list(&self) -> Vec<Listed> {
        let numbers = self.numbers().into_iter();
        numbers.map(|number| self.listed(number)).collect()
    }

    fn listed(&self, number: u16) -> Listed {
        let path = self.path(number);
        let manifest = File::open(&path)
            .map_err(broken)
            .and_then(archive::manifest);
        let previous = self.previous(number).exists();
        let bytes = fs::metadata(&path).map_or(0, |found| found.len());
        let unreadable = |problem: Refusal| Listed {
            problem: Some(problem.words),
            ..Listed::default()
        };
        Listed {
            number,
            bytes,
            previous,
            ..manifest.map_or_else(unreadable, of_manifest)
        }
    }

    /// Copies the newest sound generation of a recipe to a file.
    ///
    /// # Errors
    /// If there is no such recipe, no generation is sound, or the file cannot be written.
    pub fn export(&self, number: u16, target: &Path) -> Result<(), ChangeError> {
        copy_whole(&self.whole(number)?, target).map_err(write(target))
    }

    /// The file of the newest sound generation: its content agrees with its fingerprint.
    ///
    /// # Errors
    /// If there is no such recipe or no generation is sound.
    pub fn whole(&self, number: u16) -> Result<PathBuf, LoadError> {
        let path = self.path(number);
        let files = [path.clone(), self.previous(number)];
        match files.into_iter().find(|file| is_sound(file)) {
            Some(whole) => Ok(whole),
            None if path.exists() => Err(LoadError::Corrupt {
                path,
                reason: "its content does not agree with its fingerprint: teach it again".into(),
            }),
            None => Err(LoadError::Unknown(number.to_string())),
        }
    }

    /// Imports a recipe from a file; one that is replaced stays as the previous generation. `fits`
    /// tries the recipe on the head and says in words why it cannot be used there.
    ///
    /// # Errors
    /// If the file is not a whole recipe, of a newer version, or does not fit the head; if the
    /// number is taken and not to be replaced, with `replace` as the remedy; or if the store cannot
    /// be written. The store is then unchanged.
    pub fn import(
        &self,
        source: &Path,
        to: Destination,
        replace: &str,
        fits: impl FnOnce(Recipe) -> Result<(), Refusal>,
    ) -> Result<Imported, ChangeError> {
        let refused =
            |reason: Refusal| Refusal::from(format!("import {}: {reason}", source.display()));
        let missing = |error| ChangeError::Missing {
            path: source.to_path_buf(),
            source: error,
        };
        // Copied first, so that what is stored is what was checked, even if the source changes
        // meanwhile.
        let _alone = self.lock().map_err(write(&self.folder))?;
        let opened = File::open(source).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (size, mut opened) = opened.map_err(missing)?;
        let mut incoming = self.receive(size).map_err(write(&self.folder))?;
        io::copy(&mut opened, &mut incoming).map_err(write(incoming.path()))?;
        let recipe = incoming.recipe().map_err(&refused)?;
        let id = recipe.id.clone();
        fits(recipe).map_err(&refused)?;
        self.take_locked(incoming, id, to, replace)
    }

    /// Stores a received recipe, which was checked and has this `id`; one that is replaced stays as
    /// the previous generation.
    ///
    /// # Errors
    /// If the number is taken and not to be replaced, with `replace` as the remedy, another recipe
    /// has the part number, or the store cannot be written. The store is then unchanged.
    pub fn take(
        &self,
        incoming: Incoming,
        id: RecipeId,
        to: Destination,
        replace: &str,
    ) -> Result<Imported, ChangeError> {
        let _alone = self.lock().map_err(write(&self.folder))?;
        self.take_locked(incoming, id, to, replace)
    }

    fn take_locked(
        &self,
        incoming: Incoming,
        mut id: RecipeId,
        to: Destination,
        replace: &str,
    ) -> Result<Imported, ChangeError> {
        let number = to.number.unwrap_or(id.number);
        let path = self.path(number);
        let replaced = self.present(number).map(|file| file.fingerprint);
        let whole = |id, replaced| Imported {
            id,
            replaced,
            without_part_number_of: None,
        };
        // Stored again, it would take the place of the previous generation.
        if manifest_at(&path).is_some_and(|file| file.fingerprint == id.fingerprint)
            && is_sound(&path)
        {
            return Ok(whole(id, None));
        }
        if !to.replace {
            let words = ("import", replace, "import it as number");
            let refused = refuse_taken(self, number, words);
            refused.map_err(|refusal| ChangeError::Taken { number, refusal })?;
        }
        if number == id.number {
            let shared = self.refuse_shared(number, &id.part_number);
            shared.map_err(|words| Refusal::from(format!("import: {words}")))?;
            self.put_received(incoming, number).map_err(write(&path))?;
            return Ok(whole(id, replaced));
        }
        // A copy of a recipe does not take its part number from it.
        let other = self.other_holder(number, &id.part_number);
        let (mut file, recipe) = incoming.read()?;
        file.number = number;
        if other.is_some() {
            file.part_number.clear();
        }
        let (bytes, fingerprint) = archive::pack(&file, &recipe.arrays)?;
        self.put(number, &bytes).map_err(write(&path))?;
        (id.number, id.part_number, id.fingerprint) = (number, file.part_number, fingerprint);
        Ok(Imported {
            id,
            replaced,
            without_part_number_of: other,
        })
    }
}

fn of_manifest(file: RecipeFile) -> Listed {
    let production = file.sequences.get(file.production);
    let sequence = match production.map(|sequence| sequence.kind) {
        Some(SequenceKind::TwoFrames) => "two frames",
        Some(SequenceKind::SingleLevel) => "single level",
        Some(SequenceKind::TwoLevels) => "two levels",
        Some(SequenceKind::Full) => "full",
        None => "none",
    };
    Listed {
        sequence: sequence.into(),
        sigma_mm: production.map_or(0.0, |sequence| sequence.sigma_mm),
        part_number: file.part_number,
        name: file.name,
        fingerprint: file.fingerprint,
        calibration: file.calibration,
        taught_at_unix_s: file.taught_at_unix_s,
        taught_by: file.taught_by,
        gauges: file.gauges.len(),
        ..Listed::default()
    }
}
