//! The keys of a gauge, as `recipe.json`, `gauges.toml` and the API have them.
//!
//! Numbers are parsed once the gauge's name is known, so that a refusal can name the gauge and the
//! key; the parser's message would only give the line and column.

use super::gauge::{About, Master, Tolerance, no_limit};
use super::refusal::refused;
use crate::recipe::{GaugeFile, Refusal};
use algo::inspect::Measure;
use hal::bounds::{clipped, shortened};
use serde::de::{DeserializeOwned, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;
use serde_json::{Map, Value, json};
use std::fmt::{Display, Formatter};

/// Limits that were worked out may differ from what they come from by this share: other programs
/// write fewer digits.
const SAME: f64 = 1e-9;

/// The keys of an object in their order, each with the text of its value.
#[derive(Default)]
pub(crate) struct Keys(pub Vec<(String, Box<RawValue>)>);

impl<'de> Deserialize<'de> for Keys {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct All;
        impl<'de> Visitor<'de> for All {
            type Value = Keys;

            fn expecting(&self, out: &mut Formatter<'_>) -> std::fmt::Result {
                out.write_str("an object with the keys of a gauge")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Keys, A::Error> {
                let mut all: Vec<(String, Box<RawValue>)> = Vec::new();
                while let Some((key, value)) = map.next_entry::<String, _>()? {
                    if all.iter().any(|(other, _)| *other == key) {
                        let words = format!("key {:?} stands twice in a gauge", clipped(&key));
                        return Err(A::Error::custom(words));
                    }
                    all.push((key, value));
                }
                Ok(Keys(all))
            }
        }
        from.deserialize_map(All)
    }
}

/// An error of the JSON parser without its place in a text that nobody sees.
pub(crate) fn placeless(error: impl Display) -> String {
    let words = error.to_string();
    let end = words.find(" at line ").unwrap_or(words.len());
    shortened(&words[..end])
}

impl Keys {
    fn take(&mut self, key: &str) -> Option<Box<RawValue>> {
        let at = self.0.iter().position(|(other, _)| other == key)?;
        Some(self.0.remove(at).1)
    }

    /// The value of a key, `what` it is; none if it is missing or null.
    fn read<T: DeserializeOwned>(&mut self, key: &str, what: &str) -> Result<Option<T>, Refusal> {
        let Some(text) = self.take(key) else {
            return Ok(None);
        };
        serde_json::from_str(text.get())
            .map_err(|_| format!("{key} is {}: write {what}", clipped(text.get())).into())
    }

    fn number(&mut self, key: &str) -> Result<Option<f64>, Refusal> {
        self.read(key, "a number")
    }

    /// What limits come from.
    fn tolerance(&mut self) -> Result<Option<Tolerance>, Refusal> {
        // A place is a parameter of the kind.
        let is_place = |(key, value): &(String, Box<RawValue>)| {
            key == "nominal" && value.get().starts_with('[')
        };
        let nominal = match self.0.iter().any(is_place) {
            true => None,
            false => self.number("nominal")?,
        };
        let golden = self
            .read("golden", "true or leave it out")?
            .unwrap_or(false);
        let (plus, minus) = (self.number("plus")?, self.number("minus")?);
        let about = match (nominal, golden) {
            (Some(_), true) => {
                return Err("it has nominal and golden = true: leave one of them out".into());
            }
            (Some(nominal), false) => About::Nominal(nominal),
            (None, true) => About::Golden,
            (None, false) => {
                let stray = plus.map(|_| "plus").or(minus.map(|_| "minus"));
                return stray.map_or(Ok(None), |key| {
                    refused!("it has {key} without nominal or golden = true: add one of them")
                });
            }
        };
        if plus.is_none() && minus.is_none() {
            return Err("it has neither plus nor minus about its middle: add them".into());
        }
        Ok(Some(Tolerance { about, plus, minus }))
    }

    fn master(&mut self) -> Result<Option<Master>, Refusal> {
        let (value, u) = (self.number("master")?, self.number("master_u")?);
        match (value, u) {
            (None, Some(_)) => Err("it has master_u without master: add it".into()),
            (value, u) => Ok(value.map(|value| Master {
                value,
                u: u.unwrap_or(0.0),
            })),
        }
    }

    /// The kind with its parameters: all keys that are left.
    fn measures(self) -> Result<Measure, Refusal> {
        let Self(keys) = self;
        if !keys.iter().any(|(key, _)| key == "kind") {
            return Err("it has no kind: add one".into());
        }
        let values = keys.iter();
        let values = values.map(|(key, value)| format!("{}:{value}", json!(key)));
        let text = format!("{{{}}}", values.collect::<Vec<_>>().join(","));
        let measures = serde_json::from_str(&text).map_err(placeless)?;
        let known = parameters(&measures);
        let unknown = |key: &&(String, _)| key.0 != "kind" && !known.contains_key(&key.0);
        match keys.iter().find(unknown) {
            Some((key, _)) => refused!("it has an unknown key {:?}", clipped(key)),
            None => Ok(measures),
        }
    }
}

/// The parameters of a kind by their names.
fn parameters(measure: &Measure) -> Map<String, Value> {
    let Ok(Value::Object(mut all)) = serde_json::to_value(measure) else {
        return Map::new();
    };
    all.remove("kind");
    all
}

impl<'de> Deserialize<'de> for GaugeFile {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Self::read(Keys::deserialize(from)?).map_err(D::Error::custom)
    }
}

