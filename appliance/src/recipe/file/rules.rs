//! The rules that a recipe's manifest keeps, in one order: an editor shows all that is broken,
//! `problems`; what reads, edits or teaches a recipe refuses the first, `check`.
//!
//! The same bounds hold for files that are read and for edits; `docs/formats.md` lists them. Those
//! of single values stand beside their keys. Without the rules of judging a part of any
//! shape could pass, and nobody would see why.

use super::feature::LONGEST_NAME;
use super::refusal::refused;
use crate::recipe::{
    DatumFile, Element, FeatureFile, GaugeFile, Part, PatternFile, RecipeFile, Refusal,
    SequenceFile,
};
use crate::station::MAX_GAUGES;
use algo::inspect::{FeatureKind, MAX_FEATURES, MAX_PLACES, Marking, makes_datum};
use algo::pattern::{MAX_FRAMES, Sequence, Shot};
use hal::bounds::{
    Bound, Fields, MAX_FRINGES, MAX_RANGE_MM, MAX_SHIFT_TURNS, RATIOS, clipped, length, text,
    within,
};
use std::ops::ControlFlow;

/// Sequences that a part can be measured with; teaching makes four.
const MAX_SEQUENCES: usize = 8;
/// Corners of an outline, and places of each kind that are touched.
const MAX_CORNERS: usize = 256;
const MAX_TOUCHES: usize = 64;
/// Slots of gauges.
const MAX_SLOT: u16 = MAX_GAUGES as u16;
/// Datum systems of a recipe.
pub(crate) const MAX_DATUMS: usize = 8;

/// Which rules must be kept; each of these adds to those before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rules {
    /// Values lie in their bounds, and features and datum systems that are named are there.
    Bounds,
    /// It can judge: limits that a part can keep and miss, names that are unique, steps between two
    /// features.
    Judging,
    /// It is an edit: names are not empty, regions lie in the frame. Gauges may stand in any order,
    /// and limits that come from golden are checked when golden has been measured.
    Edit,
}

/// What a check finds.
type Checked = Result<(), Refusal>;

/// All rules that an edited list breaks, as far as golden need not be measured.
pub(crate) fn problems(file: &RecipeFile) -> Vec<Refusal> {
    let mut all = Vec::new();
    let mut keep = |refusal| {
        all.push(refusal);
        ControlFlow::Continue(())
    };
    let _ = Visit(Rules::Edit, &mut keep).recipe(file);
    all
}

/// Refuses a recipe that breaks one of these rules.
///
/// # Errors
/// The first that it breaks: a sentence that names the key or the element, and the remedy.
pub(crate) fn check(file: &RecipeFile, rules: Rules) -> Checked {
    match Visit(rules, &mut ControlFlow::Break).recipe(file) {
        ControlFlow::Break(refusal) => Err(refusal),
        ControlFlow::Continue(()) => Ok(()),
    }
}

/// Visits a recipe, and answers each broken rule as the function says.
struct Visit<'a>(Rules, &'a mut dyn FnMut(Refusal) -> ControlFlow<Refusal>);

