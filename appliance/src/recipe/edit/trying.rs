//! Tries an edit before it is stored: what its list would measure of golden and of other parts, and
//! all that is wrong with it. Nothing is changed.
//!
//! The values are those that the stored list would have: limits and sequence are settled by the code
//! that settles them when a list is stored. What is wrong is left out with what is of it, and the
//! rest is measured. Features that no gauge is of are measured by a plan of their own, so that they
//! change nothing of the others' values.

use super::Edit;
use crate::head::calibration::Calibration;
use crate::recipe::file::archive::Arrays;
use crate::recipe::file::feature::KindRow;
use crate::recipe::file::rules;
use crate::recipe::plan::{Golden, Plan};
use crate::recipe::store::LoadedRecipe;
use crate::recipe::{
    Demands, Element, FeatureFile, FeatureView, GaugeFile, Part, Recipe, RecipeFile, Refusal,
};
use crate::station::{COVERAGE_FACTOR, GaugeValue, Inspection, MAX_GAUGES};
use crate::system::headway::Headway;
use algo::inspect::FeatureKind;
use hal::bounds::clipped;
use hal::frame::Frame;
use serde_json::{Value, json};

/// Limits less than so many times U apart are too fine for a gauge.
const FINE: f64 = 4.0;

/// Something that is wrong with an edit.
#[derive(Debug)]
struct EditProblem {
    refusal: Refusal,
    /// Whether the list cannot be stored because of it.
    refused: bool,
}

/// A recipe that is edited: what does not change between tries.
#[derive(Debug)]
pub struct EditedRecipe {
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
    /// The recipe with the valid part of the list.
    file: RecipeFile,
    demands: Demands,
    /// All that is wrong with the list, as the API has it.
    pub problems: Vec<Value>,
    /// What golden has of each feature.
    pub features: Vec<Value>,
    /// What golden has of each gauge.
    pub gauges: Vec<Value>,
}

impl EditedRecipe {
    /// # Errors
    /// In words, if its models are none.
    pub fn new(LoadedRecipe { file, recipe, .. }: LoadedRecipe) -> Result<Self, Refusal> {
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
        let problems = rules::problems(&sent).into_iter();
        let mut trial = Trial {
            problems: problems
                .map(|refusal| EditProblem {
                    refusal,
                    refused: true,
                })
                .collect(),
            sent,
            of: (&self.arrays, &self.head),
            is_over,
            features: Vec::new(),
            missed: Vec::new(),
        };
        let (file, golden) = trial.settled()?;
        let demands = Demands::from(&file);
        let mut gauges = Vec::new();
        if let Some(mut golden) = golden {
            let (judged, seen) = golden.judged(demands.clone());
            trial.warn(&file, &judged, &seen);
            gauges = self::gauges(&judged, &demands);
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
            problems: trial.problems.iter().map(EditProblem::json).collect(),
            features: features.collect(),
            gauges,
            demands,
            file,
        })
    }

    /// The tried recipe, to be planned for a part.
    ///
    /// # Errors
    /// In words: nothing of it can be measured.
    pub fn recipe(&self, tried: &Tried) -> Result<Recipe, Refusal> {
        Recipe::fit(&tried.file, self.arrays.clone())
    }
}

impl EditProblem {
    /// As the API has it (docs/api.md, `problems`).
    fn json(&self) -> Value {
        let mut all = json!({ "words": self.refusal.words, "refused": self.refused });
        if let Some(Element { part, place, name }) = &self.refusal.of {
            all[part.word()] = name.as_str().into();
            all["at"] = (*place).into();
        }
        all
    }
}

