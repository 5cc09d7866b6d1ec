//! Tries an edit before it is stored: what its list would measure of golden and of other parts, and
//! all that is wrong with it. Nothing is changed.
//!
//! The values are those that the stored list would have: limits and sequence are settled by the code
//! that settles them when a list is stored. What is wrong is left out with what is of it, and the
//! rest is measured. Features that no gauge is of are measured by a plan of their own, so that they
//! change nothing of the others' values.

use super::archive::Arrays;
use super::edit::Edit;
use super::outline::{Outline, Seen};
use super::plan::{Golden, Plan};
use super::regauge::Unsettled;
use super::store::LoadedRecipe;
use super::{FeatureFile, GaugeFile, Part, Recipe, RecipeFile, Wrong};
use crate::head::calibration::Calibration;
use crate::station::{COVERAGE_FACTOR, GaugeValue, Inspection, MAX_GAUGES};
use crate::system::headway::Headway;
use algo::inspect::{FeatureKind, Measure, kinds};
use hal::bounds::clipped;
use hal::frame::Frame;
use serde_json::{Value, json};

/// Limits less than so many times U apart are too fine for a gauge.
const FINE: f64 = 4.0;

/// A recipe that is edited: what does not change between tries.
#[derive(Debug)]
pub struct Opened {
    file: RecipeFile,
    arrays: Arrays,
    /// The models of the recipe, with the rays of all pixels.
    head: Calibration,
}

/// The asker does not want the answer any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Over;

/// An edit that was tried.
#[derive(Debug)]
pub struct Tried {
    /// The recipe with what of the list is not wrong.
    file: RecipeFile,
    outline: Outline,
    /// All that is wrong with the list, as the API has it.
    pub problems: Vec<Value>,
    /// What golden has of each feature.
    pub features: Vec<Value>,
    /// What golden has of each gauge.
    pub gauges: Vec<Value>,
}

impl Opened {
    /// # Errors
    /// In words, if its models are none.
    pub fn new(LoadedRecipe { file, recipe, .. }: LoadedRecipe) -> Result<Self, String> {
        let (head, arrays) = (file.head()?.with_rays(), recipe.arrays);
        Ok(Self { file, arrays, head })
    }

    /// The recipe's number and the fingerprint of what is stored.
    pub fn id(&self) -> (u16, &str) {
        (self.file.number, &self.file.fingerprint)
    }

    /// Tries an edit. `is_over` is asked before each longer step.
    ///
    /// # Errors
    /// If it is over.
    pub fn attempt(&self, edit: Edit, is_over: &dyn Fn() -> bool) -> Result<Tried, Over> {
        let mut sent = self.file.clone();
        edit.apply(&mut sent);
        sent.judges_nothing &= sent.is_without_limits();
        let mut trial = Trial {
            wrong: sent.wrong(),
            sent,
            of: (&self.arrays, &self.head),
            is_over,
            features: Vec::new(),
            missed: Vec::new(),
        };
        let (file, golden) = trial.settled()?;
        let outline = Outline::from(&file);
        let mut gauges = Vec::new();
        if let Some(mut golden) = golden {
            let (judged, seen) = golden.judged((&file).into());
            trial.warn(&file, &judged, &seen);
            gauges = self::gauges(&judged, &outline);
            trial.take(&seen);
            let readings = golden.findings.readings.iter();
            for (gauge, reading) in gauges.iter_mut().zip(readings) {
                if let Some(reading) = reading.filter(|reading| reading.rims > 0.0) {
                    let by_master = reading.sigma.unwrap_or(0.0).hypot(reading.compared);
                    gauge["u_rims"] = (COVERAGE_FACTOR * reading.rims).into();
                    gauge["u_master"] = (COVERAGE_FACTOR * by_master).into();
                }
            }
        }
        trial.probe(&file)?;
        trial.look_closer(&file)?;
        trial.features.sort_by_key(|(at, _)| *at);
        let features = trial.features.into_iter().map(|(_, seen)| seen);
        Ok(Tried {
            problems: trial.wrong.iter().map(Wrong::json).collect(),
            features: features.collect(),
            gauges,
            outline,
            file,
        })
    }

