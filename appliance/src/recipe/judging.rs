//! Whether a recipe can judge: limits that a part can keep and miss, names that are unique, steps
//! between two features.
//!
//! Without this a part of any shape passes, and nobody sees why. It is checked whenever a recipe is
//! taught, imported, edited or loaded.

use super::file::RecipeFile;
use super::gauge::GaugeFile;
use std::collections::HashSet;

impl RecipeFile {
    /// Refuses a recipe whose verdict does not depend on the part as its gauges say, and one
    /// without any limit that does not state `judges_nothing`.
    ///
    /// # Errors
    /// In words, with the name of the first such gauge and the remedy.
    pub(super) fn check_judging(&self) -> Result<(), String> {
        for gauge in &self.gauges {
            gauge.check_judging()?;
            self.check_step(gauge)?;
        }
        check_unique("feature", self.features.iter().map(|feature| &feature.name))?;
        check_unique("datum", self.datums.iter().map(|datum| &datum.name))?;
        check_unique("gauge", self.gauges.iter().map(|gauge| &gauge.name))?;
        self.check_limited()
    }

    /// Refuses a recipe without any limit that does not say so, and one that says so and has some.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub(super) fn check_limited(&self) -> Result<(), String> {
        let limited = self.gauges.iter().find(|gauge| gauge.can_fail());
        match (limited, self.judges_nothing) {
            (None, false) => Err(
                "it judges nothing: no gauge has a limit that a part can miss, so every part that is measured would pass: give a gauge \
                 limits, or state \"judges_nothing\": true to measure only"
                    .into(),
            ),
            (Some(GaugeFile { name, .. }), true) => Err(format!(
                "it states \"judges_nothing\": true, but gauge {name:?} has limits: take one of them away"
            )),
            _ => Ok(()),
        }
    }

    /// Whether no gauge has a limit that a part can miss.
    pub(super) fn is_without_limits(&self) -> bool {
        !self.gauges.iter().any(GaugeFile::can_fail)
    }

    /// Refuses what a feature has from itself, under whatever name: it is 0 for every part.
    ///
    /// # Errors
    /// In words, with the gauge's name.
    pub(super) fn check_step(&self, gauge: &GaugeFile) -> Result<(), String> {
        let [region, from] = &gauge.of[..] else {
            return Ok(());
        };
        let polygon = |name: &str| self.feature(name).map(|feature| &feature.region);
        let same =
            from == region || polygon(from).is_some_and(|here| polygon(region) == Some(here));
        match same {
            true => Err(format!(
                "gauge {:?} measures the {} of {region:?} from itself, which is 0 whatever the part: name another feature",
                gauge.name,
                gauge.measures.name()
            )),
            false => Ok(()),
        }
    }
}

impl GaugeFile {
    /// Refuses limits that no part can keep or miss.
    ///
    /// # Errors
    /// In words, with the gauge's name and the remedy.
    pub(super) fn check_judging(&self) -> Result<(), String> {
        let refused = self.check_limits();
        refused.map_err(|error| format!("{error}: change the limits"))
    }
}

/// Refuses a name that two features or two gauges have: limits and references would belong to
/// either.
pub(super) fn check_unique<'a>(
    what: &str,
    names: impl Iterator<Item = &'a String>,
) -> Result<(), String> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(format!(
                "two of them are called {name:?}: give each {what} its own name"
            ));
        }
    }
    Ok(())
}
