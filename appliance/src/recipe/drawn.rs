//! What is drawn of a feature that was looked for, as data: its fit, the pieces of a contour, the
//! profile of a section.

use algo::inspect::contour::Outcome;
use algo::inspect::section::{self, flush, gap};
use algo::inspect::{Drawn, FeatureKind, Geometry, Place, Profile};
use serde::Serialize;
use serde_json::{Value, json};

/// A piece of a contour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Piece {
    /// Where the camera sees it, px.
    at: Place,
    accepted: bool,
    why: &'static str,
}

/// What became of a piece, in a word.
fn word(outcome: Outcome) -> &'static str {
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
pub(super) fn px(at: Place) -> Place {
    at.map(|at| (at * 100.0).round() / 100.0)
}

/// Tenths of a µm.
fn mm(at: [f64; 2]) -> [f64; 2] {
    at.map(|at| (at * 1e4).round() / 1e4)
}

/// The pieces of a contour.
pub(super) fn pieces(drawn: &Drawn) -> Vec<Piece> {
    let pieces = drawn.pieces.iter();
    pieces
        .map(|&(at, outcome)| Piece {
            at: px(at),
            accepted: outcome == Outcome::Accepted,
            why: word(outcome),
        })
        .collect()
}

/// What to draw of a feature that was found (docs/api.md, `fit`): its outline on the part, its
/// centre there, and what its geometry has beside centre, direction and size.
pub(super) fn fit(
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
pub(super) fn profile(of: &Profile) -> Value {
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
