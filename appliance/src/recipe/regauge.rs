//! Gauges that follow golden: their limits and masters are worked out again whenever golden, the
//! gauges or the production sequence change.

use super::archive::Arrays;
use super::golden::TaughtRecipe;
use super::plan::Plan;
use super::planner;
use super::{GaugeFile, Recipe, RecipeFile};
use algo::inspect::{Findings, Missing};
use hal::bounds::clipped;

/// Limits decide on the sequence, and this on golden's own value by some micrometres, which moves
/// the limits: more turns than this change nothing that matters.
const TURNS: usize = 3;

impl TaughtRecipe {
    /// Works out limits and masters, chooses the production sequence for the gauges of a manifest,
    /// and packs it with its arrays.
    ///
    /// # Errors
    /// In words, if they do not fit each other, or golden has no value where one is needed.
    pub(super) fn of(mut manifest: RecipeFile, arrays: Arrays) -> Result<Self, String> {
        manifest.gauges.sort_by_key(|gauge| gauge.slot);
        let choose = |of: &RecipeFile| planner::choose(&of.sequences, &of.gauges, arrays.widest());
        let mut choice = choose(&manifest);
        manifest.production = choice.production;
        let is_of_contour = manifest.gauge_of_contour().is_some();
        if is_of_contour || manifest.gauges.iter().any(GaugeFile::needs_golden) {
            let head = manifest.head()?;
            for _ in 0..TURNS {
                let recipe = Recipe::fit(&manifest, arrays.clone())?;
                let found = Plan::golden(recipe, &head).map_err(|error| error.to_string())?;
                manifest.follow(&found)?;
                choice = choose(&manifest);
                if choice.production == manifest.production {
                    break;
                }
                manifest.production = choice.production;
            }
        }
        if manifest.two_frames {
            choice.reasons.push(Self::TWO_FRAMES.into());
        }
        if is_of_contour {
            choice.reasons.push(Self::CONTOURS.into());
        }
        Self::sealed(manifest, arrays, choice)
    }
}

impl RecipeFile {
    /// Takes over what is found of golden.
    ///
    /// # Errors
    /// In words: a gauge that needs golden's value has none, or one can never have a value.
    fn follow(&mut self, golden: &Findings) -> Result<(), String> {
        let found = golden.readings.iter().zip(&golden.missing);
        for (gauge, (reading, missing)) in self.gauges.iter_mut().zip(found) {
            gauge.set_golden(reading.as_ref());
            if *missing == Some(Missing::Open) {
                return Err(format!(
                    "gauge {:?} depends on how the part lies along a direction that its shape does not determine: give it a datum",
                    clipped(&gauge.name)
                ));
            }
            if gauge.needs_golden() && gauge.golden_value.is_none() {
                return Err(format!(
                    "gauge {:?} finds nothing to measure in golden: move its feature, or write its limits and leave golden and master out",
                    clipped(&gauge.name)
                ));
            }
        }
        Ok(())
    }
}
