//! Edits a taught recipe: names, features, datum systems, gauges, guard band and least coverage.
//!
//! Of two clients that change one recipe the second is refused: an edit names the fingerprint that
//! it changes (`ChangeError::Outdated`).

use super::golden::UnsealedRecipe;
use super::rules::{self, Rules};
use super::store::LoadedRecipe;
use super::{ChangeError, DatumFile, FeatureFile, GaugeFile, Recipe, RecipeFile, Refusal, Store};
use crate::system::headway::Headway;
use serde::Deserialize;

/// A change to a recipe; what is `None` stays as it is.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edit {
    /// Fingerprint of the recipe that the change is based on; if another one is stored, the change
    /// is refused.
    pub fingerprint: String,
    /// For people.
    pub name: Option<String>,
    /// The key for a PLC.
    pub part_number: Option<String>,
    /// Least share of the golden pixels that must be resolved.
    pub min_coverage: Option<f64>,
    /// Width of the guard bands, in multiples of u.
    pub guard_k: Option<f64>,
    /// Whether the recipe may be without any limit. A recipe that has limits judges nevertheless.
    pub judges_nothing: Option<bool>,
    /// All features.
    pub features: Option<Vec<FeatureFile>>,
    /// All datum systems.
    pub datums: Option<Vec<DatumFile>>,
    /// All gauges.
    pub gauges: Option<Vec<GaugeFile>>,
}

/// A stored change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edited {
    /// The new fingerprint.
    pub fingerprint: String,
    /// What was changed, in words.
    pub changed: String,
    /// The gauges that a PLC finds in other slots now, in words; `None` if there are none.
    pub other_slots: Option<String>,
}

/// Changes a stored recipe; what was stored before stays as the previous generation. `fits` tries
/// the changed recipe on the head and says in words why it cannot be used there.
///
/// # Errors
/// The recipe cannot be read, was changed since, would not be usable, or cannot be stored.
pub fn edit(
    store: &Store,
    number: u16,
    edit: Edit,
    fits: impl FnOnce(Recipe) -> Result<(), Refusal>,
) -> Result<Edited, ChangeError> {
    let LoadedRecipe {
        mut file, recipe, ..
    } = store.load_to_edit(number)?;
    let before = file.clone();
    if file.fingerprint != edit.fingerprint {
        return Err(ChangeError::Outdated(number));
    }
    if let Some(part_number) = &edit.part_number {
        let shared = store.refuse_shared(number, part_number);
        shared.map_err(ChangeError::Unfit)?;
    }
    let fingerprint = edit.fingerprint.clone();
    edit.apply(&mut file);
    file.set_gauges_of(&before).map_err(ChangeError::Unfit)?;
    // Tighter limits may need a longer sequence, wider ones a shorter one.
    let changed = UnsealedRecipe::of(file, recipe.arrays, Headway::silent())
        .and_then(UnsealedRecipe::seal)
        .map_err(ChangeError::Unfit)?;
    fits(changed.recipe).map_err(ChangeError::Unfit)?;
    // The recipe was read without the lock: another change may have been stored meanwhile.
    match store.replace(number, &fingerprint, &changed.bytes) {
        Ok(true) => Ok(Edited {
            changed: changed.manifest.differences(&before),
            other_slots: changed.manifest.other_slots(&before),
            fingerprint: changed.manifest.fingerprint,
        }),
        Ok(false) => Err(ChangeError::Outdated(number)),
        Err(error) => Err(ChangeError::Store(error)),
    }
}

impl Edit {
    /// Takes over what it changes, unchecked.
    pub(super) fn apply(self, file: &mut RecipeFile) {
        fn set<T>(of: &mut T, new: Option<T>) {
            if let Some(new) = new {
                *of = new;
            }
        }
        set(&mut file.name, self.name.map(|name| name.trim().to_owned()));
        set(&mut file.part_number, self.part_number);
        set(&mut file.min_coverage, self.min_coverage);
        set(&mut file.guard_k, self.guard_k);
        set(&mut file.features, self.features);
        set(&mut file.datums, self.datums);
        set(&mut file.gauges, self.gauges);
        set(&mut file.judges_nothing, self.judges_nothing);
    }
}

impl RecipeFile {
    /// Makes the recipe one whose features, datum systems and gauges were changed from those of the
    /// recipe `before`, and checks it.
    ///
    /// # Errors
    /// The first rule of edits that it breaks.
    pub(super) fn set_gauges_of(&mut self, before: &Self) -> Result<(), Refusal> {
        // Limits that are added end that it judges nothing.
        self.judges_nothing &= self.is_without_limits();
        // It is not known how gauges that were changed judge good parts.
        let of = |gauges: &[GaugeFile], name: &str| {
            let gauge = gauges.iter().find(|gauge| gauge.name == name);
            gauge.cloned()
        };
        let mut tried = std::mem::take(&mut self.tried);
        tried.retain(|tried| of(&before.gauges, &tried.gauge) == of(&self.gauges, &tried.gauge));
        self.tried = tried;
        rules::check(self, Rules::Edit)
    }
}
