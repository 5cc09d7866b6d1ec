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
    /// A straight edge of a face.
    Line,
    /// A round hole in a face.
    Circle,
    /// A slot with round ends in a face.
    Slot,
    /// A cut across a joint of two sheets.
    Section,
}

impl FeatureKind {
    /// All kinds.
    pub const ALL: [Self; 6] = [
        Self::Surface,
        Self::Plane,
        Self::Line,
        Self::Circle,
        Self::Slot,
        Self::Section,
    ];

    /// Whether it is the contour of a face: where the face ends, in its plane.
    pub fn is_contour(self) -> bool {
        matches!(self, Self::Line | Self::Circle | Self::Slot)
    }

    /// Its name, as recipes have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Plane => "plane",
            Self::Line => "line",
            Self::Circle => "circle",
            Self::Slot => "slot",
            Self::Section => "section",
        }
    }
}

/// A feature of a part: what is found where.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// What.
    pub kind: FeatureKind,
    /// Where, in golden's frame. Around a contour it has 1.5 mm or more on both sides.
    pub region: Region,
    /// Of a contour, which of the features is the plane of its face; `None` if the plane is fitted to
    /// its own region.
    pub plane: Option<usize>,
    /// Of a contour, the radius of its rim, mm.
    pub rim: f64,
    /// Of a plane, the thickness of its sheet in mm, for the walls of its contours; `None` where it
    /// is not known, 0 where no wall is seen.
    pub thickness: Option<f64>,
    /// Of a section, where it is.
    pub cut: Option<Cut>,
}

/// Where a section is: along a way across a joint, over a width.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The pixel of golden's frame in which it begins.
    pub from: [f64; 2],
    /// The one in which it ends.
    pub to: [f64; 2],
    /// Its width across that way, mm.
    pub width_mm: f64,
    /// From where to where the left side is flat, mm from its beginning.
    pub left: [f64; 2],
    /// The same of the right side.
    pub right: [f64; 2],
    /// The radius of both edges where it is stated, mm.
    pub edge_mm: Option<f64>,
    /// How far the stated radius may be off, ± mm, where that is known.
    pub edge_tolerance_mm: Option<f64>,
}

impl Feature {
    /// A feature of heights.
    pub fn new(kind: FeatureKind, region: Region) -> Self {
        Self {
            kind,
            region,
            plane: None,
            rim: 0.0,
            thickness: None,
            cut: None,
        }
    }
}
