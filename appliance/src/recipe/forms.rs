//! What a form for features, datum systems and limits needs, as data (docs/api.md, `GET
//! /api/kinds`): no editor has a list of its own.

use super::feature::{LONGEST_NAME, MAX_CORNERS, MAX_RIM_MM, MAX_SECTION_MM, MAX_THICKNESS_MM};
use super::references::MAX_DATUMS;
use algo::inspect::{FeatureKind, MAX_FEATURES, MAX_GAUGES, Measure, makes_datum};
use serde_json::{Value, json};

/// How far the region of a contour reaches beyond it on both sides, mm: room for where the part may
/// lie, and for the face that its plane is fitted to.
const AROUND_MM: f64 = 1.5;

/// All kinds of features.
pub(super) fn features() -> Vec<Value> {
    FeatureKind::ALL.map(feature).into()
}

fn feature(kind: FeatureKind) -> Value {
    use FeatureKind::{Circle, Line, Plane, Section, Slot, Surface};
    let (about, shapes): (&str, &[&str]) = match kind {
        Surface => (
            "Heights, and deviations from golden, of a region.",
            &["rectangle", "polygon", "circle"],
        ),
        Plane => (
            "The plane that fits the heights of a region best, by least squares.",
            &["rectangle", "polygon", "circle"],
        ),
        Line => (
            "A straight edge of a face, where the face ends.",
            &["points", "rectangle", "polygon"],
        ),
        Circle => (
            "A round hole in a face: where the face ends, by least squares.",
            &["circle", "rectangle", "polygon"],
        ),
        Slot => (
            "A slot with round ends in a face: where the face ends, by least squares.",
            &["rectangle", "polygon"],
        ),
        Section => (
            "A cut across a joint of two sheets with rounded edges.",
            &["section"],
        ),
    };
    json!({
        "kind": kind.name(), "about": about, "shapes": shapes,
        "around_mm": kind.is_contour().then_some(AROUND_MM),
        "parameters": parameters(kind), "gauges": gauges(kind), "size": size(kind),
    })
}

/// The kind of gauge that measures a feature whose size is one number.
fn size(kind: FeatureKind) -> Option<&'static str> {
    matches!(kind, FeatureKind::Circle).then_some("diameter")
}

/// The keys of a feature beside its name, kind and region.
fn parameters(kind: FeatureKind) -> Vec<Value> {
    match kind {
        FeatureKind::Surface => Vec::new(),
        FeatureKind::Plane => vec![
            json!({
                "name": "thickness_mm", "unit": "mm", "least": 0.0, "most": MAX_THICKNESS_MM, "optional": true,
                "about": "thickness of its sheet, for the walls of holes in it; 0 where no wall is seen, nothing where it is not known",
            }),
            rim("not known"),
        ],
        FeatureKind::Line | FeatureKind::Circle | FeatureKind::Slot => vec![
            json!({
                "name": "plane", "features": [FeatureKind::Plane.name()], "optional": true,
                "about": "the plane that it lies in; nothing: one is fitted to the face around it",
            }),
            rim("as its plane's"),
        ],
        FeatureKind::Section => {
            let stretch = |name: &str, about: &str| {
                json!({
                    "name": name, "unit": "mm", "least": 0.0, "most": MAX_SECTION_MM, "count": 2,
                    "optional": false, "about": about,
                })
            };
            let end = |name: &str, about: &str| {
                json!({
                    "name": name, "unit": "px", "least": 0.0, "count": 2, "optional": false, "about": about,
                })
            };
            vec![
                end("from", "where it begins"),
                end("to", "where it ends, behind the joint"),
                json!({
                    "name": "width_mm", "unit": "mm", "above": 0.0, "most": MAX_SECTION_MM, "optional": false,
                    "about": "its width across that way",
                }),
                stretch(
                    "left",
                    "from where to where the side before the joint is flat, from the beginning",
                ),
                stretch("right", "the same of the side behind the joint"),
                json!({
                    "name": "edge_mm", "unit": "mm", "above": 0.0, "most": MAX_RIM_MM, "optional": true,
                    "about": "radius of both edges, where it is known; nothing: it is measured",
                }),
                json!({
                    "name": "edge_tolerance_mm", "unit": "mm", "least": 0.0, "most": MAX_RIM_MM, "optional": true,
                    "about": "how far that radius may be off, ±: U of a gap is as large as this; nothing: 5 % of the radius (1 σ)",
                }),
            ]
        }
    }
}

/// How rims are rounded; `unstated` says what nothing means.
fn rim(unstated: &str) -> Value {
    json!({
        "name": "rim_mm", "unit": "mm", "least": 0.0, "most": MAX_RIM_MM, "optional": true,
        "stated": { "nothing": unstated, "zero": "sharp", "number": "rolled up to" },
        "about": "radius of the rims of openings: U of what is measured at them covers it; where nobody states it, rims of up to 0.3 mm",
    })
}

/// The kinds of gauges that take such a feature in one of their places.
fn gauges(kind: FeatureKind) -> Vec<&'static str> {
    let all = Measure::examples();
    let fits = |of: &&Measure| of.facts().takes.iter().any(|place| place.contains(&kind));
    all.iter().filter(fits).map(Measure::name).collect()
}

/// Which kinds of features go together in a gauge of two; none of others.
pub(super) fn pairs(of: &Measure) -> Vec<[&'static str; 2]> {
    let [first, second] = of.facts().takes else {
        return Vec::new();
    };
    let all = first
        .iter()
        .flat_map(|&one| second.iter().map(move |&other| [one, other]));
    let measured = all.filter(|pair| of.measures(pair));
    measured.map(|pair| pair.map(FeatureKind::name)).collect()
}

