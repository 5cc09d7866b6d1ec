//! How much of golden's light comes back from a part, so that a head that is out of focus, too dark
//! or too bright is told from a wrong part.
//!
//! The pattern's contrast falls where something blurs it, the mean of a pixel's samples does not;
//! both fall with the light; foreign light raises the mean alone. Medians over pixels of golden's
//! compared surface, so that a part that lies elsewhere changes little.

use crate::recipe::file::archive::Arrays;
use crate::station::error_code::{BLURRED, EMPTY, SATURATED, TOO_DARK};
use crate::station::snapshot::warning;
use algo::frame::{FrameView, Samples};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use algo::units::Modulation;

/// Pixels that are looked at, at most.
const PLACES: usize = 4096;
/// Light and contrast below this share of golden's are low.
const LOW: f64 = 0.6;
/// Foreign light raises the mean of the samples by this share of golden's at least.
const FOREIGN: f64 = 0.3;
/// More of the pixels than this are at full scale.
const MOST_SATURATED: f64 = 0.05;
/// Less modulation than this share of golden's is none.
const NONE: f64 = 0.08;

/// Golden's light at pixels that are spread over its compared surface.
#[derive(Debug)]
pub(crate) struct GoldenLight {
    /// Row-major places and the modulation there in counts.
    places: Vec<(u32, f32)>,
    /// The median of the mean samples there, counts; none if it is not known.
    offset: Option<f64>,
}

/// The light of a part over golden's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Light {
    /// Modulation of the finest level.
    modulation: f64,
    /// Mean of the samples; none where golden's is not known.
    offset: Option<f64>,
    /// Share of the pixels with a sample at full scale.
    saturated: f64,
}

/// What is wrong with the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cause {
    /// Nothing of the pattern comes back.
    Nothing,
    /// So small a share of golden's light comes back.
    Dark(f64),
    /// The finest fringes have so small a share of golden's contrast.
    Blurred(f64),
    /// So many pixels are at full scale.
    Saturated {
        /// The share of the pixels at full scale.
        share: f64,
        /// Whether other light than the pattern's has grown.
        foreign: bool,
    },
}

impl Cause {
    /// ERROR_CODE.
    pub fn code(self) -> u16 {
        match self {
            Self::Nothing => EMPTY,
            Self::Dark(_) => TOO_DARK,
            Self::Blurred(_) => BLURRED,
            Self::Saturated { .. } => SATURATED,
        }
    }

    /// WARNING.
    pub fn warning(self) -> u16 {
        match self {
            Self::Nothing | Self::Dark(_) => warning::LOW_LIGHT,
            Self::Blurred(_) => warning::PATTERN_UNFIT,
            Self::Saturated { .. } => warning::SATURATION,
        }
    }

    /// The cause in words, and the remedy.
    pub fn words(self) -> String {
        match self {
            Self::Nothing => {
                "none of the pattern's light comes back: put the part in place, and switch the light on"
                    .into()
            }
            Self::Dark(share) => format!(
                "only {:.0} % of the light comes back that did when the part was taught: check the projector's light and the exposure, clean the lenses",
                share * 100.0
            ),
            Self::Blurred(share) => format!(
                "the fine fringes have only {:.0} % of the contrast that they had when the part was taught: focus camera and projector, clean the lenses",
                share * 100.0
            ),
            Self::Saturated { share, foreign } => {
                let remedy = match foreign {
                    true => "keep other light away from the part",
                    false => "shorten the exposure",
                };
                let percent = share * 100.0;
                format!("{percent:.0} % of the part's pixels are at full scale: {remedy}")
            }
        }
    }
}

impl GoldenLight {
    /// Golden's light by a recipe's arrays; `offset` is the recipe's `golden_offset_counts`.
    pub fn of(arrays: &Arrays, offset: Option<f64>) -> Self {
        let compared = |at: &usize| arrays.valid[*at] != 0 && arrays.modulation[*at] > 0.0;
        let count = (0..arrays.valid.len()).filter(compared).count();
        let places = (0..arrays.valid.len()).filter(compared);
        let places = places.step_by(count.div_ceil(PLACES).max(1));
        Self {
            places: places
                .map(|at| (at as u32, arrays.modulation[at]))
                .collect(),
            offset,
        }
    }
}

