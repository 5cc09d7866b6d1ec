//! The gauges of a recipe in its file: what their limits come from, and which are refused.

use super::refusal::refused;
use crate::recipe::Refusal;
use crate::station::Unit;
use algo::inspect::{Basis, Measure, Reading};
use hal::bounds::within;
use std::fmt::Display;

/// What limits are worked out from: they lie `minus` below and `plus` above a middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// The middle.
    pub about: About,
    /// How far above it the upper limit lies; none: there is no upper limit.
    pub plus: Option<f64>,
    /// How far below it the lower limit lies; none: there is no lower limit.
    pub minus: Option<f64>,
}

/// The middle of a tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum About {
    /// A value from the drawing.
    Nominal(f64),
    /// What the gauge reads of the part that was taught.
    Golden,
}

/// What another instrument has measured of the part that was taught (substitution, ISO
/// 15530-3:2011).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Master {
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty.
    pub u: f64,
}

/// What a master makes of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substitution {
    /// The master's value less golden's own, which is added to each value.
    shift: f64,
    /// The master's standard uncertainty.
    u: f64,
}

impl Substitution {
    /// By a master, in place of golden's own value.
    pub(crate) fn new(master: Master, golden: f64) -> Self {
        Self {
            shift: master.value - golden,
            u: master.u,
        }
    }

    /// Value and systematic error of a reading. What the measurements of golden and of the part
    /// share is in the difference no more; golden's noise and the error over the displacement are.
    pub fn of(self, reading: &Reading) -> (f64, f64) {
        (reading.value + self.shift, reading.compared.hypot(self.u))
    }
}

impl Tolerance {
    /// The limits about this middle.
    pub fn limits(&self, middle: f64) -> [Option<f64>; 2] {
        [
            self.minus.map(|minus| middle - minus),
            self.plus.map(|plus| middle + plus),
        ]
    }
}

/// A gauge and its limits. Its keys in files are those of `gauge_keys`.
#[derive(Clone, Debug, PartialEq)]
pub struct GaugeFile {
    /// Its place in registers, 1 to 64.
    pub slot: u16,
    /// Its name.
    pub name: String,
    /// What it measures; `docs/formats.md` has the definitions.
    pub measures: Measure,
    /// The names of its features in the order in which its kind takes them.
    pub of: Vec<String>,
    /// The datum system in which it is measured.
    pub datum: Option<String>,
    /// Lower limit, inclusive, in mm, degrees, mm³ or as a share from 0 to 1.
    pub low: Option<f64>,
    /// Upper limit, inclusive.
    pub high: Option<f64>,
    /// What the limits are worked out from, if they are.
    pub tolerance: Option<Tolerance>,
    /// What another instrument has measured of the part that was taught.
    pub master: Option<Master>,
    /// What is measured of golden, where limits or master need it.
    pub golden_value: Option<f64>,
}

impl GaugeFile {
    /// Whether it is the largest deviation from golden.
    pub(crate) fn is_deviation(&self) -> bool {
        matches!(self.measures.facts().basis, Basis::Squares(_))
    }

    /// A gauge of features without limits.
    pub fn new(slot: u16, name: &str, measures: impl Into<Measure>, of: &[&str]) -> Self {
        Self {
            slot,
            name: name.into(),
            measures: measures.into(),
            of: of.iter().map(|&name| name.into()).collect(),
            datum: None,
            low: None,
            high: None,
            tolerance: None,
            master: None,
            golden_value: None,
        }
    }
}

/// Refuses a limit that the unit of its gauge cannot have.
pub(crate) fn no_limit(gauge: &str, unit: Unit, which: &str, limit: impl Display) -> String {
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
    /// Refuses limits that no part can keep or miss.
    ///
    /// # Errors
    /// In words, with the gauge's name and the remedy.
    pub(crate) fn check_judging(&self) -> Result<(), Refusal> {
        let refused = self.check_limits();
        Ok(refused.map_err(|error| format!("{error}: change the limits"))?)
    }

    /// Refuses limits that no part can keep, and those that its unit cannot have.
    ///
    /// # Errors
    /// In words, with the gauge's name.
    fn check_limits(&self) -> Result<(), Refusal> {
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
        if self.needs_golden() && self.golden_value.is_none() {
            return refused!("gauge {name:?} has no golden_value: set the gauges again");
        }
        for (which, limit) in [("low", low), ("high", high)] {
            if let Some(limit) = limit.filter(|limit| !(least..=most).contains(limit)) {
                return Err(no_limit(name, unit, which, limit).into());
            }
        }
        match (low, high) {
            (Some(low), Some(high)) if low > high => refused!(
                "gauge {name:?} passes no part: its limit low = {low}{symbol} is above high = {high}{symbol}"
            ),
            (_, Some(high)) if *high < 0.0 && measures.facts().never_negative => refused!(
                "gauge {name:?} passes no part: its value is never below 0, its limit high = {high}{symbol} is"
            ),
            _ => Ok(()),
        }
    }

    /// Refuses numbers behind the limits that its unit cannot have, before anything is worked out
    /// from them.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(crate) fn check_numbers(&self) -> Result<(), Refusal> {
        let [_, most] = self.measures.facts().unit.range();
        if let Some(Tolerance { about, plus, minus }) = self.tolerance {
            if let About::Nominal(nominal) = about {
                within("nominal", nominal, -most, most)?;
            }
            for (key, value) in [("plus", plus), ("minus", minus)] {
                value.map_or(Ok(()), |value| within(key, value, -2.0 * most, 2.0 * most))?;
            }
            if let (Some(plus), Some(minus)) = (plus, minus)
                && plus < -minus
            {
                return refused!(
                    "plus is {plus} and minus is {minus}: the lower limit would be above the upper one"
                );
            }
        }
        if let Some(Master { value, u }) = self.master {
            within("master", value, -most, most)?;
            within("master_u", u, 0.0, most)?;
        }
        let mut golden = self.golden_value.into_iter();
        Ok(golden.try_for_each(|value| within("golden_value", value, f64::MIN, f64::MAX))?)
    }

    /// Whether a part can miss one of its limits: limits at the ends of what its unit can have are
    /// kept by every part.
    pub(crate) fn can_fail(&self) -> bool {
        let facts = self.measures.facts();
        let [least, most] = facts.unit.range();
        let least = match facts.never_negative {
            true => 0.0,
            false => least,
        };
        // Limits that are worked out later will be some.
        let later = self.tolerance.is_some() && self.low.is_none() && self.high.is_none();
        later
            || self.low.is_some_and(|low| low > least)
            || self.high.is_some_and(|high| high < most)
    }
}

