//! What is said and drawn of the features of a part, as data (docs/api.md): what became of each, why
//! one was not found and what to do, its fit, the pieces of a contour, the profile of a section.

use crate::recipe::Demands;
use crate::recipe::file::demands::LabelledFeature;
use crate::station::{GaugeValue, Inspection};
use algo::geometry::Vector;
use algo::inspect::contour::Outcome;
use algo::inspect::section::{flush, gap};
use algo::inspect::{
    Drawing, Drawn, FeatureKind, FoundFeature, Geometry, Lost, Place, Profile, State, section,
};
use serde::Serialize;
use serde_json::{Value, json};

/// A feature of a part that was measured (docs/api.md). Places are in camera pixels of the part's
/// frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FeatureView<'a> {
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

impl FeatureView<'_> {
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

impl Demands {
    /// What became of each feature that a gauge needs: of those with a geometry as it was found, of
    /// others from what became of the gauges that are of it. Of several, one that has a value
    /// decides.
    pub(super) fn seen(
        &self,
        inspection: &Inspection,
        drawing: &Drawing<'_>,
    ) -> Vec<FeatureView<'_>> {
        let all = self.features.iter().enumerate();
        all.filter_map(|(at, feature)| {
            let gauges = self.limits.iter().zip(&inspection.gauges);
            let own = gauges.filter(|(limits, _)| limits.of.contains(&feature.name));
            let rank = |gauge: &&GaugeValue| match state(gauge) {
                State::Found => 0,
                State::Absent => 1,
                State::Unseen => 2,
            };
            let gauge = own.map(|(_, gauge)| gauge).min_by_key(rank);
            feature.seen(at, inspection, gauge, drawing)
        })
        .collect()
    }
}

fn list(of: Vector) -> [f64; 3] {
    [of.x, of.y, of.z]
}

impl LabelledFeature {
    /// What became of it in a part, by its geometry or else by the gauge of it that decides; `None`
    /// if no gauge needs it.
    fn seen<'a>(
        &'a self,
        at: usize,
        inspection: &Inspection,
        gauge: Option<&GaugeValue>,
        drawing: &Drawing<'_>,
    ) -> Option<FeatureView<'a>> {
        let mut found = inspection.features.iter();
        let found = found.find(|found| found.feature == at);
        let (state, reason, remedy) = match found {
            Some(found) if found.state == State::Found => (State::Found, None, None),
            Some(found) => {
                let (reason, remedy) = why_lost(found);
                (found.state, Some(reason), Some(remedy))
            }
            None => {
                let gauge = gauge?;
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
            let area = matches!(self.kind, FeatureKind::Surface | FeatureKind::Plane);
            let closed = area || self.kind.is_opening();
            let centre = geometry.and_then(|of| drawing.place(of.point));
            let ends = drawn.as_ref().and_then(|drawn| drawn.ends);
            let ends = ends.map(|ends| ends.map(list));
            fit_json(geometry, (&outline, closed), (centre, ends))
        };
        let profile = drawn.as_ref().and_then(|drawn| drawn.profile.as_ref());
        let own = self.kind.is_contour().then_some("own");
        let direction = |of: Geometry| list(of.direction.unwrap_or(of.normal));
        Some(FeatureView {
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
            profile: profile.map(profile_json),
            pieces: drawn.as_ref().map_or(Vec::new(), pieces_of),
        })
    }
}

/// Less than this share of a feature is not measured.
pub(crate) const MIN_SHARE: f64 = 0.5;

