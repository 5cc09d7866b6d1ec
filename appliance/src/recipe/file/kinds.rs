//! The tables of kinds as data: what gauges can measure, and what a form for features, datum systems
//! and limits needs, for programs that show or edit recipes (no editor has a list of its own), and
//! for people.

use super::feature;
use super::feature::{LONGEST_NAME, MAX_CORNERS, MAX_OF};
use super::rules::MAX_DATUMS;
use algo::inspect::{
    Domain, FeatureKind, MAX_FEATURES, MAX_GAUGES, Measure, Parameter, Unit, makes_datum,
};
use serde_json::{Value, json};

/// All kinds of gauges in their order, with their default parameters, and the units that they have
/// with the smallest and the largest limit in each, and what forms need (docs/api.md, `GET /api/kinds`).
pub fn json() -> Value {
    let kinds: Vec<Value> = Measure::examples().iter().map(kind).collect();
    let units = [Unit::Length, Unit::Angle, Unit::Volume, Unit::Share].map(|unit| {
        let [low, high] = unit.range();
        json!({ "unit": unit.symbol(), "low": low, "high": high })
    });
    json!({
        "kinds": kinds, "units": units, "limits": limits(), "datums": datums(),
        "features": FeatureKind::ALL.map(|kind| feature::KindRow::of(kind).json()),
        "bounds": {
            "features": MAX_FEATURES, "gauges": MAX_GAUGES, "corners": MAX_CORNERS,
            "characters": LONGEST_NAME,
        },
    })
}

/// The same for people: a line for each kind, what it measures, and a line for each parameter.
pub fn table() -> String {
    let lines = Measure::examples()
        .iter()
        .flat_map(lines)
        .collect::<Vec<_>>();
    lines.join("\n")
}

fn kind(example: &Measure) -> Value {
    let (facts, kind) = (example.facts(), example.kind());
    let parameters = kind.parameters();
    let parameters = parameters.iter().map(|of| parameter(example, of));
    json!({
        "kind": example.name(),
        "about": kind.about(),
        "words": facts.words,
        "unit": facts.unit.symbol(),
        "takes": takes(example),
        "pairs": pairs(example),
        "negative": negative(example),
        "datum": facts.datum,
        "compares": facts.compares,
        "margin_px": facts.margin_px(0),
        "parameters": parameters.collect::<Vec<_>>(),
    })
}

fn parameter(example: &Measure, of: &Parameter) -> Value {
    let [least, most] = of.range(usize::MAX).unwrap_or_default();
    let unit = Unit::Length.symbol();
    let choice = |word: &&str| {
        let unit = unit_with(example, of.name, word).symbol();
        json!({ "word": word, "unit": unit })
    };
    let mut all = match of.domain {
        Domain::Pixels { odd } => json!({ "unit": "px", "least": 1, "odd": odd }),
        Domain::Length { positive: false } => json!({ "unit": unit, "least": least, "most": most }),
        Domain::Place => json!({ "unit": unit, "least": least, "most": most, "count": 2 }),
        Domain::Length { positive: true } => json!({ "unit": unit, "above": least, "most": most }),
        Domain::Words(words) => {
            json!({ "choices": words.iter().map(choice).collect::<Vec<_>>() })
        }
    };
    all["name"] = of.name.into();
    all["about"] = of.about.into();
    all["default"] = default(example, of);
    all
}

fn lines(example: &Measure) -> Vec<String> {
    let (facts, kind) = (example.facts(), example.kind());
    let parameters = kind.parameters();
    let mut units = vec![facts.unit];
    for of in &parameters {
        let Domain::Words(words) = of.domain else {
            continue;
        };
        for word in words {
            let unit = unit_with(example, of.name, word);
            if !units.contains(&unit) {
                units.push(unit);
            }
        }
    }
    let units = units.iter().map(|unit| match unit.symbol() {
        "" => "share",
        symbol => symbol,
    });
    let units = units.collect::<Vec<_>>().join(" or ");
    let of = match takes(example) {
        whole if whole.is_empty() => "whole part".into(),
        places => {
            let places: Vec<_> = places.iter().map(|place| place.join(" or ")).collect();
            places.join(", ")
        }
    };
    let sign = if negative(example) { "" } else { ", 0 or more" };
    let mut lines = vec![
        format!("{} ({of}; {units}{sign})", example.name()),
        format!("    {}", kind.about()),
    ];
    lines.extend(parameters.iter().map(|of| line(example, of)));
    lines
}