impl GaugeFile {
    /// Whether golden must be measured for its limits or its master.
    pub fn needs_golden(&self) -> bool {
        let by_golden = |tolerance: &Tolerance| tolerance.about == About::Golden;
        self.master.is_some() || self.tolerance.as_ref().is_some_and(by_golden)
    }

    /// What its master makes of readings; none without a master.
    pub(crate) fn substitution(&self) -> Option<Substitution> {
        let (master, golden) = self.master.zip(self.golden_value)?;
        Some(Substitution::new(master, golden))
    }

    /// The middle of its tolerance, where it has one and that is known.
    pub(crate) fn middle(&self) -> Option<f64> {
        match self.tolerance?.about {
            About::Nominal(nominal) => Some(nominal),
            // What golden reads with a master is the master's value.
            About::Golden => self.master.map(|master| master.value).or(self.golden_value),
        }
    }

    /// Works out its limits, where they come from something that is known.
    pub(crate) fn set_limits(&mut self) {
        if let Some((tolerance, middle)) = self.tolerance.zip(self.middle()) {
            let [low, high] = tolerance.limits(middle);
            [self.low, self.high] = [low.filter(|low| self.can_miss(*low)), high];
        }
    }

    /// Whether a value can lie below a limit: one that is never negative is never below 0.
    pub(crate) fn can_miss(&self, low: f64) -> bool {
        low >= 0.0 || !self.measures.facts().never_negative
    }

    /// Takes over what golden reads; its limits follow.
    pub(crate) fn set_golden(&mut self, golden: Option<&Reading>) {
        if self.needs_golden() {
            self.golden_value = golden.map(|reading| reading.value);
            self.set_limits();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use algo::inspect::kinds::*;
    use algo::inspect::kinds::{Flatness, MeanHeight};

    fn gauge(measures: &Measure, low: Option<f64>, high: Option<f64>) -> GaugeFile {
        GaugeFile {
            low,
            high,
            ..GaugeFile::new(1, "the gauge", measures.clone(), &[])
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
                assert!(words.words.contains("\"the gauge\""), "{words}");
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
        let read = |kind: &str, limit: &str| {
            let text = format!(
                r#"{{"slot": 1, "high": {limit}, "name": "dome", "of": ["all"], "kind": {kind:?}}}"#
            );
            let read = serde_json::from_str::<GaugeFile>(&text);
            read.map(|gauge| gauge.high)
                .map_err(|error| error.to_string())
        };
        for limit in ["1e999", "\"0.3\"", "true", "[]", "{}"] {
            let words = read("mean_height", limit).unwrap_err();
            let wanted = format!(
                "gauge \"dome\" cannot have the limit high = {limit} mm: write -214748.3647 to 214748.3647 mm as a number"
            );
            assert!(words.starts_with(&wanted), "{words}");
            let words = read("coverage", limit).unwrap_err();
            assert!(words.contains("write 0 to 1 as a number"), "{words}");
        }
        for (limit, number) in [("0.3", Some(0.3)), ("-1", Some(-1.0)), ("null", None)] {
            assert_eq!(read("mean_height", limit), Ok(number));
        }
    }

    #[test]
    fn a_value_that_is_never_negative_gets_no_limit_below_0() {
        let limits = |measures: Measure| {
            let mut gauge = GaugeFile::new(1, "gauge", measures, &["face"]);
            gauge.tolerance = Some(Tolerance {
                about: About::Golden,
                plus: Some(0.1),
                minus: Some(0.1),
            });
            gauge.golden_value = Some(0.02);
            gauge.set_limits();
            [gauge.low, gauge.high].map(|limit| limit.map(|limit| (limit * 100.0).round()))
        };
        let flatness = Flatness { smoothing_px: 9 };
        assert_eq!(limits(flatness.into()), [None, Some(12.0)]);
        assert_eq!(limits(MeanHeight {}.into()), [Some(-8.0), Some(12.0)]);
    }
}
