//! The features of a recipe in its file, datum systems of them, and which of them a gauge may be of.

use super::file::{LONGEST_NAME, RecipeFile};
use super::gauge::GaugeFile;
use super::seam;
pub use super::seam::FeatureKind;
use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_SIDE, clipped, length, text, within};

/// Features of a recipe.
pub const MAX_FEATURES: usize = 96;
/// Datum systems of a recipe.
pub const MAX_DATUMS: usize = 8;
/// Features of a datum system.
const MAX_OF: usize = 3;
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
        Self {
            name: name.into(),
            kind: FeatureKind::Surface,
            region,
        }
    }

    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self) -> Result<(), String> {
        Fields.check("", self)?;
        length("region", self.region.len(), 3, MAX_CORNERS)?;
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

impl RecipeFile {
    /// Checks that what datum systems and gauges name is there, once in each, and of a kind that
    /// they take.
    ///
    /// # Errors
    /// In words, with the name of the first that does not fit.
    pub(super) fn check_references(&self) -> Result<(), String> {
        for DatumFile { name, of } in &self.datums {
            let datum = format!("datum {:?}", clipped(name));
            self.check_all_there(&datum, of)?;
        }
        self.gauges
            .iter()
            .try_for_each(|gauge| self.check_of(gauge))
    }

    /// A feature by its name.
    pub fn feature(&self, name: &str) -> Option<&FeatureFile> {
        self.features.iter().find(|feature| feature.name == name)
    }

    fn check_all_there(&self, what: &str, names: &[String]) -> Result<(), String> {
        for (at, name) in names.iter().enumerate() {
            let called = clipped(name);
            if self.feature(name).is_none() {
                return Err(format!(
                    "{what} names a feature {called:?} that is not there"
                ));
            }
            if names[..at].contains(name) {
                return Err(format!("{what} names the feature {called:?} twice"));
            }
        }
        Ok(())
    }

    /// Checks the features and the datum system of a gauge.
    fn check_of(&self, gauge: &GaugeFile) -> Result<(), String> {
        let what = format!("gauge {:?}", clipped(&gauge.name));
        let takes = seam::takes(&gauge.measures);
        let kind = gauge.kind_name();
        if gauge.of.len() != takes.len() {
            return Err(format!(
                "{what} is of {} features: {kind} takes {}",
                gauge.of.len(),
                takes.len()
            ));
        }
        // A step of a region from itself is refused with its own words.
        match &gauge.of[..] {
            [one, other] if one == other => self.check_all_there(&what, &gauge.of[..1])?,
            of => self.check_all_there(&what, of)?,
        }
        for (name, fitting) in gauge.of.iter().zip(takes) {
            let found = self.feature(name).map(|feature| feature.kind);
            if !found.is_some_and(|kind| fitting.contains(&kind)) {
                let fitting: Vec<_> = fitting.iter().map(|kind| kind.name()).collect();
                return Err(format!(
                    "{what} is of {:?}, a {}: {kind} takes a {} there",
                    clipped(name),
                    found.map_or("feature", FeatureKind::name),
                    fitting.join(" or a ")
                ));
            }
        }
        match &gauge.datum {
            None => Ok(()),
            Some(name) if !self.datums.iter().any(|datum| datum.name == *name) => Err(format!(
                "{what} names a datum {:?} that is not there",
                clipped(name)
            )),
            Some(_) => Err(format!(
                "{what} has a datum: {kind} takes none, leave it out"
            )),
        }
    }
}
