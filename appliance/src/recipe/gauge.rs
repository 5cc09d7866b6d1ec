//! The gauges of a recipe: from the file form to what is computed, their units, and which limits are refused.

use super::file::{AxisFile, ComponentFile, GaugeFile, GaugeKind, RegionFile};
use crate::station::Unit;
use algo::inspect::{Axis, Gauge, Measure, Region};
use hal::bounds::clipped;
use serde::Deserialize;
use serde_json::value::RawValue;
use std::collections::HashMap;
use std::fmt::Display;

/// A gauge as it is written. Its limits are parsed once its name and unit are known, so that a refusal can name the gauge and
/// its bounds; the parser's message would only give the line and column.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GaugeText {
    name: String,
    #[serde(default)]
    region: String,
    measures: GaugeKind,
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
                    measures.unit(),
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

impl GaugeKind {
    /// The unit of its value and limits.
    pub fn unit(&self) -> Unit {
        match self {
            Self::Deviation { .. }
            | Self::RmsDeviation { .. }
            | Self::MeanHeight
            | Self::Step { .. }
            | Self::Flatness { .. }
            | Self::PeakToValley { .. } => Unit::Length,
            Self::Coverage | Self::OutOfTolerance { .. } => Unit::Share,
            Self::Tilt { .. } => Unit::Angle,
            Self::Volume { .. } => Unit::Volume,
            Self::Placement { component } => match component {
                ComponentFile::X | ComponentFile::Y | ComponentFile::Z => Unit::Length,
                ComponentFile::AboutX | ComponentFile::AboutY | ComponentFile::AboutZ => {
                    Unit::Angle
                }
            },
        }
    }

    /// The measure that is computed.
    pub fn measure(&self) -> Measure {
        match *self {
            Self::Deviation { smoothing_px } => Measure::Deviation { side: smoothing_px },
            Self::RmsDeviation { smoothing_px } => Measure::RmsDeviation { side: smoothing_px },
            Self::OutOfTolerance {
                smoothing_px,
                tolerance_mm,
            } => Measure::OutOfTolerance {
                side: smoothing_px,
                tolerance: tolerance_mm,
            },
            Self::Coverage => Measure::Coverage,
            Self::MeanHeight => Measure::MeanHeight,
            Self::Step { .. } => Measure::Step,
            Self::Flatness { smoothing_px } => Measure::Flatness { side: smoothing_px },
            Self::PeakToValley { smoothing_px } => Measure::PeakToValley { side: smoothing_px },
            Self::Tilt { about } => Measure::Tilt(match about {
                AxisFile::X => Axis::X,
                AxisFile::Y => Axis::Y,
            }),
            Self::Volume { above_mm } => Measure::Volume { above: above_mm },
            Self::Placement { component } => Measure::Placement(component as usize),
        }
    }

    /// Side of the square that is averaged over, pixels.
    pub fn smoothing_px(&self) -> Option<usize> {
        match *self {
            Self::Deviation { smoothing_px }
            | Self::RmsDeviation { smoothing_px }
            | Self::OutOfTolerance { smoothing_px, .. }
            | Self::Flatness { smoothing_px }
            | Self::PeakToValley { smoothing_px } => Some(smoothing_px),
            Self::Coverage | Self::MeanHeight | Self::Step { .. } | Self::Tilt { .. } => None,
            Self::Volume { .. } | Self::Placement { .. } => None,
        }
    }

    /// What is wrong with it, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        let [_, most] = Unit::Length.range();
        match self {
            Self::OutOfTolerance { tolerance_mm, .. }
                if !(*tolerance_mm > 0.0 && *tolerance_mm <= most) =>
            {
                Err(format!(
                    "has a tolerance_mm of {tolerance_mm:?}: write more than 0, up to {most} mm"
                ))
            }
            Self::Volume { above_mm } if !(-most..=most).contains(above_mm) => Err(format!(
                "measures a volume with above_mm = {above_mm:?}: write {} to {most} mm",
                -most
            )),
            _ => Ok(()),
        }
    }

    /// Whether no part can have a value below 0.
    fn is_never_negative(&self) -> bool {
        matches!(
            self,
            Self::RmsDeviation { .. } | Self::Flatness { .. } | Self::PeakToValley { .. }
        )
    }
}

