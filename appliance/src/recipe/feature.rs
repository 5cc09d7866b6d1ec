//! The features of a recipe in its file, and datum systems of them.

use algo::inspect::FeatureKind;
use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_SIDE, length, text, within};

/// The longest name of a recipe, feature, datum system or gauge, in characters.
pub const LONGEST_NAME: usize = 64;
/// Features of a datum system.
const MAX_OF: usize = 3;
/// Largest radius of a rim and largest thickness of a sheet, mm.
const MAX_RIM_MM: f64 = 10.0;
const MAX_THICKNESS_MM: f64 = 20.0;
/// Corners of a region.
const MAX_CORNERS: usize = 256;

bounded! {
    /// Geometry of the part, by what is measured of a region.
    pub struct FeatureFile {
        /// Its name.
        pub name: String = Longest(LONGEST_NAME),
        /// What is made of the measured points.
        pub kind: FeatureKind,
        /// Corners [u, v] of a polygon in camera pixels of the golden measurement.
        pub region: Vec<[f64; 2]>,
        /// Of a contour, the name of the plane that it lies in; `None` if the plane is fitted to the
        /// face in its own region.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub plane: Option<String> = Longest(LONGEST_NAME),
        /// Of a contour, the radius of its rim, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rim_mm: Option<f64> = 0.0..=MAX_RIM_MM,
        /// Of a plane, the thickness of its sheet, mm: for the walls of contours in it. 0 where no
        /// wall is seen, `None` where it is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub thickness_mm: Option<f64> = 0.0..=MAX_THICKNESS_MM,
    }

    /// A datum system (ISO 5459).
    pub struct DatumFile {
        /// Its name.
        pub name: String = Longest(LONGEST_NAME),
        /// The names of its features, the primary datum first.
        pub of: Vec<String>,
    }
}

impl FeatureFile {
    /// A feature of the cells of a polygon.
    pub fn surface(name: impl Into<String>, region: Vec<[f64; 2]>) -> Self {
        Self::new(name, FeatureKind::Surface, region)
    }

    /// A feature in a polygon.
    pub fn new(name: impl Into<String>, kind: FeatureKind, region: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.into(),
            kind,
            region,
            plane: None,
            rim_mm: None,
            thickness_mm: None,
        }
    }

    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self) -> Result<(), String> {
        Fields.check("", self)?;
        length("region", self.region.len(), 3, MAX_CORNERS)?;
        let (kind, is_contour) = (self.kind.name(), self.kind.is_contour());
        for (key, is_there, fits, whose) in [
            (
                "plane",
                self.plane.is_some(),
                is_contour,
                "a line, circle or slot",
            ),
            (
                "rim_mm",
                self.rim_mm.is_some(),
                is_contour,
                "a line, circle or slot",
            ),
            (
                "thickness_mm",
                self.thickness_mm.is_some(),
                self.kind == FeatureKind::Plane,
                "a plane",
            ),
        ] {
            if is_there && !fits {
                return Err(format!("{key} of a {kind}: {whose} has it, leave it out"));
            }
        }
        // Polygons are clipped to the frame: corners up to one frame's width outside of it are
        // enough for any shape.
        let far = f64::from(MAX_SIDE);
        for corner in self.region.as_flattened() {
            within("region", *corner, -far, 2.0 * far)?;
        }
        Ok(())
    }
}

impl DatumFile {
    /// As for features.
    ///
    /// # Errors
    /// As for features.
    pub(super) fn check_bounds(&self) -> Result<(), String> {
        Fields.check("", self)?;
        length("of", self.of.len(), 1, MAX_OF)?;
        let mut names = self.of.iter();
        names.try_for_each(|name| text("of", name, LONGEST_NAME))
    }
}