/// What makes a datum system.
pub(super) fn datums() -> Value {
    let mut frames: Vec<Vec<FeatureKind>> = vec![Vec::new()];
    let mut from = 0;
    for _ in 0..super::feature::MAX_OF {
        let to = frames.len();
        for at in from..to {
            for kind in FeatureKind::ALL {
                let longer = frames[at].iter().copied().chain([kind]).collect();
                frames.push(longer);
            }
        }
        from = to;
    }
    let frames = frames.iter().filter(|of| makes_datum(of));
    let names =
        |of: &Vec<FeatureKind>| -> Vec<&str> { of.iter().map(|kind| kind.name()).collect() };
    json!({
        "about": "A frame of the part's own features (ISO 5459): a plane, then what places it in the plane.",
        "most": MAX_DATUMS, "frames": frames.map(names).collect::<Vec<_>>(),
    })
}

/// The keys that the limits of a gauge come from.
pub(super) fn limits() -> Value {
    let limit = |name: &str, of: &[&str], about: &str| json!({ "name": name, "unit": null, "of": of, "about": about });
    let tolerance = ["nominal", "golden"];
    json!([
        limit("low", &["limits"], "lower limit, inclusive"),
        limit("high", &["limits"], "upper limit, inclusive"),
        limit(
            "nominal",
            &["nominal"],
            "the middle of the tolerance, from the drawing"
        ),
        limit(
            "golden",
            &["golden"],
            "true: the middle is what the part that was taught has"
        ),
        limit(
            "plus",
            &tolerance,
            "how far above the middle the upper limit lies"
        ),
        limit(
            "minus",
            &tolerance,
            "how far below the middle the lower limit lies"
        ),
        limit(
            "master",
            &["master"],
            "what another instrument has measured of the part that was taught"
        ),
        limit("master_u", &["master"], "standard uncertainty of that"),
    ])
}

/// How many there may be.
pub(super) fn bounds() -> Value {
    json!({
        "features": MAX_FEATURES, "gauges": MAX_GAUGES, "corners": MAX_CORNERS, "characters": LONGEST_NAME,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::{DatumFile, FeatureFile};

    /// A feature with what its form says must be there, in the middle of what may be.
    fn made(kind: &Value, all: bool) -> FeatureFile {
        let mut keys = json!({ "name": "a", "kind": kind["kind"] });
        if kind["shapes"][0] != "section" {
            keys["region"] = json!([[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]);
        }
        for (at, parameter) in kind["parameters"].as_array().unwrap().iter().enumerate() {
            if parameter["optional"] == true && !all {
                continue;
            }
            let name = parameter["name"].as_str().unwrap();
            let most = parameter["most"].as_f64().unwrap_or(100.0);
            // Stretches of a section follow each other.
            let number = most * (at as f64 + 1.0) / 10.0;
            keys[name] = match (parameter["features"].is_array(), parameter["count"] == 2) {
                (true, _) => "sheet".into(),
                (_, true) => json!([number, number + most / 100.0]),
                (_, false) => number.into(),
            };
        }
        serde_json::from_value(keys).unwrap()
    }

    #[test]
    fn a_feature_with_the_keys_of_its_form_is_one_and_with_another_it_is_none() {
        for kind in features() {
            for all in [false, true] {
                let feature = made(&kind, all);
                assert_eq!(feature.check_bounds(), Ok(()), "{kind}");
                let keys = serde_json::to_value(&feature).unwrap();
                for other in features() {
                    for parameter in other["parameters"].as_array().unwrap() {
                        let name = parameter["name"].as_str().unwrap();
                        let own = kind["parameters"].as_array().unwrap();
                        if own.iter().any(|of| of["name"] == parameter["name"]) {
                            continue;
                        }
                        let mut more = keys.clone();
                        more[name] =
                            serde_json::to_value(made(&other, true)).unwrap()[name].clone();
                        let more: FeatureFile = serde_json::from_value(more).unwrap();
                        assert!(more.check_bounds().is_err(), "{kind} {name}");
                    }
                }
            }
        }
    }

    #[test]
    fn gauges_of_a_kind_of_feature_are_those_that_take_it() {
        let all = features();
        let of = |kind: &str| {
            let found = all.iter().find(|of| of["kind"] == kind).unwrap();
            found["gauges"].as_array().unwrap().clone()
        };
        assert!(of("circle").contains(&"diameter".into()));
        assert!(!of("line").contains(&"diameter".into()));
        assert!(of("section").contains(&"gap".into()));
        for kind in &all {
            assert!(!kind["gauges"].as_array().unwrap().is_empty(), "{kind}");
        }
    }

    #[test]
    fn pairs_and_frames_are_those_that_a_recipe_accepts() {
        let distance = Measure::examples();
        let distance = distance.iter().find(|of| of.name() == "distance").unwrap();
        let pairs = pairs(distance);
        assert!(pairs.contains(&["plane", "plane"]) && pairs.contains(&["circle", "slot"]));
        assert!(!pairs.contains(&["plane", "circle"]));
        let datums = datums();
        let frames = datums["frames"].as_array().unwrap();
        assert!(frames.contains(&json!(["plane"])));
        assert!(frames.contains(&json!(["plane", "circle", "line"])));
        assert!(!frames.contains(&json!(["circle"])));
        for frame in frames {
            let of: Vec<String> = serde_json::from_value(frame.clone()).unwrap();
            let name = "A".into();
            assert_eq!(DatumFile { name, of }.check_bounds(), Ok(()));
        }
    }
}
