//! Teaching under a number that is taken: what the new recipe keeps of the one that it replaces.
//!
//! Gauges that follow golden: their limits and masters are worked out again whenever golden, the
//! gauges or the production sequence change.

use super::golden::{Naming, THIS_PROGRAM, UnsealedRecipe};
use super::good_parts::DEVIATION_MM;
use super::planner;
use super::planner::Choice;
use crate::head::calibration::Calibration;
use crate::recipe::file::archive::Arrays;
use crate::recipe::file::refusal::refused;
use crate::recipe::plan::{Golden, Plan};
use crate::recipe::{Element, GaugeFile, Part, Recipe, RecipeFile, Refusal};
use crate::system::headway::Headway;
use algo::inspect::{Findings, Marking, Missing};
use hal::bounds::{clipped, within};

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
    let new = Naming {
        number,
        part_number: format!("PART-{number:04}"),
        name: format!("Part {number}"),
        taught_by: THIS_PROGRAM.into(),
        taught_at_unix_s: crate::system::clock::utc_or_told_s().unwrap_or(0),
        placement_tolerance_mm: PLACEMENT_TOLERANCE_MM,
        exposures: None,
        everything: false,
        marking: Marking::default(),
        empty: None,
        limit_mm: Some(DEVIATION_MM),
    };
    let Some(file) = replaced.cloned() else {
        return new;
    };
    Naming {
        limit_mm: match keep_gauges {
            true => kept_limit(&file),
            false => Some(file.good_parts.map_or(DEVIATION_MM, |of| of.tolerance_mm)),
        },
        part_number: file.part_number,
        name: file.name,
        placement_tolerance_mm: file.placement_tolerance_mm,
        exposures: Some(file.exposures).filter(|exposures| *exposures > 1),
        everything: file.everything,
        marking: file.marking,
        ..new
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

/// Limits decide on the sequence, and this on golden's own value by some micrometres, which moves
/// the limits: more turns than this change nothing that matters.
const TURNS: usize = 3;

impl UnsealedRecipe {
    /// Works out limits and masters, and chooses the production sequence for the gauges of a
    /// manifest.
    ///
    /// # Errors
    /// In words, if they do not fit each other, or golden has no value where one is needed.
    pub(crate) fn of(
        mut manifest: RecipeFile,
        arrays: Arrays,
        headway: Headway<'_>,
    ) -> Result<Self, Refusal> {
        let head = manifest.head()?;
        let settled = manifest.settle((&arrays, &head), headway);
        let (mut choice, _) = settled?;
        if manifest.two_frames {
            choice.reasons.push(Self::TWO_FRAMES.into());
        }
        if manifest.has_contours() {
            choice.reasons.push(Self::CONTOURS.into());
        }
        Ok(Self {
            manifest,
            arrays,
            choice,
        })
    }
}

impl RecipeFile {
    /// Sorts the gauges by their slots, works out limits and masters, and chooses the production
    /// sequence. The answer also has golden as the recipe measures it, where that was needed. `head`
    /// has the models of the recipe ([`Self::head`]).
    ///
    /// # Errors
    /// In words, if they do not fit each other, or golden has no value where one is needed.
    pub(crate) fn settle(
        &mut self,
        (arrays, head): (&Arrays, &Calibration),
        headway: Headway<'_>,
    ) -> Result<(Choice, Option<Golden>), Refusal> {
        self.gauges.sort_by_key(|gauge| gauge.slot);
        let choose = |of: &Self| planner::choose(&of.sequences, &of.gauges, arrays.widest());
        let mut choice = choose(self);
        self.production = choice.production;
        if !self.has_contours() && !self.gauges.iter().any(GaugeFile::needs_golden) {
            return Ok((choice, None));
        }
        let head = &head.clone().with_rays();
        for turn in 0..TURNS {
            let [from, to] = [turn, turn + 1].map(|turn| turn as f64 / TURNS as f64);
            let golden = self.golden((arrays, head), false, headway.part(from, to))?;
            self.follow(&golden.findings)?;
            choice = choose(self);
            if choice.production == self.production {
                return Ok((choice, Some(golden)));
            }
            self.production = choice.production;
        }
        Ok((choice, None))
    }

    /// Golden as the recipe measures it with a head that has its models; leniently also where golden
    /// shows too little of a contour.
    ///
    /// # Errors
    /// In words: manifest and arrays do not fit each other, or golden does not have a feature.
    pub(crate) fn golden(
        &self,
        (arrays, head): (&Arrays, &Calibration),
        lenient: bool,
        headway: Headway<'_>,
    ) -> Result<Golden, Refusal> {
        let recipe = Recipe::fit(self, arrays.clone())?;
        Ok(Plan::golden(recipe, head, lenient, headway)?)
    }

    /// Takes over what is found of golden.
    ///
    /// # Errors
    /// In words: a gauge that needs golden's value has none, or one can never have a value.
    fn follow(&mut self, golden: &Findings) -> Result<(), Refusal> {
        let found = golden.readings.iter().zip(&golden.missing);
        let gauges = self.gauges.iter_mut().enumerate();
        for ((place, gauge), (reading, missing)) in gauges.zip(found) {
            gauge.set_golden(reading.as_ref());
            let name = clipped(&gauge.name);
            let words = if *missing == Some(Missing::Open) {
                format!(
                    "gauge {name:?} depends on how the part lies along a direction that its shape does not determine: give it a datum"
                )
            } else if gauge.needs_golden() && gauge.golden_value.is_none() {
                format!(
                    "gauge {name:?} finds nothing to measure in golden: move its feature, or write its limits and leave golden and master out"
                )
            } else {
                continue;
            };
            let of = Some(Element::new(Part::Gauge, place, &gauge.name));
            return Err(Refusal { words, of });
        }
        Ok(())
    }
}
