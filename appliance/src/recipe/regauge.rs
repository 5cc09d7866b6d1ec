//! Gauges that follow golden: their limits and masters are worked out again whenever golden, the
//! gauges or the production sequence change.

use super::archive::Arrays;
use super::golden::UnsealedRecipe;
use super::plan::{Golden, Plan};
use super::planner::{self, Choice};
use super::{Element, GaugeFile, Part, Recipe, RecipeFile, Refusal};
use crate::head::calibration::Calibration;
use crate::system::headway::Headway;
use algo::inspect::{Findings, Missing};
use hal::bounds::clipped;

/// Limits decide on the sequence, and this on golden's own value by some micrometres, which moves
/// the limits: more turns than this change nothing that matters.
const TURNS: usize = 3;

impl UnsealedRecipe {
    /// Works out limits and masters, and chooses the production sequence for the gauges of a
    /// manifest.
    ///
    /// # Errors
    /// In words, if they do not fit each other, or golden has no value where one is needed.
    pub(super) fn of(
        mut manifest: RecipeFile,
        arrays: Arrays,
        headway: Headway<'_>,
    ) -> Result<Self, Refusal> {
        let head = manifest.head()?;
        let settled = manifest.settle((&arrays, &head), headway);
        let (mut choice, _) = settled?;
        if manifest.two_frames {
            choice.reasons.push(Self::TWO_FRAMES.into());
        }
        if manifest.has_contours() {
            choice.reasons.push(Self::CONTOURS.into());
        }
        Ok(Self {
            manifest,
            arrays,
            choice,
        })
    }
}

impl RecipeFile {
    /// Sorts the gauges by their slots, works out limits and masters, and chooses the production
    /// sequence. The answer also has golden as the recipe measures it, where that was needed. `head`
    /// has the models of the recipe ([`Self::head`]).
    ///
    /// # Errors
    /// In words, if they do not fit each other, or golden has no value where one is needed.
    pub(super) fn settle(
        &mut self,
        (arrays, head): (&Arrays, &Calibration),
        headway: Headway<'_>,
    ) -> Result<(Choice, Option<Golden>), Refusal> {
        self.gauges.sort_by_key(|gauge| gauge.slot);
        let choose = |of: &Self| planner::choose(&of.sequences, &of.gauges, arrays.widest());
        let mut choice = choose(self);
        self.production = choice.production;
        if !self.has_contours() && !self.gauges.iter().any(GaugeFile::needs_golden) {
            return Ok((choice, None));
        }
        let head = &head.clone().with_rays();
        for turn in 0..TURNS {
            let [from, to] = [turn, turn + 1].map(|turn| turn as f64 / TURNS as f64);
            let golden = self.golden((arrays, head), false, headway.part(from, to))?;
            self.follow(&golden.findings)?;
            choice = choose(self);
            if choice.production == self.production {
                return Ok((choice, Some(golden)));
            }
            self.production = choice.production;
        }
        Ok((choice, None))
    }

    /// Golden as the recipe measures it with a head that has its models; leniently also where golden
    /// shows too little of a contour.
    ///
    /// # Errors
    /// In words: manifest and arrays do not fit each other, or golden does not have a feature.
    pub(super) fn golden(
        &self,
        (arrays, head): (&Arrays, &Calibration),
        lenient: bool,
        headway: Headway<'_>,
    ) -> Result<Golden, Refusal> {
        let recipe = Recipe::fit(self, arrays.clone())?;
        let measure = match lenient {
            true => Plan::golden_leniently,
            false => Plan::golden,
        };
        Ok(measure(recipe, head, headway)?)
    }

    /// Takes over what is found of golden.
    ///
    /// # Errors
    /// In words: a gauge that needs golden's value has none, or one can never have a value.
    fn follow(&mut self, golden: &Findings) -> Result<(), Refusal> {
        let found = golden.readings.iter().zip(&golden.missing);
        let gauges = self.gauges.iter_mut().enumerate();
        for ((place, gauge), (reading, missing)) in gauges.zip(found) {
            gauge.set_golden(reading.as_ref());
            let name = clipped(&gauge.name);
            let words = if *missing == Some(Missing::Open) {
                format!(
                    "gauge {name:?} depends on how the part lies along a direction that its shape does not determine: give it a datum"
                )
            } else if gauge.needs_golden() && gauge.golden_value.is_none() {
                format!(
                    "gauge {name:?} finds nothing to measure in golden: move its feature, or write its limits and leave golden and master out"
                )
            } else {
                continue;
            };
            let of = Some(Element::new(Part::Gauge, place, &gauge.name));
            return Err(Refusal { words, of });
        }
        Ok(())
    }
}
