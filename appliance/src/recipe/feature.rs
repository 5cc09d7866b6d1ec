//! The features of a recipe in its file, and datum systems of them.

use algo::inspect::{Cut, FeatureKind, Region};
use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_SIDE, length, text, within};

/// The longest name of a recipe, feature, datum system or gauge, in characters.
pub const LONGEST_NAME: usize = 64;
/// Features of a datum system.
pub(super) const MAX_OF: usize = 3;
/// Largest radius of a rim and largest thickness of a sheet, mm.
pub(super) const MAX_RIM_MM: f64 = 10.0;
pub(super) const MAX_THICKNESS_MM: f64 = 20.0;
/// Longest and widest section, mm.
pub(super) const MAX_SECTION_MM: f64 = 1000.0;
/// Corners of a region.
pub(super) const MAX_CORNERS: usize = 256;

bounded! {
    /// Geometry of the part, by what is measured of a region.
    pub struct FeatureFile {
        /// Its name.
        pub name: String = Longest(LONGEST_NAME),
        /// What is made of the measured points.
        pub kind: FeatureKind,
        /// Corners [u, v] of a polygon in camera pixels of the golden measurement; a section has
        /// none.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub region: Vec<[f64; 2]>,
        /// Of a contour, the name of the plane that it lies in; `None` if the plane is fitted to the
        /// face in its own region.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub plane: Option<String> = Longest(LONGEST_NAME),
        /// Of a contour, the radius of its rim, mm: 0 where it is sharp. Of a plane, that of all
        /// contours in it that state none. `None` where it is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rim_mm: Option<f64> = 0.0..=MAX_RIM_MM,
        /// Of a plane, the thickness of its sheet, mm: for the walls of contours in it. 0 where no
        /// wall is seen, `None` where it is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub thickness_mm: Option<f64> = 0.0..=MAX_THICKNESS_MM,
        /// Of a section, where it begins: [u, v] in camera pixels of the golden measurement.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub from: Option<[f64; 2]>,
        /// Where it ends.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub to: Option<[f64; 2]>,
        /// Its width, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub width_mm: Option<f64> = 0.0..=MAX_SECTION_MM,
        /// From where to where the left side is flat, mm from its beginning.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub left: Option<[f64; 2]>,
        /// The same of the right side.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub right: Option<[f64; 2]>,
        /// The radius of its edges, if it is stated, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub edge_mm: Option<f64> = 0.0..=MAX_RIM_MM,
        /// How far that may be off, ± mm; `None` where it is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub edge_tolerance_mm: Option<f64> = 0.0..=MAX_RIM_MM,
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
            from: None,
            to: None,
            width_mm: None,
            left: None,
            right: None,
            edge_mm: None,
            edge_tolerance_mm: None,
        }
    }

    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self) -> Result<(), String> {
        Fields.check("", self)?;
        self.check_keys()?;
        if self.kind == FeatureKind::Section {
            return self.check_section();
        }
        length("region", self.region.len(), 3, MAX_CORNERS)?;
        // Polygons are clipped to the frame: corners up to one frame's width outside of it are
        // enough for any shape.
        let far = f64::from(MAX_SIDE);
        for corner in self.region.as_flattened() {
            within("region", *corner, -far, 2.0 * far)?;
        }
        Ok(())
    }

    /// Refuses keys that its kind does not have.
    fn check_keys(&self) -> Result<(), String> {
        let kind = self.kind;
        let (contour, section) = (kind.is_contour(), kind == FeatureKind::Section);
        let plane = kind == FeatureKind::Plane;
        let (of_contour, of_section) = ("a line, circle or slot", "a section");
        for (key, is_there, fits, whose) in [
            (
                "region",
                !self.region.is_empty(),
                !section,
                "any other kind",
            ),
            ("plane", self.plane.is_some(), contour, of_contour),
            (
                "rim_mm",
                self.rim_mm.is_some(),
                contour || plane,
                "a plane, line, circle or slot",
            ),
            (
                "thickness_mm",
                self.thickness_mm.is_some(),
                plane,
                "a plane",
            ),
            ("from", self.from.is_some(), section, of_section),
            ("to", self.to.is_some(), section, of_section),
            ("width_mm", self.width_mm.is_some(), section, of_section),
            ("left", self.left.is_some(), section, of_section),
            ("right", self.right.is_some(), section, of_section),
            ("edge_mm", self.edge_mm.is_some(), section, of_section),
            (
                "edge_tolerance_mm",
                self.edge_tolerance_mm.is_some(),
                section && self.edge_mm.is_some(),
                "a section with an edge_mm",
            ),
        ] {
            if is_there && !fits {
                let kind = kind.name();
                return Err(format!("{key} of a {kind}: {whose} has it, leave it out"));
            }
        }
        Ok(())
    }

    /// Checks where a section is.
    fn check_section(&self) -> Result<(), String> {
        let cut = self.cut().ok_or(
            "a section has from, to, width_mm, left and right: add those that are missing",
        )?;
        let far = f64::from(MAX_SIDE);
        for (key, place) in [("from", cut.from), ("to", cut.to)] {
            for at in place {
                within(key, at, 0.0, far)?;
            }
        }
        if cut.from == cut.to {
            return Err("from and to are the same place: a section has a length".into());
        }
        if !(cut.width_mm > 0.0) {
            return Err(format!("width_mm is {}: write more than 0", cut.width_mm));
        }
        if cut.edge_mm == Some(0.0) {
            return Err("edge_mm is 0: write more, or leave it out".into());
        }
        for (key, at) in [("left", cut.left), ("right", cut.right)] {
            for at in at {
                within(key, at, 0.0, MAX_SECTION_MM)?;
            }
            if at[0] >= at[1] {
                return Err(format!(
                    "{key} is {at:?}: write where it begins and where it ends"
                ));
            }
        }
        match cut.left[1] <= cut.right[0] {
            true => Ok(()),
            false => {
                Err("left ends behind the beginning of right: both lie beside the joint".into())
            }
        }
    }

    /// The pixels of its region in frames of (width, height); none of a section, whose region is as
    /// wide as the part's distance makes it, which is planned.
    ///
    /// # Errors
    /// In words, with its name: its region is none.
    pub(super) fn pixels(&self, (width, height): (usize, usize)) -> Result<Region, String> {
        if self.cut().is_some() {
            return Ok(Region::default());
        }
        let corners: Vec<_> = self.region.iter().map(|&[u, v]| (u, v)).collect();
        Region::polygon(&corners, width, height)
            .map_err(|error| format!("feature {:?}: {error}", self.name))
    }

    /// Where a section is; `None` of other kinds, and where a key is missing.
    pub(super) fn cut(&self) -> Option<Cut> {
        Some(Cut {
            from: self.from?,
            to: self.to?,
            width_mm: self.width_mm?,
            left: self.left?,
            right: self.right?,
            edge_mm: self.edge_mm,
            edge_tolerance_mm: self.edge_tolerance_mm,
        })
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
        names.try_for_each(|name| text("of", name, LONGEST_NAME))?;
        Ok(())
    }
}