impl GaugeFile {
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
        let unit = measures.unit();
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
            (_, Some(high)) if *high < 0.0 && measures.is_never_negative() => Err(format!(
                "gauge {name:?} passes no part: its value is never below 0, its limit high = {high}{symbol} is"
            )),
            _ => Ok(()),
        }
    }

    /// Whether a part can miss one of its limits: those at the ends of what its unit can have are kept by every part.
    pub(super) fn can_fail(&self) -> bool {
        let [least, most] = self.measures.unit().range();
        let least = match self.measures.is_never_negative() {
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
        let placement = matches!(gauge.measures, GaugeKind::Placement { .. });
        Ok(Gauge {
            region: match placement && gauge.region.is_empty() {
                true => Region::default(),
                false => find(&gauge.region)?,
            },
            from: match &gauge.measures {
                GaugeKind::Step { from } => Some(find(from)?),
                _ => None,
            },
            measure: gauge.measures.measure(),
        })
    };
    gauges.iter().map(gauge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gauge(measures: &GaugeKind, low: Option<f64>, high: Option<f64>) -> GaugeFile {
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
        let tilt = GaugeKind::Tilt { about: AxisFile::X };
        let component = ComponentFile::AboutZ;
        let kinds = [
            (GaugeKind::Deviation { smoothing_px }, 214_748.364_7),
            (GaugeKind::MeanHeight, 214_748.364_7),
            (GaugeKind::Volume { above_mm: 0.0 }, 21_474_836.47),
            (tilt, 180.0),
            (GaugeKind::Placement { component }, 180.0),
            (GaugeKind::Coverage, 1.0),
        ];
        for (kind, most) in kinds {
            let least = if kind.unit() == Unit::Share {
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
            GaugeKind::RmsDeviation { smoothing_px },
            GaugeKind::Flatness { smoothing_px },
            GaugeKind::PeakToValley { smoothing_px },
        ] {
            assert!(gauge(&kind, None, Some(-0.1)).check_limits().is_err());
            let both = gauge(&kind, Some(-0.1), Some(0.1));
            assert_eq!(both.check_limits(), Ok(()));
        }
    }

    #[test]
    fn a_limit_that_every_part_keeps_cannot_fail() {
        let coverage = GaugeKind::Coverage;
        let flatness = GaugeKind::Flatness { smoothing_px: 9 };
        let can_fail = |kind, low, high| gauge(kind, low, high).can_fail();
        for kind in [&coverage, &flatness, &GaugeKind::MeanHeight] {
            assert!(!can_fail(kind, None, None));
            assert!(can_fail(kind, Some(0.5), None) && can_fail(kind, None, Some(0.5)));
        }
        assert!(!can_fail(&coverage, Some(0.0), Some(1.0)));
        assert!(!can_fail(&flatness, Some(-0.1), None));
        assert!(can_fail(&GaugeKind::MeanHeight, Some(-0.1), None));
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
        let tolerance = |tolerance_mm| GaugeKind::OutOfTolerance {
            smoothing_px: 9,
            tolerance_mm,
        };
        for mm in [0.0, -0.1, f64::NAN, f64::INFINITY, 214_748.365] {
            assert!(tolerance(mm).check().is_err(), "{mm}");
        }
        assert_eq!(tolerance(0.1).check(), Ok(()));
        for above_mm in [f64::NAN, f64::NEG_INFINITY, 214_748.365, -214_748.365] {
            assert!(
                GaugeKind::Volume { above_mm }.check().is_err(),
                "{above_mm}"
            );
        }
        assert_eq!(GaugeKind::Volume { above_mm: -8.0 }.check(), Ok(()));
    }
}
