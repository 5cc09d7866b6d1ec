//! The gauges of a recipe: from the file form to what is computed, and which values are refused.

use super::bounds::LONGEST_NAME;
use super::file::{GaugeFile, RegionFile};
use crate::station::Unit;
use algo::inspect::{Basis, Facts, Gauge, Measure, Region};
use hal::bounds::{clipped, text, within};
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fmt::Display;

/// A gauge as it is written. Its limits are parsed once its name and unit are known, so that a
/// refusal can name the gauge and its bounds; the parser's message would only give the line and
/// column.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GaugeText {
    name: String,
    #[serde(default)]
    region: String,
    measures: Measure,
    #[serde(default)]
    low: Option<Box<RawValue>>,
    #[serde(default)]
    high: Option<Box<RawValue>>,
}

impl TryFrom<GaugeText> for GaugeFile {
    type Error = String;

    fn try_from(text: GaugeText) -> Result<Self, String> {
        let GaugeText {
            name,
            region,
            measures,
            low,
            high,
        } = text;
        let read = |which, limit: Option<Box<RawValue>>| {
            let Some(limit) = limit else { return Ok(None) };
            serde_json::from_str(limit.get()).map(Some).map_err(|_| {
                let words = no_limit(
                    &clipped(&name),
                    measures.facts().unit,
                    which,
                    clipped(limit.get()),
                );
                words + " as a number"
            })
        };
        Ok(Self {
            low: read("low", low)?,
            high: read("high", high)?,
            name,
            region,
            measures,
        })
    }
}

/// All kinds, for programs that show or edit recipes: an example of each, or one for each value of
/// the field that its unit depends on.
pub fn kinds() -> Value {
    let row = |measures: Measure| {
        let Facts {
            unit,
            words,
            compares,
            ..
        } = measures.facts();
        let [low, high] = unit.range();
        json!({
            "measures": measures, "words": words, "unit": unit.symbol(), "low": low, "high": high, "compares": compares,
        })
    };
    let all = |example: Measure| {
        let others = example.others();
        std::iter::once(example).chain(others).map(row)
    };
    Measure::examples().into_iter().flat_map(all).collect()
}

/// Refuses a limit that the unit of its gauge cannot have.
fn no_limit(gauge: &str, unit: Unit, which: &str, limit: impl Display) -> String {
    let ([least, most], symbol) = (unit.range(), spaced(unit));
    format!(
        "gauge {gauge:?} cannot have the limit {which} = {limit}{symbol}: write {least} to {most}{symbol}"
    )
}

/// The symbol of a unit behind a number.
fn spaced(unit: Unit) -> String {
    match unit.symbol() {
        "" => String::new(),
        symbol => format!(" {symbol}"),
    }
}

impl GaugeFile {
    /// Checks each value by itself, for frames whose longer side has `largest` pixels.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self, largest: usize) -> Result<(), String> {
        text("name", &self.name, LONGEST_NAME)?;
        text("region", &self.region, LONGEST_NAME)?;
        let kind = self.measures.kind();
        if let Some(from) = kind.from() {
            text("measures.from", from, LONGEST_NAME)?;
        }
        let Facts { basis, .. } = kind.facts();
        if let Some(side) = basis.side() {
            within("measures.smoothing_px", side, 1, largest)?;
            if basis == Basis::Squares(side) && side % 2 == 0 {
                return Err(format!(
                    "measures.smoothing_px is {side}: write an odd number, the square has a middle pixel"
                ));
            }
        }
        kind.check()
    }

    /// Refuses limits that no part can keep, and those that its unit cannot have.
    ///
    /// # Errors
    /// In words, with the gauge's name.
    pub(super) fn check_limits(&self) -> Result<(), String> {
        let Self {
            name,
            measures,
            low,
            high,
            ..
        } = self;
        let unit = measures.facts().unit;
        let [least, most] = unit.range();
        let symbol = spaced(unit);
        for (which, limit) in [("low", low), ("high", high)] {
            if let Some(limit) = limit.filter(|limit| !(least..=most).contains(limit)) {
                return Err(no_limit(name, unit, which, limit));
            }
        }
        match (low, high) {
            (Some(low), Some(high)) if low > high => Err(format!(
                "gauge {name:?} passes no part: its limit low = {low}{symbol} is above high = {high}{symbol}"
            )),
            (_, Some(high)) if *high < 0.0 && measures.facts().never_negative => Err(format!(
                "gauge {name:?} passes no part: its value is never below 0, its limit high = {high}{symbol} is"
            )),
            _ => Ok(()),
        }
    }

    /// Whether a part can miss one of its limits: those at the ends of what its unit can have are
    /// kept by every part.
    pub(super) fn can_fail(&self) -> bool {
        let facts = self.measures.facts();
        let [least, most] = facts.unit.range();
        let least = match facts.never_negative {
            true => 0.0,
            false => least,
        };
        self.low.is_some_and(|low| low > least) || self.high.is_some_and(|high| high < most)
    }
}

