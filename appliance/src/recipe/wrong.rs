//! Everything that is wrong with a list of features, datum systems and gauges, by itself: for an
//! editor, which shows it before the list is stored. Storing it is refused with the first of these.

use super::bounds::check_slots;
use super::edit::check_names;
use super::judging::check_unique;
use super::{DatumFile, FeatureFile, GaugeFile, RecipeFile};
use serde_json::{Value, json};

/// A part of a recipe that people edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A feature.
    Feature,
    /// A datum system.
    Datum,
    /// A gauge.
    Gauge,
}

/// Something that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// With what: its name and its place in its list; `None` of the recipe as a whole.
    pub of: Option<(Part, usize, String)>,
    /// A sentence, with the remedy.
    pub words: String,
    /// Whether the list cannot be stored because of it.
    pub refused: bool,
}

impl Part {
    fn word(self) -> &'static str {
        match self {
            Self::Feature => "feature",
            Self::Datum => "datum",
            Self::Gauge => "gauge",
        }
    }
}

impl Wrong {
    /// As the API has it (docs/api.md, `problems`).
    pub fn json(&self) -> Value {
        let mut all = json!({ "words": self.words, "refused": self.refused });
        if let Some((part, at, name)) = &self.of {
            all[part.word()] = name.as_str().into();
            all["at"] = (*at).into();
        }
        all
    }

    /// Whether it is with this element of a list.
    pub(super) fn is(&self, part: Part, at: usize) -> bool {
        let of = self.of.as_ref();
        of.is_some_and(|(own, place, _)| (*own, *place) == (part, at))
    }
}

/// What is wrong, as it is collected.
struct Found(Vec<Wrong>);

impl Found {
    /// Adds what a check refuses; answers whether it refuses nothing.
    fn add(&mut self, of: Option<(Part, usize, &String)>, check: Result<(), String>) -> bool {
        let Err(words) = check else { return true };
        let of = of.map(|(part, at, name)| (part, at, name.clone()));
        self.0.push(Wrong {
            of,
            words,
            refused: true,
        });
        false
    }

    /// Adds what is wrong with the name of an element; answers whether its bounds are kept.
    fn element<'a>(
        &mut self,
        (part, at, name): (Part, usize, &'a String),
        before: impl Iterator<Item = &'a String>,
        bounds: Result<(), String>,
    ) -> bool {
        let of = Some((part, at, name));
        if self.add(of, check_names(part.word(), std::iter::once(name))) {
            let same = before.filter(|other| *other == name).take(1);
            let twice = same.chain(std::iter::once(name));
            self.add(of, check_unique(part.word(), twice));
        }
        self.add(of, bounds)
    }
}

impl RecipeFile {
    /// All that is wrong with the list as far as golden need not be measured, with gauges in any
    /// order.
    pub(super) fn wrong(&self) -> Vec<Wrong> {
        let mut found = Found(Vec::new());
        for check in [
            check_names("recipe", std::iter::once(&self.name)),
            self.check_whole(),
            self.check_counts(),
            self.check_count(),
            self.check_limited(),
        ] {
            found.add(None, check);
        }
        let size = (self.camera.width as usize, self.camera.height as usize);
        for (at, feature) in self.features.iter().enumerate() {
            let of = (Part::Feature, at, &feature.name);
            let before = self.features[..at].iter().map(|of| &of.name);
            let bounds = feature.check_bounds();
            let bounds = bounds.map_err(|error| format!("features[{at}].{error}"));
            if found.element(of, before, bounds) {
                found.add(Some(of), feature.pixels(size).map(drop));
                found.add(Some(of), self.check_plane(feature));
            }
        }
        for (at, datum) in self.datums.iter().enumerate() {
            let of = (Part::Datum, at, &datum.name);
            let before = self.datums[..at].iter().map(|of| &of.name);
            let bounds = datum.check_bounds();
            let bounds = bounds.map_err(|error| format!("datums[{at}].{error}"));
            if found.element(of, before, bounds) {
                found.add(Some(of), self.check_frame(datum));
            }
        }
        for (at, gauge) in self.gauges.iter().enumerate() {
            let of = (Part::Gauge, at, &gauge.name);
            let before = self.gauges[..at].iter();
            let bounds = gauge.check_bounds(self.longest());
            let bounds = bounds.map_err(|error| format!("gauges[{at}]: {error}"));
            if !found.element(of, before.clone().map(|of| &of.name), bounds) {
                continue;
            }
            if let Some(other) = before.clone().find(|other| other.slot == gauge.slot) {
                found.add(Some(of), check_slots(&[other.clone(), gauge.clone()]));
            }
            // Limits that come from golden are checked when golden has been measured.
            let limits = match gauge.needs_golden() {
                true => Ok(()),
                false => gauge.check_judging(),
            };
            for check in [
                self.check_shifts(gauge),
                self.check_of(gauge),
                limits,
                self.check_step(gauge),
            ] {
                found.add(Some(of), check);
            }
        }
        found.0
    }

    /// The recipe without what is wrong, and without what is of it.
    pub(super) fn without(&self, wrong: &[Wrong]) -> Self {
        let is_wrong = |part, at| {
            wrong
                .iter()
                .any(|wrong| wrong.refused && wrong.is(part, at))
        };
        let mut file = self.clone();
        let mut at = 0..;
        file.features
            .retain(|_| !at.next().is_some_and(|at| is_wrong(Part::Feature, at)));
        let planes: Vec<String> = file.features.iter().map(|of| of.name.clone()).collect();
        let has_plane = |of: &FeatureFile| of.plane.as_ref().is_none_or(|of| planes.contains(of));
        file.features.retain(has_plane);
        let names: Vec<&String> = file.features.iter().map(|of| &of.name).collect();
        let are_there = |of: &[String]| of.iter().all(|name| names.contains(&name));
        let mut at = 0..;
        file.datums.retain(|of: &DatumFile| {
            let at = at.next().unwrap_or_default();
            !is_wrong(Part::Datum, at) && are_there(&of.of)
        });
        let datums: Vec<&String> = file.datums.iter().map(|of| &of.name).collect();
        let mut at = 0..;
        file.gauges.retain(|of: &GaugeFile| {
            let at = at.next().unwrap_or_default();
            let datum = of.datum.as_ref().is_none_or(|of| datums.contains(&of));
            !is_wrong(Part::Gauge, at) && datum && are_there(&of.of)
        });
        file
    }

    /// The place of the first feature or gauge with a name in its list.
    pub(super) fn place(&self, part: Part, name: &str) -> Option<usize> {
        match part {
            Part::Feature => self.features.iter().position(|of| of.name == name),
            Part::Datum => self.datums.iter().position(|of| of.name == name),
            Part::Gauge => self.gauges.iter().position(|of| of.name == name),
        }
    }
}
