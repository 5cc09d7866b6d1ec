//! The kinds of features, and a feature of a part.

use crate::inspect::contour::shape::{ContourKind, circle, line, slot};
use crate::inspect::region::Region;

/// Declares the kinds: each with its name in recipes, and contours with what their file says of
/// them.
macro_rules! kinds {
    (
        surfaces { $($(#[$surface_doc:meta])* $surface:ident $surface_name:literal,)* }
        edges { $($(#[$edge_doc:meta])* $edge:ident $edge_name:literal = $edge_row:path,)* }
        openings { $($(#[$opening_doc:meta])* $opening:ident $opening_name:literal = $opening_row:path,)* }
        joints { $($(#[$joint_doc:meta])* $joint:ident $joint_name:literal,)* }
    ) => {
        /// What is found in the region of a feature.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum FeatureKind {
            $($(#[$surface_doc])* #[cfg_attr(feature = "serde", serde(rename = $surface_name))] $surface,)*
            $($(#[$edge_doc])* #[cfg_attr(feature = "serde", serde(rename = $edge_name))] $edge,)*
            $($(#[$opening_doc])* #[cfg_attr(feature = "serde", serde(rename = $opening_name))] $opening,)*
            $($(#[$joint_doc])* #[cfg_attr(feature = "serde", serde(rename = $joint_name))] $joint,)*
        }

        impl FeatureKind {
            const COUNT: usize = [
                $($surface_name,)* $($edge_name,)* $($opening_name,)* $($joint_name,)*
            ].len();
            /// All kinds.
            pub const ALL: [Self; Self::COUNT] = [
                $(Self::$surface,)* $(Self::$edge,)* $(Self::$opening,)* $(Self::$joint,)*
            ];
            /// Holes in a face: closed contours, with a centre.
            pub const OPENINGS: &[Self] = &[$(Self::$opening,)*];
            /// Contours of a face: where the face ends, in its plane.
            pub const CONTOURS: &[Self] = &[$(Self::$opening,)* $(Self::$edge,)*];
            /// Kinds with a height.
            pub const PLANE_OR_OPENING: &[Self] = &[Self::Plane, $(Self::$opening,)*];
            /// Kinds with a geometry.
            pub const GEOMETRIC: &[Self] = &[Self::Plane, $(Self::$opening,)* $(Self::$edge,)*];

            /// Its name, as recipes have it.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$surface => $surface_name,)*
                    $(Self::$edge => $edge_name,)*
                    $(Self::$opening => $opening_name,)*
                    $(Self::$joint => $joint_name,)*
                }
            }

            /// What is known of a kind of contour; `None` of others.
            pub fn contour(self) -> Option<&'static ContourKind> {
                match self {
                    $(Self::$edge => Some(&$edge_row),)*
                    $(Self::$opening => Some(&$opening_row),)*
                    _ => None,
                }
            }
        }
    };
}

kinds! {
    surfaces {
        /// Heights and deviations from golden, without a shape.
        Surface "surface",
        /// The plane that fits best, by least squares.
        Plane "plane",
    }
    edges {
        /// A straight edge of a face.
        Line "line" = line::KIND,
    }
    openings {
        /// A round hole in a face.
        Circle "circle" = circle::KIND,
        /// A slot with round ends in a face.
        Slot "slot" = slot::KIND,
    }
    joints {
        /// A cut across a joint of two sheets.
        Section "section",
    }
}

impl FeatureKind {
    /// Whether it is the contour of a face: where the face ends, in its plane.
    pub fn is_contour(self) -> bool {
        self.contour().is_some()
    }

    /// Whether it is a hole in a face.
    pub fn is_opening(self) -> bool {
        Self::OPENINGS.contains(&self)
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