impl Visit<'_> {
    fn recipe(mut self, file: &RecipeFile) -> ControlFlow<Refusal> {
        let is_edit = self.0 == Rules::Edit;
        if is_edit {
            self.add(None, check_name("recipe", &file.name))?;
        }
        for check in [
            check_whole(file),
            length("features", file.features.len(), 0, MAX_FEATURES).map_err(Refusal::from),
            length("datums", file.datums.len(), 0, MAX_DATUMS).map_err(Refusal::from),
            length("gauges", file.gauges.len(), 1, MAX_GAUGES).map_err(Refusal::from),
        ] {
            self.add(None, check)?;
        }
        let size = (file.camera.width as usize, file.camera.height as usize);
        let names: Vec<_> = file.features.iter().map(|feature| &feature.name).collect();
        for (place, feature) in file.features.iter().enumerate() {
            let bounds = feature.check_bounds();
            if let Some(element) = self.element(Part::Feature, &names[..=place], bounds)? {
                if is_edit {
                    self.add(Some(&element), feature.pixels(size).map(drop))?;
                }
                self.add(Some(&element), check_plane(file, feature))?;
            }
        }
        let names: Vec<_> = file.datums.iter().map(|datum| &datum.name).collect();
        for (place, datum) in file.datums.iter().enumerate() {
            let bounds = datum.check_bounds();
            if let Some(element) = self.element(Part::Datum, &names[..=place], bounds)? {
                self.add(Some(&element), check_frame(file, datum))?;
            }
        }
        let names: Vec<_> = file.gauges.iter().map(|gauge| &gauge.name).collect();
        let longest = file.camera.width.max(file.camera.height) as usize;
        for (place, gauge) in file.gauges.iter().enumerate() {
            let bounds = check_gauge(gauge, longest);
            let Some(element) = self.element(Part::Gauge, &names[..=place], bounds)? else {
                continue;
            };
            let element = Some(&element);
            self.add(element, check_slot(&file.gauges[..place], gauge, is_edit))?;
            self.add(element, check_shifts(file, gauge))?;
            self.add(element, check_features(file, gauge))?;
            if self.0 >= Rules::Judging {
                if !(is_edit && gauge.needs_golden()) {
                    self.add(element, gauge.check_judging())?;
                }
                self.add(element, check_step(file, gauge))?;
            }
        }
        if self.0 >= Rules::Judging {
            self.add(None, check_limited(file))?;
        }
        ControlFlow::Continue(())
    }

    /// Takes over what a check refuses; answers whether it refuses nothing.
    fn add(
        &mut self,
        of: Option<&Element>,
        check: Result<(), impl Into<Refusal>>,
    ) -> ControlFlow<Refusal, bool> {
        let Err(refusal) = check else {
            return ControlFlow::Continue(true);
        };
        let words = refusal.into().words;
        let of = of.cloned();
        (self.1)(Refusal { words, of })?;
        ControlFlow::Continue(false)
    }

    /// Checks the last of these names; answers the element if its bounds are kept.
    fn element(
        &mut self,
        part: Part,
        names: &[&String],
        bounds: Checked,
    ) -> ControlFlow<Refusal, Option<Element>> {
        let [before @ .., name] = names else {
            return ControlFlow::Continue(None);
        };
        let place = before.len();
        let element = Element::new(part, place, name);
        let of = Some(&element);
        let word = part.word();
        let is_named = self.0 < Rules::Edit || self.add(of, check_name(word, name))?;
        if is_named && self.0 >= Rules::Judging && before.contains(name) {
            let twice = format!("two of them are called {name:?}: give each {word} its own name");
            self.add(of, Err(twice))?;
        }
        let end = if part == Part::Gauge { ": " } else { "." };
        let bounds = bounds.map_err(|error| format!("{word}s[{place}]{end}{error}"));
        let is_bounded = self.add(of, bounds)?;
        ControlFlow::Continue(is_bounded.then_some(element))
    }
}

/// Refuses a name that is empty or too long.
fn check_name(what: &str, name: &str) -> Checked {
    let length = name.chars().count();
    match name.trim().is_empty() || length > LONGEST_NAME {
        true => refused!(
            "{what} name {:?} has {length} characters: write 1 to {LONGEST_NAME}",
            clipped(name)
        ),
        false => Ok(()),
    }
}

/// Checks what a person has marked.
///
/// # Errors
/// In words that name the key, the number and the bounds.
pub fn check_marking(marking: &Marking) -> Checked {
    let corners = marking.outline.len();
    if corners > 0 {
        length("marking.outline", corners, 3, MAX_CORNERS)?;
    }
    length("marking.part", marking.part.len(), 0, MAX_TOUCHES)?;
    Ok(length(
        "marking.others",
        marking.others.len(),
        0,
        MAX_TOUCHES,
    )?)
}

