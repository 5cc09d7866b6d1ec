//! `gauges.toml`: features, datum systems and gauges of a recipe as text that people edit.
//!
//! What is worked out is left out: limits that come from a nominal value or from golden, and what
//! golden has. So the text that is written for a recipe is read as what it was written for.

use super::gauge_keys::{Keys, placeless};
use super::refusal::refused;
use crate::recipe::{DatumFile, FeatureFile, GaugeFile, RecipeFile, Refusal};
use hal::bounds::{clipped, shortened};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt::Write as _;
use toml::Table;

/// The largest text that is read, bytes: 96 features of 256 corners take half of it.
pub const MAX_TEXT: u64 = 1 << 20;
/// What is worked out, and so cannot be written.
const WORKED_OUT: &str = "golden_value";

/// Features, datum systems and gauges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gauging {
    /// All features.
    pub features: Vec<FeatureFile>,
    /// All datum systems.
    pub datums: Vec<DatumFile>,
    /// All gauges.
    pub gauges: Vec<GaugeFile>,
}

/// As the file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GaugingText {
    #[serde(default)]
    feature: Vec<FeatureFile>,
    #[serde(default)]
    datum: Vec<DatumFile>,
    #[serde(default)]
    gauge: Vec<Table>,
}

impl Gauging {
    /// What a recipe has.
    pub fn of(recipe: &RecipeFile) -> Self {
        Self {
            features: recipe.features.clone(),
            datums: recipe.datums.clone(),
            gauges: recipe.gauges.clone(),
        }
    }

    /// Reads the text.
    ///
    /// # Errors
    /// In words: it is no TOML, too long, or a key is unknown, missing, or not of its kind.
    pub fn from_toml(text: &str) -> Result<Self, Refusal> {
        if text.len() as u64 > MAX_TEXT {
            return refused!("it has {} bytes: write at most {MAX_TEXT}", text.len());
        }
        let wrong = |error: toml::de::Error| shortened(error.to_string().trim_end());
        let text: GaugingText = toml::from_str(text).map_err(wrong)?;
        let gauges: Result<_, _> = text.gauge.into_iter().map(gauge).collect();
        Ok(Self {
            features: text.feature,
            datums: text.datum,
            gauges: gauges?,
        })
    }

    /// Writes the text.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        for feature in &self.features {
            write(&mut text, "feature", feature, &[]);
        }
        for datum in &self.datums {
            write(&mut text, "datum", datum, &[]);
        }
        for gauge in &self.gauges {
            let worked_out: &[_] = match gauge.tolerance {
                Some(_) => &[WORKED_OUT, "low", "high"],
                None => &[WORKED_OUT],
            };
            write(&mut text, "gauge", gauge, worked_out);
        }
        text
    }
}

/// A gauge from its table.
fn gauge(table: Table) -> Result<GaugeFile, Refusal> {
    let name = table.get("name").and_then(toml::Value::as_str);
    let name = format!("gauge {:?}", clipped(name.unwrap_or_default()));
    let nominal = table.get("nominal");
    let golden = table.get("golden") == Some(&toml::Value::Boolean(true));
    for (source, there) in [
        (
            "nominal",
            nominal.is_some_and(|nominal| !nominal.is_array()),
        ),
        ("golden = true", golden),
    ] {
        let limits = ["low", "high"].into_iter();
        let limit = limits
            .filter(|_| there)
            .find(|key| table.contains_key(*key));
        if let Some(limit) = limit {
            return refused!(
                "{name}: it has {limit} and {source}, which gives the limits: leave one of them out"
            );
        }
    }
    if table.contains_key(WORKED_OUT) {
        return refused!("{name}: it has an unknown key {WORKED_OUT:?}");
    }
    for (key, value) in &table {
        if let Some(number) = value.as_float().filter(|number| !number.is_finite()) {
            let key = clipped(key);
            return refused!("{name}: {key} is {number}: write a finite number");
        }
    }
    // Numbers inside of lists that are not finite become null, which no key takes.
    let json = serde_json::to_string(&table).map_err(placeless)?;
    Ok(serde_json::from_str(&json).map_err(placeless)?)
}

/// Writes an element of a list with its keys in their order, but for those that are left out.
fn write(text: &mut String, list: &str, element: &impl Serialize, left_out: &[&str]) {
    let _ = writeln!(
        text,
        "{}[[{list}]]",
        if text.is_empty() { "" } else { "\n" }
    );
    let json = serde_json::to_string(element).unwrap_or_default();
    let Keys(keys) = serde_json::from_str(&json).unwrap_or_default();
    for (key, value) in keys.iter().filter(|(key, _)| !left_out.contains(&&**key)) {
        let value = serde_json::from_str(value.get()).unwrap_or_default();
        let _ = writeln!(text, "{key} = {}", written(&value));
    }
}

