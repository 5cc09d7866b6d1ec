//! Which features and datum systems a recipe names, and whether they are there and fit.

use super::bounds::each;
use super::feature::{DatumFile, FeatureFile};
use super::file::RecipeFile;
use super::gauge::GaugeFile;
use algo::inspect::{FeatureKind, MAX_FEATURES, makes_datum};
use hal::bounds::{clipped, length};

/// Datum systems of a recipe.
pub(super) const MAX_DATUMS: usize = 8;

impl RecipeFile {
    /// Checks features and datum systems, each by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_features(&self) -> Result<(), String> {
        self.check_counts()?;
        each("features", ".", &self.features, FeatureFile::check_bounds)?;
        each("datums", ".", &self.datums, DatumFile::check_bounds)
    }

    /// Checks how many features and datum systems there are.
    ///
    /// # Errors
    /// As above.
    pub(super) fn check_counts(&self) -> Result<(), String> {
        length("features", self.features.len(), 0, MAX_FEATURES)?;
        Ok(length("datums", self.datums.len(), 0, MAX_DATUMS)?)
    }

    /// Checks that what datum systems and gauges name is there, once in each, and of a kind that
    /// they take.
    ///
    /// # Errors
    /// In words, with the name of the first that does not fit.
    pub(super) fn check_references(&self) -> Result<(), String> {
        self.datums.iter().try_for_each(|of| self.check_frame(of))?;
        self.features
            .iter()
            .try_for_each(|of| self.check_plane(of))?;
        self.gauges
            .iter()
            .try_for_each(|of| self.check_shifts(of))?;
        self.gauges.iter().try_for_each(|of| self.check_of(of))
    }

    /// Checks that the features of a datum system are there and make a frame.
    ///
    /// # Errors
    /// In words, with its name.
    pub(super) fn check_frame(&self, datum: &DatumFile) -> Result<(), String> {
        let DatumFile { name, of } = datum;
        let datum = format!("datum {:?}", clipped(name));
        self.check_all_there(&datum, of)?;
        let kinds = of.iter().filter_map(|name| self.feature(name));
        let kinds: Vec<FeatureKind> = kinds.map(|feature| feature.kind).collect();
        match makes_datum(&kinds) {
            true => Ok(()),
            false => Err(format!(
                "{datum} is no frame: name a plane, then a circle, slot or line, then another one that is not a plane"
            )),
        }
    }

    /// Checks that what a feature lies in is there and a plane.
    ///
    /// # Errors
    /// In words, with its name.
    pub(super) fn check_plane(&self, feature: &FeatureFile) -> Result<(), String> {
        let Some(plane) = &feature.plane else {
            return Ok(());
        };
        match self.feature(plane).map(|feature| feature.kind) {
            Some(FeatureKind::Plane) => Ok(()),
            found => Err(format!(
                "feature {:?} lies in {:?}, which is {}: name a plane",
                clipped(&feature.name),
                clipped(plane),
                found.map_or("not there".into(), |kind| format!("a {}", kind.name()))
            )),
        }
    }

    /// Refuses a gauge of a contour where two frames are used.
    ///
    /// # Errors
    /// In words, with its name.
    pub(super) fn check_shifts(&self, gauge: &GaugeFile) -> Result<(), String> {
        match self.two_frames && self.is_of_contour(gauge) {
            true => Err(format!(
                "gauge {:?} is of a contour, which needs three shifts or more, and two_frames is true: set it to false",
                clipped(&gauge.name)
            )),
            false => Ok(()),
        }
    }

    /// A gauge that is of a contour, if there is one.
    pub(super) fn gauge_of_contour(&self) -> Option<&GaugeFile> {
        self.gauges.iter().find(|gauge| self.is_of_contour(gauge))
    }

    fn is_of_contour(&self, gauge: &GaugeFile) -> bool {
        let is_contour = |name: &String| self.feature(name).is_some_and(|of| of.kind.is_contour());
        gauge.of.iter().any(is_contour)
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
    ///
    /// # Errors
    /// In words, with its name.
    pub(super) fn check_of(&self, gauge: &GaugeFile) -> Result<(), String> {
        let what = format!("gauge {:?}", clipped(&gauge.name));
        let takes = gauge.measures.facts().takes;
        let kind = gauge.measures.name();
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
        if !gauge.measures.measures(&self.kinds_of(gauge)) {
            return Err(format!(
                "{what}: {kind} does not measure such a pair of features"
            ));
        }
        match &gauge.datum {
            None => Ok(()),
            Some(name) if !self.datums.iter().any(|datum| datum.name == *name) => Err(format!(
                "{what} names a datum {:?} that is not there",
                clipped(name)
            )),
            Some(_) if !gauge.measures.facts().datum => Err(format!(
                "{what} has a datum: {kind} takes none, leave it out"
            )),
            Some(_) => Ok(()),
        }
    }

    fn kinds_of(&self, gauge: &GaugeFile) -> Vec<FeatureKind> {
        let of = gauge.of.iter().filter_map(|name| self.feature(name));
        of.map(|feature| feature.kind).collect()
    }
}
