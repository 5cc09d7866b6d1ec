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
    /// The recipe's features, in their order.
    pub(crate) features: Vec<LabelledFeature>,
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

/// The limits of a gauge, with its kind and the name that every result shares.
#[derive(Clone, Debug)]
pub(crate) struct GaugeDemands {
    pub slot: u16,
    pub name: Arc<str>,
    pub kind: &'static str,
    /// The names of its features.
    pub of: Vec<String>,
    pub unit: Unit,
    pub low: Option<f64>,
    pub high: Option<f64>,
    /// What a master makes of each value.
    pub master: Option<Substitution>,
}

/// What a feature is called, and where golden has it.
#[derive(Clone, Debug)]
pub(crate) struct LabelledFeature {
    pub name: String,
    pub kind: FeatureKind,
    /// Of a contour, the name of its plane.
    pub plane: Option<String>,
    /// Corners of its region, or the ends of a section, in golden's frame.
    pub places: Vec<Place>,
}

impl Demands {
    /// Slot, name and unit of each gauge.
    pub fn slots(&self) -> impl Iterator<Item = (u16, &str, Unit)> {
        let limits = self.limits.iter();
        limits.map(|limits| (limits.slot, &*limits.name, limits.unit))
    }

    /// The kind of the gauge in a slot.
    pub fn kind(&self, slot: u16) -> Option<&'static str> {
        let mut limits = self.limits.iter();
        let found = limits.find(|limits| limits.slot == slot);
        found.map(|limits| limits.kind)
    }
}

impl From<&RecipeFile> for Demands {
    fn from(file: &RecipeFile) -> Self {
        let limits = file.gauges.iter().map(|gauge| GaugeDemands {
            slot: gauge.slot,
            name: Arc::from(&*gauge.name),
            kind: gauge.measures.name(),
            of: gauge.of.clone(),
            unit: gauge.measures.facts().unit,
            low: gauge.low,
            high: gauge.high,
            master: gauge.substitution(),
        });
        let features = file.features.iter().map(|feature| LabelledFeature {
            name: feature.name.clone(),
            kind: feature.kind,
            plane: feature.plane.clone(),
            places: match feature.from.zip(feature.to) {
                Some((from, to)) => vec![from, to],
                None => feature.region.clone(),
            },
        });
        Self {
            limits: limits.collect(),
            features: features.collect(),
            min_coverage: file.min_coverage,
            tolerance_mm: file.placement_tolerance_mm,
            guard_k: file.guard_k,
            judges_nothing: file.judges_nothing,
            aligned: file.alignment == AlignmentKind::Rigid,
        }
    }
}
