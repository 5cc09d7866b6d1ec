//! The table of kinds as data: what gauges can measure, for programs that show or edit recipes, and
//! for people.

use algo::inspect::{Domain, FeatureKind, Measure, Parameter, Unit, Value};
use serde::Serialize;
use serde_json::json;

/// All kinds of gauges, and the units that they have.
#[derive(Debug, Serialize)]
pub struct Kinds {
    kinds: Vec<Kind>,
    units: Vec<Limits>,
}

/// A unit, and the smallest and the largest limit that a gauge can have in it.
#[derive(Debug, Serialize)]
struct Limits {
    unit: &'static str,
    low: f64,
    high: f64,
}

/// A kind of gauge with its default parameters.
#[derive(Debug, Serialize)]
struct Kind {
    kind: &'static str,
    /// What it measures.
    about: &'static str,
    /// What its parameters say, behind the kind's name; the name of one in braces stands for its
    /// value.
    words: &'static str,
    unit: &'static str,
    /// The kinds of its features, place by place.
    takes: Vec<Vec<&'static str>>,
    /// Whether a value can be below 0.
    negative: bool,
    /// Whether the value is made of deviations from golden.
    compares: bool,
    /// Pixels around its region that it needs.
    margin_px: usize,
    parameters: Vec<Offered>,
}

/// A parameter of a kind.
#[derive(Debug, Serialize)]
struct Offered {
    name: &'static str,
    about: &'static str,
    default: serde_json::Value,
    #[serde(flatten)]
    may_be: MayBe,
}

/// What a parameter may be.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum MayBe {
    /// A whole number of pixels, up to the longer side of the frame.
    Pixels {
        unit: &'static str,
        least: u32,
        odd: bool,
    },
    Number {
        unit: &'static str,
        least: f64,
        most: f64,
    },
    Positive {
        unit: &'static str,
        above: f64,
        most: f64,
    },
    Choices {
        choices: Vec<Choice>,
    },
}

/// A word that a parameter may be, with the unit that the gauge has then.
#[derive(Debug, Serialize)]
struct Choice {
    word: &'static str,
    unit: &'static str,
}

impl Kinds {
    /// The whole table, in its order.
    pub fn all() -> Self {
        let units = [Unit::Length, Unit::Angle, Unit::Volume, Unit::Share];
        Self {
            kinds: Measure::examples().iter().map(Kind::of).collect(),
            units: units.map(Limits::of).into(),
        }
    }

    /// The table for people: a line for each kind, what it measures, and a line for each parameter.
    pub fn table(&self) -> String {
        let kinds = self.kinds.iter().map(Kind::lines);
        kinds.collect::<Vec<_>>().join("\n")
    }
}

impl Limits {
    fn of(unit: Unit) -> Self {
        let [low, high] = unit.range();
        let unit = unit.symbol();
        Self { unit, low, high }
    }
}

impl Kind {
    fn of(example: &Measure) -> Self {
        let (facts, kind) = (example.facts(), example.kind());
        let parameters = kind.parameters();
        let parameters = parameters.iter().map(|of| Offered::of(example, of));
        Self {
            kind: example.name(),
            about: kind.about(),
            words: facts.words,
            unit: facts.unit.symbol(),
            takes: facts.takes.iter().map(|place| names(place)).collect(),
            negative: !facts.never_negative && facts.unit.range()[0] < 0.0,
            compares: facts.compares,
            margin_px: facts.margin_px(0),
            parameters: parameters.collect(),
        }
    }

    fn lines(&self) -> String {
        let units = self.parameters.iter().flat_map(Offered::units);
        let mut all = vec![named(self.unit)];
        for unit in units.map(named) {
            if !all.contains(&unit) {
                all.push(unit);
            }
        }
        let sign = if self.negative { "" } else { ", 0 or more" };
        let mut of: Vec<String> = self.takes.iter().map(|place| place.join(" or ")).collect();
        if of.is_empty() {
            of.push("whole part".into());
        }
        let (kind, about) = (self.kind, self.about);
        let (of, units) = (of.join(", "), all.join(" or "));
        let mut lines = vec![format!("{kind} ({of}; {units}{sign})")];
        lines.push(format!("    {about}"));
        lines.extend(self.parameters.iter().map(Offered::line));
        lines.join("\n")
    }
}

