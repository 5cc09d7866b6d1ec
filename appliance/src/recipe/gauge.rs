//! What a recipe's gauges measure: as the computation takes it, in which unit, and what cannot be measured.

use super::file::{AxisFile, ComponentFile, GaugeFile, GaugeKind, RegionFile};
use crate::station::Unit;
use algo::inspect::{Axis, Gauge, Measure, Region};
use std::collections::HashMap;

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

    /// As the computation takes it.
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
            _ => None,
        }
    }

    /// What is wrong with it, in words.
    fn check(&self) -> Result<(), String> {
        if self.smoothing_px() == Some(0) {
            return Err("averages over squares of 0 pixels: smoothing_px is 1 for none".into());
        }
        match self {
            Self::OutOfTolerance { tolerance_mm, .. }
                if !(tolerance_mm.is_finite() && *tolerance_mm > 0.0) =>
            {
                Err(format!(
                    "has a tolerance of {tolerance_mm} mm: it must be positive"
                ))
            }
            Self::Volume { above_mm } if !above_mm.is_finite() => {
                Err("measures a volume above no plane: above_mm must be finite".into())
            }
            _ => Ok(()),
        }
    }
}

/// The gauges of a recipe as the computation takes them, for a camera of `size` pixels.
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
        let limits = [gauge.low, gauge.high];
        if limits.iter().flatten().any(|limit| !limit.is_finite()) {
            return Err(format!("gauge {name:?} has a limit that is not finite"));
        }
        gauge
            .measures
            .check()
            .map_err(|wrong| format!("gauge {name:?} {wrong}"))?;
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
