//! Teaching under a number that is taken: what the new recipe keeps of the one that it replaces.

use super::Refusal;
use super::golden::{Naming, UnsealedRecipe};
use super::good_parts::DEVIATION_MM;
use super::{RecipeFile, Store};
use crate::recipe::rules::refused;
use crate::system::headway::Headway;
use algo::inspect::Marking;
use hal::bounds::within;

/// Least and largest limit of the deviation that may be asked for, ± mm.
pub const LEAST_LIMIT_MM: f64 = 0.001;
/// See above.
pub const MOST_LIMIT_MM: f64 = 100.0;
/// Refuses a limit of the deviation that cannot be asked for.
///
/// # Errors
/// In words, with the bounds.
pub fn check_limit(limit_mm: Option<f64>) -> Result<(), Refusal> {
    limit_mm.map_or(Ok(()), |limit| {
        Ok(within("limit_mm", limit, LEAST_LIMIT_MM, MOST_LIMIT_MM)?)
    })
}

/// Placement tolerance of a recipe that replaces none, mm.
pub const PLACEMENT_TOLERANCE_MM: f64 = 1.0;

/// Names, placement tolerance, exposures, what is the part and the limit of its deviation, of a recipe that
/// is taught under a number: those of the recipe that it replaces, if any. With `keep_gauges` the limit is the
/// widest of its deviations'.
pub fn naming(number: u16, replaced: Option<&RecipeFile>, keep_gauges: bool) -> Naming {
    let kept = replaced.cloned();
    let exposures = replaced.map_or(1, |file| file.exposures);
    let (part_number, name, placement_tolerance_mm) = match kept {
        Some(file) => (file.part_number, file.name, file.placement_tolerance_mm),
        None => (
            format!("PART-{number:04}"),
            format!("Part {number}"),
            PLACEMENT_TOLERANCE_MM,
        ),
    };
    Naming {
        number,
        part_number,
        name,
        taught_at_unix_s: crate::system::clock::utc_or_told_s().unwrap_or(0),
        placement_tolerance_mm,
        exposures,
        everything: replaced.is_some_and(|file| file.everything),
        marking: replaced.map_or_else(Marking::default, |file| file.marking.clone()),
        empty: None,
        limit_mm: match replaced {
            Some(file) if keep_gauges => kept_limit(file),
            Some(file) => Some(file.good_parts.map_or(DEVIATION_MM, |of| of.tolerance_mm)),
            None => Some(DEVIATION_MM),
        },
    }
}

/// The widest limit of the deviations of a recipe, ± mm; `None` if it has none.
fn kept_limit(file: &RecipeFile) -> Option<f64> {
    let deviations = file.gauges.iter().filter(|gauge| gauge.is_deviation());
    let limits = deviations
        .flat_map(|gauge| [gauge.low, gauge.high])
        .flatten();
    limits.map(f64::abs).max_by(f64::total_cmp)
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

/// The refusal to keep the gauges of a recipe that is not there.
pub fn no_gauges(number: u16) -> String {
    format!("teach: there is no recipe {number} whose gauges could be kept")
}

/// Checks that the gauges of a recipe can be kept on a head with frames of (width, height).
///
/// # Errors
/// In words: the frames have another size (features have polygons in camera pixels), or the recipe
/// cannot judge.
pub fn check_kept(replaced: &RecipeFile, (width, height): (u32, u32)) -> Result<(), Refusal> {
    let camera = &replaced.camera;
    if (camera.width, camera.height) == (width, height) {
        return replaced.check_judging();
    }
    refused!(
        "the features of recipe {} are in pixels of frames of {}×{}, this camera has {width}×{height}: teach without its gauges",
        replaced.number,
        camera.width,
        camera.height
    )
}

/// Gives a recipe that was just taught the features, datum systems, gauges, guard band and least
/// coverage of the one that it replaces, and its two frames if it begins with them. Limits that
/// come from golden follow the new one; the production sequence is chosen again for the limits.
///
/// # Errors
/// In words, if they do not fit what was taught.
pub fn keep_gauges(
    taught: UnsealedRecipe,
    replaced: &RecipeFile,
    headway: Headway<'_>,
) -> Result<UnsealedRecipe, Refusal> {
    let UnsealedRecipe {
        mut manifest,
        arrays,
        ..
    } = taught;
    check_kept(replaced, (manifest.camera.width, manifest.camera.height))?;
    manifest.features.clone_from(&replaced.features);
    manifest.datums.clone_from(&replaced.datums);
    manifest.gauges.clone_from(&replaced.gauges);
    manifest.judges_nothing = replaced.judges_nothing;
    manifest.min_coverage = replaced.min_coverage;
    manifest.guard_k = replaced.guard_k;
    manifest.two_frames |= replaced.two_frames;
    // The prediction is for the limits that teaching sets.
    manifest.good_parts = None;
    manifest.tried = Vec::new();
    UnsealedRecipe::of(manifest, arrays, headway)
}