/// A value as TOML has it: strings are written as in JSON, numbers as the shortest that are read as
/// the same.
fn written(value: &Value) -> String {
    match value {
        Value::Array(list) => {
            let list: Vec<_> = list.iter().map(written).collect();
            format!("[{}]", list.join(", "))
        }
        Value::Number(number) if number.is_f64() => {
            format!("{:?}", number.as_f64().unwrap_or_default())
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"[[feature]]
name = "left \"a\""
kind = "surface"
region = [[0.0, 0.0], [96.5, 1e-7], [3.25, 8.0]]

[[feature]]
name = "right"
kind = "plane"
region = [[0.0, 0.0], [9.5, 0.0], [3.0, 8.0]]

[[datum]]
name = "A"
of = ["right"]

[[gauge]]
slot = 3
name = "bent"
kind = "flatness"
smoothing_px = 9
of = ["left \"a\""]
high = 0.1

[[gauge]]
slot = 64
name = "height"
kind = "mean_height"
of = ["left \"a\""]
nominal = 1.5
plus = 0.25
minus = 0.125
master = 1.501
master_u = 0.002
"#;

    #[test]
    fn the_text_that_is_written_is_the_text_that_was_read() {
        let read = Gauging::from_toml(TEXT).unwrap();
        assert_eq!(read.to_toml(), TEXT);
        let limits = (read.gauges[1].low, read.gauges[1].high);
        assert_eq!(limits, (Some(1.375), Some(1.75)));
        let shuffled = TEXT.replace("high = 0.1", "high = 1.0e-1 # a tenth");
        assert_eq!(Gauging::from_toml(&shuffled).unwrap(), read);
    }

    #[test]
    fn keys_that_contradict_each_other_are_refused_by_their_names() {
        let refused = |from: &str, to: &str| {
            assert!(TEXT.contains(from), "{from}");
            Gauging::from_toml(&TEXT.replace(from, to)).expect_err(to)
        };
        for (from, to, words) in [
            (
                "nominal = 1.5",
                "nominal = 1.5\nlow = 1.0",
                "low and nominal",
            ),
            (
                "nominal = 1.5",
                "golden = true\nhigh = 1.0",
                "high and golden",
            ),
            (
                "nominal = 1.5",
                "nominal = 1.5\ngolden = true",
                "nominal and golden",
            ),
            ("nominal = 1.5\n", "", "plus without"),
            ("plus = 0.25\nminus = 0.125\n", "", "neither plus nor minus"),
            ("master = 1.501\n", "", "master_u without master"),
            ("nominal = 1.5", "nominal = nan", "nominal is NaN"),
            ("high = 0.1", "high = inf", "high is inf"),
            ("high = 0.1", "high = \"0.1\"", "high"),
            ("high = 0.1", "upper = 0.1", "upper"),
            ("smoothing_px = 9\n", "", "smoothing_px"),
            (
                "smoothing_px = 9",
                "smoothing_px = 9\nabove_mm = 1.0",
                "above_mm",
            ),
            ("kind = \"flatness\"", "kind = \"flat\"", "flat"),
            ("kind = \"flatness\"\n", "", "no kind"),
            ("kind = \"plane\"", "kind = \"cone\"", "cone"),
            (
                "kind = \"plane\"",
                "kind = \"plane\"\ndepth_mm = 1.0",
                "depth_mm",
            ),
            ("slot = 3\n", "", "no slot"),
            ("slot = 3", "slot = -3", "slot is -3"),
            ("slot = 3", "slot = 3.5", "slot is 3.5"),
            ("slot = 3", "slot = 3\ngolden_value = 1.0", "golden_value"),
            ("name = \"bent\"\n", "", "no name"),
            ("[[datum]]", "[[system]]", "system"),
        ] {
            let said = refused(from, to);
            assert!(said.words.contains(words), "{to}: {said}");
        }
        let deep = format!("x = {}{}", "[".repeat(100_000), "]".repeat(100_000));
        Gauging::from_toml(&deep).unwrap_err();
        let deep = TEXT.replace(
            "high = 0.1",
            &format!("high = {}1{}", "[".repeat(70), "]".repeat(70)),
        );
        Gauging::from_toml(&deep).unwrap_err();
        Gauging::from_toml(&"[[feature]]\n".repeat(100_000)).unwrap_err();
    }
}