impl Tried {
    /// What a plan of the tried recipe measures of a part.
    pub fn part(&self, plan: &Plan, sequence: usize, frames: &[Frame]) -> Value {
        let (judged, seen) = plan.look(sequence, frames);
        json!({
            "verdict": judged.verdict().word(), "reason": judged.reason.as_deref(),
            "gauges": gauges(&judged, &self.demands), "features": seen,
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
    problems: Vec<EditProblem>,
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
            let mut file = self.valid();
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
                    if !self.cannot_measure(&error, true) {
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

    /// Whether an element of the list has a problem, or one because of which it cannot be stored.
    fn is_wrong(&self, part: Part, place: usize, refused: bool) -> bool {
        self.problems.iter().any(|problem| {
            let of = problem.refusal.of.as_ref();
            (problem.refused || !refused)
                && of.is_some_and(|of| (of.part, of.place) == (part, place))
        })
    }

    /// The recipe without the elements that cannot be stored, and without those that refer to them.
    fn valid(&self) -> RecipeFile {
        fn retain<T>(list: &mut Vec<T>, keep: impl Fn(usize, &T) -> bool) {
            let mut places = 0..;
            list.retain(|element| places.next().is_some_and(|place| keep(place, element)));
        }
        let is_valid = |part, place| !self.is_wrong(part, place, true);
        let mut file = self.sent.clone();
        retain(&mut file.features, |place, _| {
            is_valid(Part::Feature, place)
        });
        let planes: Vec<String> = file.features.iter().map(|of| of.name.clone()).collect();
        let has_plane = |of: &FeatureFile| of.plane.as_ref().is_none_or(|of| planes.contains(of));
        file.features.retain(has_plane);
        let names: Vec<&String> = file.features.iter().map(|of| &of.name).collect();
        let are_there = |of: &[String]| of.iter().all(|name| names.contains(&name));
        retain(&mut file.datums, |place, datum| {
            is_valid(Part::Datum, place) && are_there(&datum.of)
        });
        let datums: Vec<&String> = file.datums.iter().map(|of| &of.name).collect();
        retain(&mut file.gauges, |place, gauge| {
            let has_datum = gauge.datum.as_ref().is_none_or(|of| datums.contains(&of));
            is_valid(Part::Gauge, place) && has_datum && are_there(&gauge.of)
        });
        file
    }

    /// The place of the first feature or gauge with a name in the list that was sent.
    fn place(&self, part: Part, name: &str) -> Option<usize> {
        match part {
            Part::Feature => self.sent.features.iter().position(|of| of.name == name),
            Part::Datum => self.sent.datums.iter().position(|of| of.name == name),
            Part::Gauge => self.sent.gauges.iter().position(|of| of.name == name),
        }
    }

    /// Takes over why a valid part of the list cannot be measured, or stored where it is `refused`;
    /// answers whether something can be left out because of it.
    fn refuse(&mut self, words: String, of: Option<(Part, &str)>, refused: bool) -> bool {
        let of = of.and_then(|(part, name)| {
            let place = self.place(part, name)?;
            Some(Element::new(part, place, name))
        });
        if let Some(feature) = of.as_ref().filter(|of| of.part == Part::Feature) {
            self.missed.push(feature.place);
        }
        let is_known = of.is_some();
        let is_new = !self
            .problems
            .iter()
            .any(|problem| problem.refusal.words == words);
        if is_new {
            let refusal = Refusal { words, of };
            self.problems.push(EditProblem { refusal, refused });
        }
        is_new && is_known
    }

    /// As [`Self::refuse`], of what planning or measuring refuses.
    fn cannot_measure(&mut self, Refusal { words, of }: &Refusal, refused: bool) -> bool {
        let of = of.as_ref().map(|of| (of.part, &*of.name));
        self.refuse(words.clone(), of, refused)
    }

    /// Names gauges whose limits golden has made impossible, and what golden does not show.
    fn warn(&mut self, file: &RecipeFile, judged: &Inspection, seen: &[FeatureView<'_>]) {
        for gauge in file.gauges.iter().filter(|gauge| gauge.needs_golden()) {
            if let Err(Refusal { words, .. }) = gauge.check_judging() {
                self.refuse(words, Some((Part::Gauge, &gauge.name)), true);
            }
        }
        self.miss(seen);
        for (gauge, value) in file.gauges.iter().zip(&judged.gauges) {
            let lost = |seen: &FeatureView<'_>| {
                seen.lost().is_some() && gauge.of.contains(&seen.name().into())
            };
            if value.value.is_none() && !seen.iter().any(lost) {
                let reason = value.reason.as_deref().unwrap_or("nothing to measure");
                let name = clipped(&gauge.name);
                let words =
                    format!("gauge {name:?} has no value on the part that was taught: {reason}");
                self.refuse(words, Some((Part::Gauge, &gauge.name)), false);
            }
        }
    }

    /// Names the features that are not found on golden.
    fn miss(&mut self, seen: &[FeatureView<'_>]) {
        for feature in seen {
            let Some((reason, remedy)) = feature.lost() else {
                continue;
            };
            let name = clipped(feature.name());
            let words =
                format!("feature {name:?}, on the part that was taught: {reason}: {remedy}");
            self.refuse(words, Some((Part::Feature, feature.name())), false);
        }
    }

    /// Keeps what golden has of features.
    fn take(&mut self, seen: &[FeatureView<'_>]) {
        for feature in seen {
            let place = self.place(Part::Feature, feature.name());
            let value = serde_json::to_value(feature).ok();
            self.features.extend(place.zip(value));
        }
    }

    /// Measures the features that no gauge is of.
    fn probe(&mut self, file: &RecipeFile) -> Result<(), Over> {
        loop {
            let place = |feature: &FeatureFile| self.place(Part::Feature, &feature.name);
            let is_wrong = |place| self.is_wrong(Part::Feature, place, false);
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
                    if !self.cannot_measure(&error, false) {
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
        let measure = (KindRow::of(feature.kind).probe)();
        GaugeFile::new(at as u16 + 1, &feature.name, measure, &of)
    });
    RecipeFile {
        gauges: gauges.collect(),
        datums: Vec::new(),
        two_frames: false,
        ..file.clone()
    }
}

/// The gauges of a part, with their kinds (docs/api.md, `gauges`).
fn gauges(judged: &Inspection, demands: &Demands) -> Vec<Value> {
    let gauge = |gauge: &GaugeValue| {
        let apart = gauge.low.zip(gauge.high).map(|(low, high)| high - low);
        let fine = apart.zip(gauge.uncertainty);
        json!({
            "slot": gauge.slot, "name": &*gauge.name, "kind": demands.kind(gauge.slot),
            "unit": gauge.unit.symbol(), "value": gauge.value, "sigma": gauge.sigma,
            "u": gauge.uncertainty, "low": gauge.low, "high": gauge.high,
            "decision": gauge.decision.bits(), "reason": gauge.reason.as_deref(),
            "too_fine": fine.is_some_and(|(apart, u)| apart < FINE * u),
        })
    };
    judged.gauges.iter().map(gauge).collect()
}
