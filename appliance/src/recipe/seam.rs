//! What the computation knows of features, in the words of recipes.

use algo::inspect::kinds::Step;
use algo::inspect::{Basis, Measure};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Kinds of features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureKind {
    /// The cells of a region.
    Surface,
    /// The least-squares plane of these cells.
    Plane,
}

impl FeatureKind {
    /// Its name in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Plane => "plane",
        }
    }
}

/// The kinds of features that a gauge may be of, place by place.
pub fn takes(measure: &Measure) -> &'static [&'static [FeatureKind]] {
    const SURFACE: &[FeatureKind] = &[FeatureKind::Surface];
    match (measure, measure.facts().basis) {
        (_, Basis::Motion(_)) => &[],
        (Measure::Step(_), _) => &[SURFACE, SURFACE],
        _ => &[SURFACE],
    }
}

/// The parameters of a kind by their names; `kind` is its name.
pub fn parameters(measure: &Measure) -> (String, Map<String, Value>) {
    let Ok(Value::Object(mut all)) = serde_json::to_value(measure) else {
        return Default::default();
    };
    let kind = all.remove("kind");
    all.remove("from");
    let name = kind.as_ref().and_then(Value::as_str);
    (name.unwrap_or_default().to_owned(), all)
}

/// The second feature of a step is also in its kind.
pub fn with_second(measure: Measure, of: &[String]) -> Measure {
    match (measure, of.get(1)) {
        (Measure::Step(_), Some(from)) => Step { from: from.clone() }.into(),
        (measure, _) => measure,
    }
}