/// Why a plane, contour or section was not found, and the remedy.
pub(crate) fn why_lost(found: &FoundFeature) -> (String, &'static str) {
    let percent = found.found * 100.0;
    match (found.state, found.lost) {
        (State::Absent, _) => (
            "the material goes on where its rim should be".into(),
            "look whether the part has it; if it has, move its region there",
        ),
        (_, Some(Lost::NoPlane)) => (
            "its plane was not found".into(),
            "move or enlarge the plane's region, to where heights are measured",
        ),
        (_, Some(Lost::Face(above))) => (
            format!("the face next to its rim lies {above:+.2} mm off the plane"),
            "leave its plane out, so that one is fitted around it",
        ),
        (_, Some(Lost::Section(unseen))) => (
            unseen.to_string(),
            "move or widen the section, or its stretches",
        ),
        (_, Some(Lost::Rim)) => (
            format!("{percent:.0} % of its rim is seen"),
            "look at the pieces that are not accepted; light the rim from another side, or place the part so that nothing covers it",
        ),
        (_, None) if found.found < MIN_SHARE => (
            format!("{percent:.0} % of it was measured"),
            "move its region to where heights are measured, or light it better",
        ),
        (_, None) => (
            "too few cells were measured, or they lie on a line".into(),
            "enlarge its region in both directions",
        ),
    }
}

/// A piece of a contour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Piece {
    /// Where the camera sees it, px.
    at: Place,
    accepted: bool,
    why: &'static str,
}

/// What became of a piece, in a word.
fn outcome_word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Accepted => "accepted",
        Outcome::Continues => "continues",
        Outcome::Unseen => "unseen",
        Outcome::Dark => "dark",
        Outcome::Edgeless => "edgeless",
        Outcome::Disturbed => "disturbed",
        Outcome::Shadowed => "shadowed",
        Outcome::Outlier => "outlier",
    }
}

/// Hundredths of a pixel are enough to draw.
pub(crate) fn px(at: Place) -> Place {
    at.map(|at| (at * 100.0).round() / 100.0)
}

/// Tenths of a µm.
fn mm(at: [f64; 2]) -> [f64; 2] {
    at.map(|at| (at * 1e4).round() / 1e4)
}

/// The pieces of a contour.
fn pieces_of(drawn: &Drawn) -> Vec<Piece> {
    let pieces = drawn.pieces.iter();
    pieces
        .map(|&(at, outcome)| Piece {
            at: px(at),
            accepted: outcome == Outcome::Accepted,
            why: outcome_word(outcome),
        })
        .collect()
}

/// What to draw of a feature that was found (docs/api.md, `fit`): its outline on the part, its
/// centre there, and what its geometry has beside centre, direction and size.
fn fit_json(
    geometry: Option<Geometry>,
    (outline, closed): (&[Place], bool),
    (centre, ends): (Option<Place>, Option<[[f64; 3]; 2]>),
) -> Value {
    let outline: Vec<Place> = outline.iter().copied().map(px).collect();
    let mut fit = json!({ "outline": outline, "closed": closed, "centre": centre.map(px) });
    let Some(Geometry {
        kind,
        point,
        normal,
        sizes,
        ..
    }) = geometry
    else {
        return fit;
    };
    match (kind, sizes) {
        (FeatureKind::Plane, _) => {
            let [x, y, z] = [normal.x, normal.y, normal.z];
            fit["equation"] = json!([x, y, z, normal.dot(point)]);
            fit["tilt_deg"] = z.clamp(-1.0, 1.0).acos().to_degrees().into();
        }
        (_, [Some(diameter), None]) => fit["radius_mm"] = (diameter / 2.0).into(),
        (_, [None, None]) => fit["ends_mm"] = json!(ends),
        _ => {}
    }
    fit
}

/// A section as it is drawn (docs/api.md, `profile`).
fn profile_json(of: &Profile) -> Value {
    let points: Vec<[f64; 2]> = of.points.iter().copied().map(mm).collect();
    let pair = |(s, z): section::Pair| mm([s, z]);
    let joint = of.joint.as_ref();
    let sides = joint.map(|joint| [joint.left, joint.right]);
    let line = |side: section::Round| [pair(side.point), pair(side.tangent)];
    let circle =
        |side: section::Round| json!({ "centre": pair(side.centre), "radius": side.radius });
    json!({
        "points": points,
        "lines": sides.map(|of| of.map(line)),
        "circles": sides.map(|of| of.map(circle)),
        "tangents": sides.map(|of| of.map(|side| pair(side.tangent))),
        "extremes": sides.map(|of| of.map(|side| pair(side.extreme))),
        "gap": joint.map(gap),
        "flush": joint.map(flush),
    })
}
