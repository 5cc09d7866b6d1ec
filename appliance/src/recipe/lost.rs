//! Why a feature was not found on a part, in words, and what to do.

use algo::inspect::{FoundFeature, Lost, State};

/// Less than this share of a feature is not measured.
pub(super) const MIN_SHARE: f64 = 0.5;

/// Why a plane, contour or section was not found, and the remedy.
pub(super) fn why_lost(found: &FoundFeature) -> (String, &'static str) {
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