impl GaugeFile {
    /// The gauge that has these keys.
    fn read(mut keys: Keys) -> Result<Self, Refusal> {
        let name = keys.read("name", "the gauge's name in quotes")?;
        let name: String = name.ok_or("a gauge has no name: add one")?;
        let named = |error: Refusal| format!("gauge {:?}: {error}", clipped(&name));
        let limits = ["low", "high"].map(|which| (which, keys.take(which)));
        let mut gauge = Self::without_limits(keys, &name).map_err(named)?;
        for (which, limit) in limits {
            let Some(text) = limit else { continue };
            let limit = serde_json::from_str(text.get()).map_err(|_| {
                let unit = gauge.measures.facts().unit;
                no_limit(&clipped(&name), unit, which, clipped(text.get())) + " as a number"
            })?;
            match which {
                "low" => gauge.low = limit,
                _ => gauge.high = limit,
            }
        }
        if gauge.low.is_none() && gauge.high.is_none() {
            gauge.set_limits();
        }
        gauge.check_sources().map_err(named)?;
        Ok(gauge)
    }

    fn without_limits(mut keys: Keys, name: &str) -> Result<Self, Refusal> {
        let slot = keys.read("slot", "a whole number from 1 to 64")?;
        let slot = slot.ok_or("it has no slot: write 1 to 64")?;
        let of: Vec<String> = keys
            .read("of", "a list of names of features")?
            .unwrap_or_default();
        let mut gauge = Self {
            slot,
            name: name.to_owned(),
            of,
            datum: keys.read("datum", "the name of a datum system")?,
            low: None,
            high: None,
            tolerance: keys.tolerance()?,
            master: keys.master()?,
            golden_value: keys.number("golden_value")?,
            measures: keys.measures()?,
        };
        if !gauge.needs_golden() {
            gauge.golden_value = None;
        }
        Ok(gauge)
    }

    /// Refuses limits that are not what they are said to come from.
    fn check_sources(&self) -> Result<(), Refusal> {
        let Some(tolerance) = self.tolerance else {
            return Ok(());
        };
        let source = match tolerance.about {
            About::Nominal(_) => "nominal",
            About::Golden => "golden = true",
        };
        let expected = self.middle().map(|middle| tolerance.limits(middle));
        let expected = expected.unwrap_or_default();
        // Files of versions before have limits that nothing can miss.
        let real = |low: &f64| self.can_miss(*low);
        for (which, limit, expected) in [
            ("low", self.low.filter(real), expected[0].filter(real)),
            ("high", self.high, expected[1]),
        ] {
            let same = match (limit, expected) {
                (Some(limit), Some(expected)) => {
                    (limit - expected).abs() <= SAME * limit.abs().max(1.0)
                }
                (limit, expected) => limit.is_none() && expected.is_none(),
            };
            if !same {
                return refused!(
                    "{which} is not what {source} with plus and minus gives: leave {which} or {source} out"
                );
            }
        }
        Ok(())
    }

    /// Its keys with their values, in the order in which they are written.
    pub(crate) fn keys(&self) -> Vec<(String, Value)> {
        let mut keys = vec![
            ("slot".to_owned(), json!(self.slot)),
            ("name".to_owned(), json!(self.name)),
            ("kind".to_owned(), json!(self.measures.name())),
        ];
        keys.extend(parameters(&self.measures));
        let (nominal, golden) = match self.tolerance.map(|tolerance| tolerance.about) {
            None => (None, None),
            Some(About::Nominal(nominal)) => (Some(nominal), None),
            Some(About::Golden) => (None, Some(true)),
        };
        let some = |number: Option<f64>| number.map(|number| json!(number));
        let optional = [
            ("of", (!self.of.is_empty()).then(|| json!(self.of))),
            ("datum", self.datum.as_ref().map(|name| json!(name))),
            ("low", some(self.low)),
            ("high", some(self.high)),
            ("nominal", some(nominal)),
            ("golden", golden.map(|golden| json!(golden))),
            ("plus", some(self.tolerance.and_then(|of| of.plus))),
            ("minus", some(self.tolerance.and_then(|of| of.minus))),
            ("master", some(self.master.map(|master| master.value))),
            ("master_u", some(self.master.map(|master| master.u))),
            ("golden_value", some(self.golden_value)),
        ];
        let optional = optional.into_iter();
        keys.extend(optional.filter_map(|(key, value)| Some((key.to_owned(), value?))));
        keys
    }
}

impl Serialize for GaugeFile {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.keys())
    }
}
