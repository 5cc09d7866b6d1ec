//! Edits a taught recipe: names, features, datum systems, gauges, guard band and least coverage.
//!
//! Of two clients that change one recipe the second is refused: an edit names the fingerprint that
//! it changes (`ChangeError::Outdated`).
//!
//! [`RecipeFile::differences`] says what a change does to a recipe, for the record of changes.

pub mod trying;

use crate::recipe::file::archive::Arrays;
use crate::recipe::file::gauges_toml::Gauging;
use crate::recipe::file::rules;
use crate::recipe::file::rules::Rules;
use crate::recipe::store::LoadedRecipe;
use crate::recipe::teach::golden::{TaughtRecipe, UnsealedRecipe};
use crate::recipe::{
    ChangeError, DatumFile, FeatureFile, GaugeFile, Recipe, RecipeFile, Refusal, Store,
};
use crate::system::headway::Headway;
use hal::bounds::clipped;
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
        store.refuse_shared(number, part_number)?;
    }
    let fingerprint = edit.fingerprint.clone();
    edit.apply(&mut file);
    file.set_gauges_of(&before)?;
    // Tighter limits may need a longer sequence, wider ones a shorter one.
    let changed = UnsealedRecipe::of(file, recipe.arrays, Headway::silent())?.seal()?;
    fits(changed.recipe)?;
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
    pub(crate) fn apply(self, file: &mut RecipeFile) {
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
    pub(crate) fn set_gauges_of(&mut self, before: &Self) -> Result<(), Refusal> {
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

impl Gauging {
    /// The recipe with these features, datum systems and gauges.
    ///
    /// # Errors
    /// In words: they do not fit each other or the recipe.
    pub fn set(self, before: &RecipeFile, arrays: Arrays) -> Result<TaughtRecipe, Refusal> {
        let mut file = RecipeFile {
            features: self.features,
            datums: self.datums,
            gauges: self.gauges,
            ..before.clone()
        };
        file.gauges.sort_by_key(|gauge| gauge.slot);
        file.set_gauges_of(before)?;
        UnsealedRecipe::of(file, arrays, Headway::silent())?.seal()
    }
}

impl RecipeFile {
    /// How the recipe differs from the one `before`: each limit with both of its values; "nothing"
    /// if it does not.
    pub fn differences(&self, before: &Self) -> String {
        let mut words = Vec::new();
        let mut text = |what: &str, from: &str, to: &str| {
            if from != to {
                let (from, to) = (clipped(from), clipped(to));
                words.push(format!("{what} from {from:?} to {to:?}"));
            }
        };
        text("name", &before.name, &self.name);
        text("part number", &before.part_number, &self.part_number);
        let mut number = |what: &str, from: f64, to: f64| {
            if from != to {
                words.push(format!("{what} from {from} to {to}"));
            }
        };
        number("guard band", before.guard_k, self.guard_k);
        number("least coverage", before.min_coverage, self.min_coverage);
        match (before.judges_nothing, self.judges_nothing) {
            (false, true) => words.push("judges nothing from now on".into()),
            (true, false) => words.push("judges again".into()),
            _ => {}
        }
        words.extend(lists(
            ("gauge", &before.gauges, &self.gauges),
            |gauge| &gauge.name,
            |new, gone| new.slot == gone.slot,
            gauge,
        ));
        words.extend(self.other_slots(before));
        words.extend(lists(
            ("feature", &before.features, &self.features),
            |feature| &feature.name,
            |_, _| false,
            |before, after| match before.kind == after.kind {
                true => (before.region != after.region).then(|| "moved".into()),
                false => Some(format!("is a {} now", after.kind.name())),
            },
        ));
        words.extend(lists(
            ("datum", &before.datums, &self.datums),
            |datum| &datum.name,
            |_, _| false,
            |before, after| (before.of != after.of).then(|| "is of other features".into()),
        ));
        match words.is_empty() {
            true => "nothing".into(),
            false => words.join("; "),
        }
    }

    /// Which gauges have another slot than `before`, in words; `None` if none has. A PLC reads
    /// gauges by their slots.
    pub fn other_slots(&self, before: &Self) -> Option<String> {
        let moved = self.gauges.iter().filter_map(|gauge| {
            let mut gauges = before.gauges.iter();
            let then = gauges.find(|before| before.name == gauge.name)?.slot;
            let name = clipped(&gauge.name);
            (then != gauge.slot).then(|| format!("{name:?} from {then} to {}", gauge.slot))
        });
        let moved: Vec<_> = moved.collect();
        (!moved.is_empty()).then(|| format!("slots of gauges: {}", moved.join(", ")))
    }
}

/// What differs in two lists whose elements have names. One whose name is gone may have another
/// name now: that of a new one that `replaces` it.
fn lists<'a, T>(
    (what, before, after): (&str, &'a [T], &'a [T]),
    name: impl Fn(&'a T) -> &'a String,
    replaces: impl Fn(&T, &T) -> bool,
    difference: impl Fn(&'a T, &'a T) -> Option<String>,
) -> Vec<String> {
    let find = |list: &'a [T], wanted: &str| list.iter().find(|element| name(element) == wanted);
    let is_gone = |element: &&'a T| find(after, name(element)).is_none();
    let gone: Vec<&'a T> = before.iter().filter(is_gone).collect();
    let is_new = |element: &&'a T| find(before, name(element)).is_none();
    let new: Vec<&'a T> = after.iter().filter(is_new).collect();
    let removed = gone
        .iter()
        .copied()
        .filter(|gone| !new.iter().any(|new| replaces(new, gone)))
        .map(|gone| format!("{what} {:?} removed", clipped(name(gone))));
    let others = after.iter().filter_map(|element| {
        let replaced = || gone.iter().copied().find(|gone| replaces(element, gone));
        let words = match find(before, name(element)).or_else(replaced) {
            None => "added".into(),
            Some(before) => difference(before, element)?,
        };
        Some(format!("{what} {:?} {words}", clipped(name(element))))
    });
    removed.chain(others).collect()
}

/// How a gauge differs, in words.
fn gauge(before: &GaugeFile, after: &GaugeFile) -> Option<String> {
    let mut words = Vec::new();
    if before.name != after.name {
        words.push(format!("instead of {:?}", clipped(&before.name)));
    }
    if before.measures != after.measures || before.of != after.of || before.datum != after.datum {
        words.push("measures something else".to_owned());
    }
    if before.master != after.master {
        words.push("has another master".to_owned());
    }
    let limit =
        |limit: Option<f64>, of: &GaugeFile| match (limit, of.measures.facts().unit.symbol()) {
            (None, _) => "none".to_owned(),
            (Some(limit), "") => limit.to_string(),
            (Some(limit), symbol) => format!("{limit} {symbol}"),
        };
    for (which, from, to) in [
        ("lowest", before.low, after.low),
        ("highest", before.high, after.high),
    ] {
        if from != to {
            let (from, to) = (limit(from, before), limit(to, after));
            words.push(format!("{which} from {from} to {to}"));
        }
    }
    (!words.is_empty()).then(|| words.join(", "))
}