impl Light {
    /// The light of these frames, whose finest level has this modulation; none if golden's is not
    /// known anywhere.
    pub fn of(
        golden: &GoldenLight,
        views: &[FrameView<'_>],
        (modulation, full_scale): (&[Modulation], u16),
    ) -> Option<Self> {
        let places = &golden.places;
        let share = |&(at, counts): &(u32, f32)| {
            modulation[at as usize].counts(full_scale) / f64::from(counts)
        };
        let looked = places.iter().map(|(at, _)| samples(views, *at as usize));
        let looked: Vec<(f64, u16)> = looked.collect();
        let saturated = looked.iter().filter(|(_, most)| *most >= full_scale);
        let saturated = saturated.count() as f64 / places.len().max(1) as f64;
        let means = looked.iter().map(|(mean, _)| *mean).collect();
        let offset = median(means).zip(golden.offset);
        Some(Self {
            modulation: median(places.iter().map(share).collect())?,
            offset: offset.map(|(mean, golden)| mean / golden),
            saturated,
        })
    }

    /// The likeliest reason why a part cannot be measured in this light; none if the light is as it
    /// was.
    pub fn cause(self) -> Option<Cause> {
        let Self {
            modulation,
            offset,
            saturated,
        } = self;
        let foreign = offset.is_some_and(|offset| offset > modulation.max(1.0) + FOREIGN);
        // Foreign light raises the offset, so the contrast is worked out for an offset of at most
        // golden's; where the pattern's light has fallen, a larger part of the offset is foreign.
        let contrast = offset.map_or(1.0, |offset| modulation / offset.min(1.0));
        let least = match offset.is_some_and(|offset| offset < LOW) {
            true => LOW * LOW,
            false => LOW,
        };
        if saturated > MOST_SATURATED {
            let share = saturated;
            Some(Cause::Saturated { share, foreign })
        } else if modulation >= LOW {
            None
        } else if modulation < NONE && offset.is_none_or(|offset| offset < LOW) {
            Some(Cause::Nothing)
        } else if contrast < least {
            Some(Cause::Blurred(contrast))
        } else {
            Some(Cause::Dark(modulation))
        }
    }
}

/// The median of the mean samples of the resolved pixels, counts of these frames; none without such
/// pixels.
pub(crate) fn offset_counts(views: &[FrameView<'_>], phases: &PhaseMap) -> Option<f64> {
    let places = phases.trust.iter().enumerate();
    let resolved = places.filter(|(_, trust)| **trust == Trust::Resolved);
    let apart = phases.count(Trust::Resolved).div_ceil(PLACES).max(1);
    let looked = resolved.step_by(apart);
    median(looked.map(|(at, _)| samples(views, at).0).collect())
}

/// Mean and largest of a pixel's samples.
fn samples(views: &[FrameView<'_>], at: usize) -> (f64, u16) {
    let sample = |view: &FrameView<'_>| {
        let (row, column) = (at / view.width(), at % view.width());
        match view.row(row) {
            Samples::Eight(row) => u16::from(row[column]),
            Samples::Sixteen(row) => row[column],
        }
    };
    let sum: u64 = views.iter().map(|view| u64::from(sample(view))).sum();
    let most = views.iter().map(sample).max();
    (
        sum as f64 / views.len().max(1) as f64,
        most.unwrap_or_default(),
    )
}

/// The median; of an even number of values the mean of the two in the middle, `None` without
/// values.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.len() / 2;
    let middle = values.get(upper.saturating_sub(1 - values.len() % 2)..=upper)?;
    Some(middle.iter().sum::<f64>() / middle.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cause(modulation: f64, offset: Option<f64>, saturated: f64) -> Option<Cause> {
        let light = Light {
            modulation,
            offset,
            saturated,
        };
        light.cause()
    }

    #[test]
    fn light_that_is_low_blurred_or_too_bright_is_told_apart() {
        assert_eq!(cause(0.9, Some(0.9), 0.0), None);
        // A lamp at 15 %, without and with some foreign light.
        for offset in [0.2, 0.25, 0.35] {
            let dark = cause(0.15, Some(offset), 0.0);
            assert_eq!(dark, Some(Cause::Dark(0.15)), "{offset}");
        }
        // Without the mean of golden's samples nothing but the light is known.
        assert_eq!(cause(0.15, None, 0.0), Some(Cause::Dark(0.15)));
        assert_eq!(cause(0.2, Some(1.0), 0.0), Some(Cause::Blurred(0.2)));
        // Foreign light on a blurred pattern.
        assert_eq!(cause(0.2, Some(1.6), 0.0), Some(Cause::Blurred(0.2)));
        assert_eq!(cause(0.01, Some(0.05), 0.0), Some(Cause::Nothing));
        let of = |foreign| {
            let share = 0.3;
            Some(Cause::Saturated { share, foreign })
        };
        assert_eq!(cause(0.7, Some(1.8), 0.3), of(true));
        assert_eq!(cause(1.9, Some(1.9), 0.3), of(false));
    }
}
