//! The kinds of features, and a feature of a part.

use crate::inspect::region::Region;

/// What is found in the region of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum FeatureKind {
    /// Heights and deviations from golden, without a shape.
    Surface,
    /// The plane that fits best, by least squares.
    Plane,
}

impl FeatureKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Surface, Self::Plane];

    /// Its name, as recipes have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Plane => "plane",
        }
    }
}

/// A feature of a part: what is found where.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// What.
    pub kind: FeatureKind,
    /// Where, in golden's frame.
    pub region: Region,
}