/// Checks each value that is of no feature, datum system or gauge.
fn check_whole(file: &RecipeFile) -> Checked {
    Fields.check("", file)?;
    if !file.part_number.is_ascii() {
        let key = format!("part_number {:?}", file.part_number);
        return refused!("{key} has characters that are not ASCII");
    }
    if let PatternFile::Vertical { fringes } | PatternFile::Horizontal { fringes } = file.pattern {
        within("pattern.fringes", fringes, 1e-3, MAX_FRINGES)?;
    }
    check_marking(&file.marking)?;
    length("sequences", file.sequences.len(), 1, MAX_SEQUENCES)?;
    for (place, sequence) in file.sequences.iter().enumerate() {
        let checked = check_sequence(sequence);
        checked.map_err(|error| format!("sequences[{place}].{error}"))?;
    }
    within("production", file.production, 0, file.sequences.len() - 1)?;
    let [low, high] = file.range_mm;
    within("range_mm", low, -MAX_RANGE_MM, MAX_RANGE_MM)?;
    within("range_mm", high, low, MAX_RANGE_MM)?;
    if let Some(counts) = file.golden_offset_counts {
        let full_scale = f64::from((1_u32 << file.camera.bit_depth) - 1);
        within("golden_offset_counts", counts, 0.0, full_scale)?;
    }
    Ok(())
}

fn check_sequence(sequence: &SequenceFile) -> Checked {
    length("frames", sequence.frames.len(), 3, MAX_FRAMES)?;
    let [low, high] = RATIOS;
    let check_shot = |shot: &Shot| {
        within("ratio", shot.ratio, low, high)?;
        within("shift", shot.shift, -MAX_SHIFT_TURNS, MAX_SHIFT_TURNS)?;
        let mut harmonics = shot.waveform.harmonics();
        harmonics.try_for_each(|(_, share)| within("share of a harmonic", share, -1.0, 1.0))
    };
    for (place, shot) in sequence.frames.iter().enumerate() {
        check_shot(shot).map_err(|error| format!("frames[{place}]: {error}"))?;
    }
    Fields.check("", sequence)?;
    let levels = Sequence::from_frames(&sequence.frames);
    levels.map_err(|error| format!("frames: {error}"))?;
    Ok(())
}

/// Checks each value of a gauge by itself, for frames whose longer side has `longest` pixels.
fn check_gauge(gauge: &GaugeFile, longest: usize) -> Checked {
    text("name", &gauge.name, LONGEST_NAME)?;
    within("slot", gauge.slot, 1, MAX_SLOT)?;
    length("of", gauge.of.len(), 0, MAX_PLACES)?;
    let mut names = gauge.of.iter().chain(&gauge.datum);
    names.try_for_each(|name| text("of", name, LONGEST_NAME))?;
    gauge.check_numbers()?;
    let parameters = gauge.measures.kind().parameters();
    let mut parameters = parameters.into_iter();
    Ok(parameters.try_for_each(|parameter| parameter.check(longest))?)
}

/// Refuses a slot that a gauge before has, and, but in an edit, one that is below those.
fn check_slot(before: &[GaugeFile], gauge: &GaugeFile, is_edit: bool) -> Checked {
    let slot = gauge.slot;
    let name = clipped(&gauge.name);
    if let Some(other) = before.iter().find(|other| other.slot == slot) {
        let other = clipped(&other.name);
        return refused!("gauges {other:?} and {name:?} both have slot {slot}: give each its own");
    }
    match before.last().filter(|last| last.slot > slot && !is_edit) {
        None => Ok(()),
        Some(last) => refused!(
            "gauge {name:?} of slot {slot} stands behind {:?} of slot {}: write them in the order of their slots",
            clipped(&last.name),
            last.slot
        ),
    }
}

/// Checks that the features of a datum system are there and make a frame.
fn check_frame(file: &RecipeFile, DatumFile { name, of }: &DatumFile) -> Checked {
    let datum = format!("datum {:?}", clipped(name));
    check_all_there(file, &datum, of)?;
    let kinds = of.iter().filter_map(|name| file.feature(name));
    let kinds: Vec<FeatureKind> = kinds.map(|feature| feature.kind).collect();
    match makes_datum(&kinds) {
        true => Ok(()),
        false => refused!(
            "{datum} is no frame: name a plane, then a circle, slot or line, then another one that is not a plane"
        ),
    }
}