    /// The tried recipe, to be planned for a part.
    ///
    /// # Errors
    /// In words: nothing of it can be measured.
    pub fn recipe(&self, tried: &Tried) -> Result<Recipe, String> {
        Recipe::fit(&tried.file, self.arrays.clone())
    }
}

impl Tried {
    /// What a plan of the tried recipe measures of a part.
    pub fn part(&self, plan: &Plan, sequence: usize, frames: &[Frame]) -> Value {
        let (judged, seen) = plan.look(sequence, frames);
        json!({
            "verdict": judged.verdict().word(), "reason": judged.reason.as_deref(),
            "gauges": gauges(&judged, &self.outline), "features": seen,
        })
    }
}

/// A try as it goes on.
struct Trial<'a> {
    /// The recipe with the whole list.
    sent: RecipeFile,
    /// The recipe's arrays and models.
    of: (&'a Arrays, &'a Calibration),
    is_over: &'a dyn Fn() -> bool,
    wrong: Vec<Wrong>,
    /// What golden has of features, with their places in the list.
    features: Vec<(usize, Value)>,
    /// The places of features that golden does not have.
    missed: Vec<usize>,
}

impl Trial<'_> {
    /// The recipe with what can be measured, its limits settled, and golden as it measures it, if
    /// it measures anything.
    fn settled(&mut self) -> Result<(RecipeFile, Option<Golden>), Over> {
        loop {
            let mut file = self.sent.without(&self.wrong);
            if file.gauges.is_empty() {
                return Ok((file, None));
            }
            self.goes_on()?;
            let settled = file.settle(self.of, Headway::silent());
            let golden = settled.and_then(|(_, golden)| match golden {
                Some(golden) => Ok(golden),
                None => file.golden(self.of, false, Headway::silent()),
            });
            match golden {
                Ok(golden) => return Ok((file, Some(golden))),
                Err(error) => {
                    if !self.refuse(error, true) {
                        return Ok((file, None));
                    }
                }
            }
        }
    }

    fn goes_on(&self) -> Result<(), Over> {
        match (self.is_over)() {
            true => Err(Over),
            false => Ok(()),
        }
    }

    /// Takes over why something cannot be measured; answers whether something can be left out
    /// because of it.
    fn refuse(&mut self, error: Unsettled, refused: bool) -> bool {
        let Unsettled { words, of } = error;
        let place =
            |(part, name): (Part, String)| Some((part, self.sent.place(part, &name)?, name));
        let of = of.and_then(place);
        if let Some((Part::Feature, at, _)) = &of {
            self.missed.push(*at);
        }
        let is_new = !self.wrong.iter().any(|wrong| wrong.words == words);
        let is_known = of.is_some();
        if is_new {
            self.wrong.push(Wrong { of, words, refused });
        }
        is_new && is_known
    }

    /// Names gauges whose limits golden has made impossible, and what golden does not show.
    fn warn(&mut self, file: &RecipeFile, judged: &Inspection, seen: &[Seen<'_>]) {
        for gauge in file.gauges.iter().filter(|gauge| gauge.needs_golden()) {
            if let Err(words) = gauge.check_judging() {
                let of = Some((Part::Gauge, gauge.name.clone()));
                self.refuse(Unsettled { words, of }, true);
            }
        }
        self.miss(seen);
        for (gauge, value) in file.gauges.iter().zip(&judged.gauges) {
            let lost =
                |seen: &Seen<'_>| seen.lost().is_some() && gauge.of.contains(&seen.name().into());
            if value.value.is_none() && !seen.iter().any(lost) {
                let reason = value.reason.as_deref().unwrap_or("nothing to measure");
                let name = clipped(&gauge.name);
                let words =
                    format!("gauge {name:?} has no value on the part that was taught: {reason}");
                let of = Some((Part::Gauge, gauge.name.clone()));
                self.refuse(Unsettled { words, of }, false);
            }
        }
    }

    /// Names the features that are not found on golden.
    fn miss(&mut self, seen: &[Seen<'_>]) {
        for feature in seen {
            let Some((reason, remedy)) = feature.lost() else {
                continue;
            };
            let name = clipped(feature.name());
            let words =
                format!("feature {name:?}, on the part that was taught: {reason}: {remedy}");
            let of = Some((Part::Feature, feature.name().into()));
            self.refuse(Unsettled { words, of }, false);
        }
    }

    /// Keeps what golden has of features.
    fn take(&mut self, seen: &[Seen<'_>]) {
        for feature in seen {
            let place = self.sent.place(Part::Feature, feature.name());
            let value = serde_json::to_value(feature).ok();
            self.features.extend(place.zip(value));
        }
    }

    /// Measures the features that no gauge is of.
    fn probe(&mut self, file: &RecipeFile) -> Result<(), Over> {
        loop {
            let place = |feature: &FeatureFile| self.sent.place(Part::Feature, &feature.name);
            let is_wrong = |at| self.wrong.iter().any(|wrong| wrong.is(Part::Feature, at));
            let is_left =
                |of: &&FeatureFile| place(of).is_some_and(|at| !self.is_known(at) && !is_wrong(at));
            let left = file.features.iter().filter(is_left).take(MAX_GAUGES);
            let mut probing = probing(file, left);
            // A section outside of the frame is refused even if no gauge is of it.
            probing
                .features
                .retain(|of| of.kind != FeatureKind::Section || !place(of).is_some_and(is_wrong));
            if probing.gauges.is_empty() {
                return Ok(());
            }
            self.goes_on()?;
            match probing.golden(self.of, false, Headway::silent()) {
                Ok(mut golden) => {
                    let (_, seen) = golden.judged((&probing).into());
                    self.miss(&seen);
                    self.take(&seen);
                }
                // A feature without a gauge may be stored.
                Err(error) => {
                    if !self.refuse(error, false) {
                        return Ok(());
                    }
                }
            }
        }
    }

    /// Shows what is seen of the features that golden does not have.
    fn look_closer(&mut self, file: &RecipeFile) -> Result<(), Over> {
        for at in std::mem::take(&mut self.missed) {
            let Some(feature) = self.sent.features.get(at).filter(|_| !self.is_known(at)) else {
                continue;
            };
            self.goes_on()?;
            let mut probing = probing(file, std::iter::once(feature));
            probing.features.retain(|of| of.name != feature.name);
            probing.features.push(feature.clone());
            if let Ok(mut golden) = probing.golden(self.of, true, Headway::silent()) {
                let (_, seen) = golden.judged((&probing).into());
                self.take(&seen);
            }
        }
        Ok(())
    }

    /// Whether what golden has of a feature is known.
    fn is_known(&self, at: usize) -> bool {
        self.features.iter().any(|(of, _)| *of == at)
    }
}

/// A recipe with a gauge of each of these features and no other.
fn probing<'a>(file: &RecipeFile, of: impl Iterator<Item = &'a FeatureFile>) -> RecipeFile {
    let gauges = of.enumerate().map(|(at, feature)| {
        let of = [feature.name.as_str()];
        GaugeFile::new(at as u16 + 1, &feature.name, probe(feature.kind), &of)
    });
    RecipeFile {
        gauges: gauges.collect(),
        datums: Vec::new(),
        two_frames: false,
        ..file.clone()
    }
}

/// A gauge that every feature of a kind has.
fn probe(kind: FeatureKind) -> Measure {
    match kind {
        FeatureKind::Surface => kinds::MeanHeight {}.into(),
        FeatureKind::Plane => kinds::Z {}.into(),
        FeatureKind::Section => kinds::Gap {}.into(),
        FeatureKind::Line | FeatureKind::Circle | FeatureKind::Slot => kinds::Found {}.into(),
    }
}

/// The gauges of a part, with their kinds (docs/api.md, `gauges`).
fn gauges(judged: &Inspection, outline: &Outline) -> Vec<Value> {
    let gauge = |gauge: &GaugeValue| {
        let apart = gauge.low.zip(gauge.high).map(|(low, high)| high - low);
        let fine = apart.zip(gauge.uncertainty);
        json!({
            "slot": gauge.slot, "name": &*gauge.name, "kind": outline.kind(gauge.slot),
            "unit": gauge.unit.symbol(), "value": gauge.value, "sigma": gauge.sigma,
            "u": gauge.uncertainty, "low": gauge.low, "high": gauge.high,
            "decision": gauge.decision.bits(), "reason": gauge.reason.as_deref(),
            "too_fine": fine.is_some_and(|(apart, u)| apart < FINE * u),
        })
    };
    judged.gauges.iter().map(gauge).collect()
}
