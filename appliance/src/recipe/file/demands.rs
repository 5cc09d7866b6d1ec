//! What a recipe demands of a part (limits of its gauges, least coverage, where it may lie), and what
//! its gauges and features are called.

use super::gauge::Substitution;
use super::{AlignmentKind, RecipeFile};
use crate::station::Unit;
use algo::inspect::{FeatureKind, Place};
use std::sync::Arc;

/// What a recipe demands of a part.
#[derive(Clone, Debug)]
pub struct Demands {
    /// In the order of the recipe's gauges.
    pub(crate) limits: Vec<GaugeDemands>,
    /// The names of the recipe's features, in their order.
    pub(crate) features: Vec<String>,
    /// Least share of the golden pixels that must be resolved.
    pub(crate) min_coverage: f64,
    /// How far the part may lie from where it was taught, mm.
    pub(crate) tolerance_mm: f64,
    /// Guard bands are this many times u wide.
    pub(crate) guard_k: f64,
    /// Whether no part can fail: the result says so.
    pub(crate) judges_nothing: bool,
    /// Whether the part's motion is found and taken back before it is gauged.
    pub(crate) aligned: bool,
}

/// The limits of a gauge, with the name that every result shares.
#[derive(Clone, Debug)]
pub(crate) struct GaugeDemands {
    pub slot: u16,
    pub name: Arc<str>,
    /// The names of its features.
    pub of: Vec<String>,
    pub unit: Unit,
    pub low: Option<f64>,
    pub high: Option<f64>,
    /// What a master makes of each value.
    pub master: Option<Substitution>,
}

impl Demands {
    /// Slot, name and unit of each gauge.
    pub fn slots(&self) -> impl Iterator<Item = (u16, &str, Unit)> {
        let limits = self.limits.iter();
        limits.map(|limits| (limits.slot, &*limits.name, limits.unit))
    }
}

impl From<&RecipeFile> for Demands {
    fn from(file: &RecipeFile) -> Self {
        let limits = file.gauges.iter().map(|gauge| GaugeDemands {
            slot: gauge.slot,
            name: Arc::from(&*gauge.name),
            of: gauge.of.clone(),
            unit: gauge.measures.facts().unit,
            low: gauge.low,
            high: gauge.high,
            master: gauge.substitution(),
        });
        Self {
            limits: limits.collect(),
            features: file
                .features
                .iter()
                .map(|feature| feature.name.clone())
                .collect(),
            min_coverage: file.min_coverage,
            tolerance_mm: file.placement_tolerance_mm,
            guard_k: file.guard_k,
            judges_nothing: file.judges_nothing,
            aligned: file.alignment == AlignmentKind::Rigid,
        }
    }
}

/// The kinds of a recipe's gauges, and its features with the gauges that are of them.
#[derive(Clone, Debug)]
pub struct Labels {
    /// Slot and kind of each gauge.
    pub(crate) gauges: Vec<(u16, &'static str)>,
    pub(crate) features: Vec<LabelledFeature>,
}

/// A feature, with the gauges that are of it.
#[derive(Clone, Debug)]
pub(crate) struct LabelledFeature {
    pub name: String,
    pub kind: FeatureKind,
    /// Slots of the gauges that are of it.
    pub slots: Vec<u16>,
    /// Of a contour, the name of its plane.
    pub plane: Option<String>,
    /// Corners of its region, or the ends of a section, in golden's frame.
    pub places: Vec<Place>,
}

impl From<&RecipeFile> for Labels {
    fn from(file: &RecipeFile) -> Self {
        let gauges = file.gauges.iter();
        let of = |name: &String| {
            let gauges = file.gauges.iter().filter(|gauge| gauge.of.contains(name));
            gauges.map(|gauge| gauge.slot).collect()
        };
        let features = file.features.iter().map(|feature| LabelledFeature {
            name: feature.name.clone(),
            kind: feature.kind,
            slots: of(&feature.name),
            plane: feature.plane.clone(),
            places: match feature.from.zip(feature.to) {
                Some((from, to)) => vec![from, to],
                None => feature.region.clone(),
            },
        });
        Self {
            gauges: gauges
                .map(|gauge| (gauge.slot, gauge.measures.name()))
                .collect(),
            features: features.collect(),
        }
    }
}