fn line(example: &Measure, of: &Parameter) -> String {
    let [least, most] = of.range(usize::MAX).unwrap_or_default();
    let unit = Unit::Length.symbol();
    let range = match of.domain {
        Domain::Pixels { odd } => {
            let odd = if odd { "an odd number, " } else { "" };
            format!("{odd}1 px to the longer side of the frame")
        }
        Domain::Length { positive: false } => format!("{least} to {most} {unit}"),
        Domain::Length { positive: true } => format!("more than {least}, up to {most} {unit}"),
        Domain::Place => format!("two of {least} to {most} {unit}"),
        Domain::Words(words) => words.join(", "),
    };
    let default = match default(example, of) {
        Value::String(word) => word,
        number => number.to_string(),
    };
    format!("    {} = {default} ({range}): {}", of.name, of.about)
}

/// The kinds of its features, place by place.
fn takes(example: &Measure) -> Vec<Vec<&'static str>> {
    let names = |place: &&[FeatureKind]| place.iter().map(|kind| kind.name()).collect();
    example.facts().takes.iter().map(names).collect()
}

/// Whether a value can be below 0.
fn negative(example: &Measure) -> bool {
    let facts = example.facts();
    !facts.never_negative && facts.unit.range()[0] < 0.0
}

/// The value of a parameter in an example.
fn default(example: &Measure, of: &Parameter) -> Value {
    let example = serde_json::to_value(example).unwrap_or_default();
    example[of.name].clone()
}

/// The unit that an example has with another word for a parameter.
fn unit_with(example: &Measure, name: &str, word: &str) -> Unit {
    let with = || {
        let mut measures = serde_json::to_value(example).ok()?;
        measures[name] = word.into();
        serde_json::from_value::<Measure>(measures).ok()
    };
    with().map_or(Unit::None, |with| with.facts().unit)
}

/// Which kinds of features go together in a gauge of two; none of others.
fn pairs(of: &Measure) -> Vec<[&'static str; 2]> {
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
fn datums() -> Value {
    let mut frames: Vec<Vec<FeatureKind>> = vec![Vec::new()];
    let mut from = 0;
    for _ in 0..MAX_OF {
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
fn limits() -> Value {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::DatumFile;

    #[test]
    fn every_kind_is_listed_with_words_for_its_parameters_alone_and_its_defaults_are_allowed() {
        let (all, table) = (json(), table());
        let kinds = all["kinds"].as_array().unwrap();
        assert_eq!(kinds.len(), Measure::examples().len());
        let units: Vec<&Value> = all["units"]
            .as_array()
            .unwrap()
            .iter()
            .map(|of| &of["unit"])
            .collect();
        for (kind, example) in kinds.iter().zip(Measure::examples()) {
            let measures = serde_json::to_value(&example).unwrap();
            assert_eq!(measures["kind"], kind["kind"]);
            assert!(kind["about"].as_str().unwrap().ends_with('.'), "{kind}");
            for field in kind["words"].as_str().unwrap().split('{').skip(1) {
                let (field, _) = field.split_once('}').unwrap();
                assert!(measures.get(field).is_some(), "{kind}");
            }
            for parameter in kind["parameters"].as_array().unwrap() {
                let name = parameter["name"].as_str().unwrap();
                assert_eq!(measures[name], parameter["default"], "{kind}");
                assert!(!parameter["default"].is_null(), "{kind}");
            }
            for parameter in example.kind().parameters() {
                assert_eq!(parameter.check(1456), Ok(()));
            }
            assert!(units.contains(&&kind["unit"]), "{kind}");
            assert!(table.contains(&format!("{} (", example.name())));
        }
    }

    #[test]
    fn the_unit_of_a_placement_follows_from_its_component() {
        let all = json();
        let mut kinds = all["kinds"].as_array().unwrap().iter();
        let placement = kinds.find(|of| of["kind"] == "placement").unwrap();
        let choices = placement["parameters"][0]["choices"].as_array().unwrap();
        let units: Vec<&Value> = choices.iter().map(|of| &of["unit"]).collect();
        assert_eq!(units, ["mm", "mm", "mm", "°", "°", "°"]);
        assert!(table().contains("placement (whole part; ° or mm)"));
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