/// Checks that what a feature lies in is there and a plane.
fn check_plane(file: &RecipeFile, feature: &FeatureFile) -> Checked {
    let Some(plane) = &feature.plane else {
        return Ok(());
    };
    match file.feature(plane).map(|feature| feature.kind) {
        Some(FeatureKind::Plane) => Ok(()),
        found => refused!(
            "feature {:?} lies in {:?}, which is {}: name a plane",
            clipped(&feature.name),
            clipped(plane),
            found.map_or("not there".into(), |kind| format!("a {}", kind.name()))
        ),
    }
}

/// Refuses a gauge of a contour where two frames are used.
fn check_shifts(file: &RecipeFile, gauge: &GaugeFile) -> Checked {
    match file.two_frames && file.is_of_contour(gauge) {
        true => refused!(
            "gauge {:?} is of a contour, which needs three shifts or more, and two_frames is true: set it to false",
            clipped(&gauge.name)
        ),
        false => Ok(()),
    }
}

fn check_all_there(file: &RecipeFile, what: &str, names: &[String]) -> Checked {
    for (at, name) in names.iter().enumerate() {
        let called = clipped(name);
        if file.feature(name).is_none() {
            return refused!("{what} names a feature {called:?} that is not there");
        }
        if names[..at].contains(name) {
            return refused!("{what} names the feature {called:?} twice");
        }
    }
    Ok(())
}

/// Checks the features and the datum system of a gauge.
fn check_features(file: &RecipeFile, gauge: &GaugeFile) -> Checked {
    let what = format!("gauge {:?}", clipped(&gauge.name));
    let (facts, kind) = (gauge.measures.facts(), gauge.measures.name());
    let (count, taken) = (gauge.of.len(), facts.takes.len());
    if count != taken {
        return refused!("{what} is of {count} features: {kind} takes {taken}");
    }
    // A step of a region from itself is refused with its own words.
    let named = match &gauge.of[..] {
        [one, other] if one == other => &gauge.of[..1],
        of => of,
    };
    check_all_there(file, &what, named)?;
    let mut kinds = Vec::new();
    for (name, fitting) in gauge.of.iter().zip(facts.takes) {
        let found = file.feature(name).map(|feature| feature.kind);
        if !found.is_some_and(|kind| fitting.contains(&kind)) {
            let fitting: Vec<_> = fitting.iter().map(|kind| kind.name()).collect();
            return refused!(
                "{what} is of {:?}, a {}: {kind} takes a {} there",
                clipped(name),
                found.map_or("feature", FeatureKind::name),
                fitting.join(" or a ")
            );
        }
        kinds.extend(found);
    }
    if !gauge.measures.measures(&kinds) {
        return refused!("{what}: {kind} does not measure such a pair of features");
    }
    match &gauge.datum {
        Some(name) if !file.datums.iter().any(|datum| datum.name == *name) => {
            refused!("{what} names a datum {:?} that is not there", clipped(name))
        }
        Some(_) if !facts.datum => {
            refused!("{what} has a datum: {kind} takes none, leave it out")
        }
        _ => Ok(()),
    }
}

/// Refuses what a feature has from itself, under whatever name: it is 0 for every part.
fn check_step(file: &RecipeFile, gauge: &GaugeFile) -> Checked {
    let [region, from] = &gauge.of[..] else {
        return Ok(());
    };
    let polygon = |name: &str| file.feature(name).map(|feature| &feature.region);
    let same = from == region || polygon(from).is_some_and(|here| polygon(region) == Some(here));
    match same {
        true => refused!(
            "gauge {:?} measures the {} of {region:?} from itself, which is 0 whatever the part: name another feature",
            gauge.name,
            gauge.measures.name()
        ),
        false => Ok(()),
    }
}

/// Refuses a recipe without any limit that does not say so, and one that says so and has some.
fn check_limited(file: &RecipeFile) -> Checked {
    let limited = file.gauges.iter().find(|gauge| gauge.can_fail());
    match (limited, file.judges_nothing) {
        (None, false) => Err(
            "it judges nothing: no gauge has a limit that a part can miss, so every part that is measured would pass: give a gauge \
             limits, or state \"judges_nothing\": true to measure only"
                .into(),
        ),
        (Some(GaugeFile { name, .. }), true) => refused!(
            "it states \"judges_nothing\": true, but gauge {name:?} has limits: take one of them away"
        ),
        _ => Ok(()),
    }
}