/// The gauges that are computed, for frames of (width, height) pixels.
///
/// # Errors
/// Naming the gauge or region that cannot be used, and why.
pub(super) fn gauges(
    regions: &[RegionFile],
    gauges: &[GaugeFile],
    (width, height): (usize, usize),
) -> Result<Vec<Gauge>, String> {
    let mut named = HashMap::new();
    for region in regions {
        let corners: Vec<_> = region.polygon.iter().map(|&[u, v]| (u, v)).collect();
        let pixels = Region::polygon(&corners, width, height)
            .map_err(|error| format!("region {:?}: {error}", region.name))?;
        named.insert(region.name.as_str(), pixels);
    }
    let gauge = |gauge: &GaugeFile| {
        let name = &gauge.name;
        let find = |region: &str| {
            let found = named.get(region).cloned();
            found.ok_or_else(|| {
                format!("gauge {name:?} names a region {region:?} that is not there")
            })
        };
        let placement = matches!(gauge.measures.facts().basis, Basis::Motion(_));
        Ok(Gauge {
            region: match placement && gauge.region.is_empty() {
                true => Region::default(),
                false => find(&gauge.region)?,
            },
            from: gauge.measures.kind().from().map(find).transpose()?,
            measure: gauge.measures.clone(),
        })
    };
    gauges.iter().map(gauge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use algo::inspect::Kind;
    use algo::inspect::kinds::*;

    fn gauge(measures: &Measure, low: Option<f64>, high: Option<f64>) -> GaugeFile {
        GaugeFile {
            name: "the gauge".into(),
            region: String::new(),
            measures: measures.clone(),
            low,
            high,
        }
    }

    #[test]
    fn limits_that_no_part_can_keep_or_no_unit_has_are_refused_by_the_gauges_name() {
        let smoothing_px = 9;
        let component = Component::AboutZ;
        let kinds: [(Measure, f64); 6] = [
            (Deviation { smoothing_px }.into(), 214_748.364_7),
            (MeanHeight {}.into(), 214_748.364_7),
            (Volume { above_mm: 0.0 }.into(), 21_474_836.47),
            (Tilt { about: Axis::X }.into(), 180.0),
            (Placement { component }.into(), 180.0),
            (Coverage {}.into(), 1.0),
        ];
        for (kind, most) in kinds {
            let least = if kind.facts().unit == Unit::Share {
                0.0
            } else {
                -most
            };
            let check = |low, high| gauge(&kind, low, high).check_limits();
            for (low, high) in [
                (None, None),
                (Some(least), Some(most)),
                (Some(0.5), Some(0.5)),
                (Some(-0.0), None),
                (None, Some(f64::MIN_POSITIVE / 2.0)),
            ] {
                assert_eq!(check(low, high), Ok(()), "{kind:?} {low:?} {high:?}");
            }
            for (low, high) in [
                (Some(0.5), Some(0.4)),
                (Some(f64::NAN), None),
                (None, Some(f64::NAN)),
                (Some(f64::NEG_INFINITY), None),
                (None, Some(f64::INFINITY)),
                (Some(least - most.max(1.0) * 1e-9), None),
                (None, Some(most * (1.0 + 1e-9))),
            ] {
                let words = check(low, high).expect_err(&format!("{kind:?} {low:?} {high:?}"));
                assert!(words.contains("\"the gauge\""), "{words}");
            }
        }
        for kind in [
            Measure::from(RmsDeviation { smoothing_px }),
            Flatness { smoothing_px }.into(),
            PeakToValley { smoothing_px }.into(),
        ] {
            assert!(gauge(&kind, None, Some(-0.1)).check_limits().is_err());
            let both = gauge(&kind, Some(-0.1), Some(0.1));
            assert_eq!(both.check_limits(), Ok(()));
        }
    }

    #[test]
    fn every_kind_is_listed_with_its_unit_and_with_words_for_its_fields_alone() {
        let listed = kinds();
        let mut units = HashMap::<&str, Vec<&str>>::new();
        for row in listed.as_array().unwrap() {
            let (measures, words) = (&row["measures"], row["words"].as_str().unwrap());
            for field in words.split('{').skip(1) {
                let (field, _) = field.split_once('}').unwrap();
                assert!(measures.get(field).is_some(), "{row}");
            }
            let of = units.entry(measures["kind"].as_str().unwrap()).or_default();
            of.push(row["unit"].as_str().unwrap());
            assert!(row["low"].as_f64() < row["high"].as_f64(), "{row}");
        }
        assert_eq!(units.len(), Measure::examples().len());
        assert_eq!(units["volume"], ["mm³"]);
        units.get_mut("placement").unwrap().sort_unstable();
        assert_eq!(units["placement"], ["mm", "mm", "mm", "°", "°", "°"]);
    }

    #[test]
    fn a_limit_that_every_part_keeps_cannot_fail() {
        let coverage = Coverage {}.into();
        let flatness = Flatness { smoothing_px: 9 }.into();
        let mean = MeanHeight {}.into();
        let can_fail = |kind, low, high| gauge(kind, low, high).can_fail();
        for kind in [&coverage, &flatness, &mean] {
            assert!(!can_fail(kind, None, None));
            assert!(can_fail(kind, Some(0.5), None) && can_fail(kind, None, Some(0.5)));
        }
        assert!(!can_fail(&coverage, Some(0.0), Some(1.0)));
        assert!(!can_fail(&flatness, Some(-0.1), None));
        assert!(can_fail(&mean, Some(-0.1), None));
    }

    #[test]
    fn a_limit_that_is_no_number_is_refused_by_its_gauge_and_key_with_the_bounds() {
        let read = |measures: &str, limit: &str| {
            let text = format!(
                r#"{{"high": {limit}, "name": "dome", "region": "all", "measures": {measures}}}"#
            );
            let read = serde_json::from_str::<GaugeFile>(&text);
            read.map(|gauge| gauge.high)
                .map_err(|error| error.to_string())
        };
        for limit in ["1e999", "\"0.3\"", "true", "[]", "{}"] {
            let words = read(r#"{"kind": "mean_height"}"#, limit).unwrap_err();
            let wanted = format!(
                "gauge \"dome\" cannot have the limit high = {limit} mm: write -214748.3647 to 214748.3647 mm as a number"
            );
            assert!(words.starts_with(&wanted), "{words}");
            let words = read(r#"{"kind": "coverage"}"#, limit).unwrap_err();
            assert!(words.contains("write 0 to 1 as a number"), "{words}");
        }
        for (limit, number) in [("0.3", Some(0.3)), ("-1", Some(-1.0)), ("null", None)] {
            assert_eq!(read(r#"{"kind": "mean_height"}"#, limit), Ok(number));
        }
    }

    #[test]
    fn a_tolerance_and_a_plane_lie_within_what_a_register_holds() {
        let tolerance = |tolerance_mm| OutOfTolerance {
            smoothing_px: 9,
            tolerance_mm,
        };
        for mm in [0.0, -0.1, f64::NAN, f64::INFINITY, 214_748.365] {
            assert!(tolerance(mm).check().is_err(), "{mm}");
        }
        assert_eq!(tolerance(0.1).check(), Ok(()));
        for above_mm in [f64::NAN, f64::NEG_INFINITY, 214_748.365, -214_748.365] {
            assert!(Volume { above_mm }.check().is_err(), "{above_mm}");
        }
        assert_eq!(Volume { above_mm: -8.0 }.check(), Ok(()));
    }
}