fn names(kinds: &[FeatureKind]) -> Vec<&'static str> {
    kinds.iter().map(|kind| kind.name()).collect()
}

/// The symbol of a unit, or the word for a share.
fn named(unit: &'static str) -> &'static str {
    match unit {
        "" => "share",
        symbol => symbol,
    }
}

impl Offered {
    fn of(example: &Measure, parameter: &Parameter) -> Self {
        let Parameter {
            name,
            about,
            domain,
            value,
        } = *parameter;
        let [least, most] = parameter.range(usize::MAX).unwrap_or_default();
        let unit = Unit::Length.symbol();
        let may_be = match domain {
            Domain::Pixels { odd } => MayBe::Pixels {
                unit: "px",
                least: 1,
                odd,
            },
            Domain::Length { positive: false } => MayBe::Number { unit, least, most },
            Domain::Length { positive: true } => MayBe::Positive {
                unit,
                above: least,
                most,
            },
            Domain::Words(words) => MayBe::Choices {
                choices: words
                    .iter()
                    .map(|word| Choice::of(example, name, word))
                    .collect(),
            },
        };
        let default = match (value, domain) {
            (Value::Number(number), Domain::Pixels { .. }) => json!(number as u64),
            (Value::Number(number), _) => json!(number),
            (Value::Word(word), _) => json!(word),
        };
        Self {
            name,
            about,
            default,
            may_be,
        }
    }

    /// The units that the gauge has by its words.
    fn units(&self) -> impl Iterator<Item = &'static str> {
        let choices = match &self.may_be {
            MayBe::Choices { choices } => &choices[..],
            _ => &[],
        };
        choices.iter().map(|choice| choice.unit)
    }

    fn line(&self) -> String {
        let range = match &self.may_be {
            MayBe::Pixels { least, odd, .. } => {
                let odd = if *odd { "an odd number, " } else { "" };
                format!("{odd}{least} px to the longer side of the frame")
            }
            MayBe::Number { unit, least, most } => format!("{least} to {most} {unit}"),
            MayBe::Positive { unit, above, most } => {
                format!("more than {above}, up to {most} {unit}")
            }
            MayBe::Choices { choices } => {
                let words: Vec<&str> = choices.iter().map(|choice| choice.word).collect();
                words.join(", ")
            }
        };
        let default = match &self.default {
            serde_json::Value::String(word) => word.clone(),
            number => number.to_string(),
        };
        format!("    {} = {default} ({range}): {}", self.name, self.about)
    }
}

impl Choice {
    fn of(example: &Measure, name: &str, word: &'static str) -> Self {
        let with = || {
            let mut measures = serde_json::to_value(example).ok()?;
            measures[name] = word.into();
            serde_json::from_value::<Measure>(measures).ok()
        };
        let unit = with().map_or(Unit::None, |with| with.facts().unit);
        let unit = unit.symbol();
        Self { word, unit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_listed_with_words_for_its_parameters_alone_and_its_defaults_are_allowed() {
        let all = Kinds::all();
        assert_eq!(all.kinds.len(), Measure::examples().len());
        for (kind, example) in all.kinds.iter().zip(Measure::examples()) {
            let measures = serde_json::to_value(&example).unwrap();
            assert_eq!(measures["kind"], kind.kind);
            assert!(kind.about.ends_with('.'), "{}", kind.about);
            for field in kind.words.split('{').skip(1) {
                let (field, _) = field.split_once('}').unwrap();
                assert!(measures.get(field).is_some(), "{kind:?}");
            }
            for parameter in &kind.parameters {
                assert_eq!(measures[parameter.name], parameter.default, "{kind:?}");
            }
            for parameter in example.kind().parameters() {
                assert_eq!(parameter.check(1456), Ok(()));
            }
            assert!(all.units.iter().any(|of| of.unit == kind.unit), "{kind:?}");
            assert!(all.table().contains(&format!("{} (", kind.kind)));
        }
    }

    #[test]
    fn the_unit_of_a_placement_follows_from_its_component() {
        let all = Kinds::all();
        let placement = all.kinds.iter().find(|of| of.kind == "placement").unwrap();
        let units: Vec<&str> = placement.parameters[0].units().collect();
        assert_eq!(units, ["mm", "mm", "mm", "°", "°", "°"]);
        assert!(all.table().contains("placement (whole part; ° or mm)"));
    }
}
