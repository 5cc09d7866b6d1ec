//! What a recipe measures, by names: what is said and drawn of a part beside its numbers.

use super::RecipeFile;
use super::drawn::{self, Piece};
use super::lost::why_lost;
use crate::station::{GaugeValue, Inspection};
use algo::geometry::Vector;
use algo::inspect::{Drawing, FeatureKind, Geometry, Place, State};
use serde::Serialize;
use serde_json::Value;

/// The kinds of a recipe's gauges, and its features with the gauges that are of them.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Slot and kind of each gauge.
    gauges: Vec<(u16, &'static str)>,
    features: Vec<Outlined>,
}

#[derive(Clone, Debug)]
struct Outlined {
    name: String,
    kind: FeatureKind,
    /// Slots of the gauges that are of it.
    slots: Vec<u16>,
    /// Of a contour, the name of its plane.
    plane: Option<String>,
    /// Corners of its region, or the ends of a section, in golden's frame.
    places: Vec<Place>,
}

/// A feature of a part that was measured (docs/api.md). Places are in camera pixels of the part's
/// frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Seen<'a> {
    name: &'a str,
    kind: &'static str,
    state: &'static str,
    /// Why it was not found.
    reason: Option<String>,
    /// What to do about it.
    remedy: Option<&'static str>,
    /// The share of its rim or surface that was seen.
    found: Option<f64>,
    /// σ of the camera's blur at its rim, px.
    blur_px: Option<f64>,
    /// Its centre or middle in the frame as taught, mm.
    centre: Option<[f64; 3]>,
    /// The direction of a line or of the axis of a slot, the normal of a plane or hole.
    direction: Option<[f64; 3]>,
    /// Diameter, or length and width, mm.
    size: Vec<f64>,
    /// Of a contour, the name of its plane, or `own`.
    plane: Option<&'a str>,
    /// What to draw where it was found.
    fit: Option<Value>,
    /// Of a contour.
    pieces: Vec<Piece>,
    /// Of a section.
    profile: Option<Value>,
}

/// What to do about a surface without a value.
const SURFACE: &str = "move its region to where heights are measured, or light it better";

/// What became of a feature in a part, in a word.
fn word(state: State) -> &'static str {
    match state {
        State::Found => "found",
        State::Absent => "absent",
        State::Unseen => "unseen",
    }
}

/// What became of what a gauge measures.
fn state(gauge: &GaugeValue) -> State {
    match gauge.value {
        Some(_) => State::Found,
        None if gauge.decision.absent => State::Absent,
        None => State::Unseen,
    }
}

impl Seen<'_> {
    /// Its name.
    pub fn name(&self) -> &str {
        self.name
    }

    /// Why it was not found, and what to do; `None` if it was.
    pub fn lost(&self) -> Option<(&str, &str)> {
        let reason = self.reason.as_deref().unwrap_or("found nothing to measure");
        let remedy = self.remedy.unwrap_or(SURFACE);
        (self.state != word(State::Found)).then_some((reason, remedy))
    }
}

impl From<&RecipeFile> for Outline {
    fn from(file: &RecipeFile) -> Self {
        let gauges = file.gauges.iter();
        let of = |name: &String| {
            let gauges = file.gauges.iter().filter(|gauge| gauge.of.contains(name));
            gauges.map(|gauge| gauge.slot).collect()
        };
        let features = file.features.iter().map(|feature| Outlined {
            name: feature.name.clone(),
            kind: feature.kind,
            slots: of(&feature.name),
            plane: feature.plane.clone(),
            places: match feature.from.zip(feature.to) {
                Some((from, to)) => vec![from, to],
                None => feature.region.clone(),
            },
        });
        Self {
            gauges: gauges
                .map(|gauge| (gauge.slot, gauge.measures.name()))
                .collect(),
            features: features.collect(),
        }
    }
}

impl Outline {
    /// The kind of the gauge in a slot.
    pub fn kind(&self, slot: u16) -> Option<&'static str> {
        let mut gauges = self.gauges.iter();
        let found = gauges.find(|(own, _)| *own == slot);
        found.map(|(_, kind)| *kind)
    }

    /// What became of each feature that a gauge needs: of those with a geometry as it was found, of
    /// others from what became of the gauges that are of it. Of several, one that has a value
    /// decides.
    pub fn features(&self, of: &Inspection, drawing: &Drawing<'_>) -> Vec<Seen<'_>> {
        let all = self.features.iter().enumerate();
        all.filter_map(|(at, feature)| feature.seen(at, of, drawing))
            .collect()
    }
}

fn list(of: Vector) -> [f64; 3] {
    [of.x, of.y, of.z]
}

impl Outlined {
    /// What became of it in a part; `None` if no gauge needs it.
    fn seen<'a>(&'a self, at: usize, of: &Inspection, drawing: &Drawing<'_>) -> Option<Seen<'a>> {
        let found = of.features.iter().find(|found| found.feature == at);
        let by_gauges = || {
            let own = of.gauges.iter();
            let own = own.filter(|gauge| self.slots.contains(&gauge.slot));
            let rank = |gauge: &&GaugeValue| match state(gauge) {
                State::Found => 0,
                State::Absent => 1,
                State::Unseen => 2,
            };
            own.min_by_key(rank)
        };
        let (state, reason, remedy) = match found {
            Some(found) if found.state == State::Found => (State::Found, None, None),
            Some(found) => {
                let (reason, remedy) = why_lost(found);
                (found.state, Some(reason), Some(remedy))
            }
            None => {
                let gauge = by_gauges()?;
                let reason = gauge.reason.as_deref().map(String::from);
                let remedy = reason.is_some().then_some(SURFACE);
                (state(gauge), reason, remedy)
            }
        };
        let geometry = found.and_then(|found| found.geometry);
        let drawn = drawing.of(at);
        let fit = || {
            let moved = || -> Vec<Place> {
                let places = self.places.iter();
                places.map(|&place| drawing.moved(place)).collect()
            };
            let outline = drawn.as_ref().map(|drawn| drawn.outline.clone());
            let outline = outline.filter(|_| self.kind.is_contour());
            let outline = outline.unwrap_or_else(moved);
            let closed = !matches!(self.kind, FeatureKind::Line | FeatureKind::Section);
            let centre = geometry.and_then(|of| drawing.place(of.point));
            let ends = drawn.as_ref().and_then(|drawn| drawn.ends);
            let ends = ends.map(|ends| ends.map(list));
            drawn::fit(geometry, (&outline, closed), (centre, ends))
        };
        let profile = drawn.as_ref().and_then(|drawn| drawn.profile.as_ref());
        let own = self.kind.is_contour().then_some("own");
        let direction = |of: Geometry| list(of.direction.unwrap_or(of.normal));
        Some(Seen {
            name: &self.name,
            kind: self.kind.name(),
            state: word(state),
            reason,
            remedy,
            found: found.map(|found| found.found),
            blur_px: found.and_then(|found| found.rim).map(|rim| rim.blur_px),
            centre: geometry.map(|of| list(of.point)),
            direction: geometry.map(direction),
            size: geometry.map_or(Vec::new(), |of| of.sizes.into_iter().flatten().collect()),
            plane: self.plane.as_deref().or(own),
            fit: (state == State::Found).then(fit),
            profile: profile.map(drawn::profile),
            pieces: drawn.as_ref().map_or(Vec::new(), drawn::pieces),
        })
    }
}
