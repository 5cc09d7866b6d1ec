//! What a recipe demands of a part: limits of its gauges, least coverage, and where it may lie.

use super::file::{AlignmentKind, RecipeFile};
use super::tolerance::Substitution;
use crate::station::Unit;
use std::sync::Arc;

/// What a recipe demands of a part.
#[derive(Clone, Debug)]
pub struct Demands {
    /// In the order of the recipe's gauges.
    pub(super) limits: Vec<GaugeLimits>,
    /// The names of the recipe's features, in their order.
    pub(super) features: Vec<String>,
    /// Least share of the golden pixels that must be resolved.
    pub(super) min_coverage: f64,
    /// How far the part may lie from where it was taught, mm.
    pub(super) tolerance_mm: f64,
    /// Guard bands are this many times u wide.
    pub(super) guard_k: f64,
    /// Whether no part can fail: the result says so.
    pub(super) judges_nothing: bool,
    /// Whether the part's motion is found and taken back before it is gauged.
    pub(super) aligned: bool,
}

/// The limits of a gauge, with the name that every result shares.
#[derive(Clone, Debug)]
pub(super) struct GaugeLimits {
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
        let limits = file.gauges.iter().map(|gauge| GaugeLimits {
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
