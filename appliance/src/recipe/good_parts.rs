//! What the deviation gauge reads on good parts by prediction, and the limit that follows.
//!
//! The limit is the tolerance that is asked for, as far as the part can be measured that well. Places whose squares are too noisy
//! for it are left out of the comparison, and teaching says how many; where they would be more than a small share of the surface,
//! the limit is wider instead, and teaching says that the tolerance cannot be held.

use super::golden::SMOOTHING_PX;
use super::planner::SIGMAS;
use crate::station::Unit;
use algo::geometry::Triangulator;
use algo::inspect::Taught;
use algo::inspect::align::GoldenSurface;
use algo::inspect::good::{DeviationNoise, LargestDeviation, motion_variance};
use algo::pipeline::KnownSurface;
use hal::bounds::within;
use serde::{Deserialize, Serialize};

/// At most this share of the compared surface is left out; else the limit is wider.
const LEFT_OUT: f64 = 0.05;
/// At most this share of good parts exceeds the limit, by prediction.
const BEYOND: f64 = 1e-6;
/// Limits that are not asked for are rounded up to this, mm, tried in steps by this factor, and at most so many times the tolerance.
const STEP_MM: f64 = 0.01;
const WIDER: f64 = 1.1;
const WIDEST: f64 = 20.0;

/// The deviation of good parts, as predicted when the part was taught.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoodPartsFile {
    /// The tolerance that was asked for, ± mm.
    pub tolerance_mm: f64,
    /// The limit that was set, ± mm.
    pub limit_mm: f64,
    /// The largest deviation of a good part that lies as taught: mean and standard deviation over parts and goldens, mm.
    pub largest_mm: f64,
    /// See above.
    pub scatter_mm: f64,
    /// Share of such parts that exceed the limit.
    pub beyond: f64,
    /// Share of the surface that is too noisy for the limit, and so not compared.
    pub left_out: f64,
}

/// What is known of the noise of a taught part.
pub(super) struct Noise<'a> {
    /// The geometry with the part's phase function.
    pub triangulator: &'a Triangulator,
    /// Golden.
    pub surface: KnownSurface,
    /// σ_z² of golden's pixels and of those in production, mm².
    pub golden: Vec<f32>,
    /// See above.
    pub production: Vec<f32>,
}

impl Noise<'_> {
    /// The limit of the deviation for a tolerance. What cannot be held to it is taken out of the pixels that are compared, where
    /// `mask` is 1.
    pub fn hold(&self, mask: &mut [u8], tolerance_mm: f64) -> GoodPartsFile {
        let width = self.surface.width;
        let valid: Vec<bool> = mask.iter().map(|&valid| valid == 1).collect();
        let both = self.golden.iter().zip(&self.production);
        let pixel: Vec<f32> = both.map(|(a, b)| a + b).collect();
        let still = vec![0.0; valid.len()];
        let mut noise = DeviationNoise {
            width,
            pixel: &pixel,
            motion: &still,
        };
        // The motion is found from what is compared, and what is compared depends on the motion: once each.
        let (_, compared, _) = limited(&noise, &valid, tolerance_mm);
        let motion = self.motion(&compared);
        noise.motion = &motion;
        let (limit_mm, compared, sigmas) = limited(&noise, &valid, tolerance_mm);
        let largest = LargestDeviation::new(&sigmas, width, SMOOTHING_PX);
        let limit_mm = match largest.beyond(limit_mm) > BEYOND {
            true => rounded_up(largest.limit(BEYOND)),
            false => limit_mm,
        };
        let (largest_mm, scatter_mm) = largest.mean_and_scatter();
        let left_out = 1.0 - count(&compared) / count(&valid).max(1.0);
        for (valid, compared) in mask.iter_mut().zip(compared) {
            *valid = u8::from(compared);
        }
        GoodPartsFile {
            tolerance_mm,
            limit_mm,
            largest_mm,
            scatter_mm,
            beyond: largest.beyond(limit_mm),
            left_out,
        }
    }

    fn motion(&self, compared: &[bool]) -> Vec<f32> {
        let sigmas = self
            .golden
            .iter()
            .map(|variance| f64::from(*variance).sqrt());
        let taught = Taught::new(compared.iter().copied().zip(sigmas));
        let golden = GoldenSurface {
            triangulator: self.triangulator,
            surface: &self.surface,
            taught: &taught,
        };
        let width = self.surface.width;
        motion_variance(golden, &vec![0..width; compared.len() / width.max(1)])
    }
}

/// The limit, at least the tolerance, that all but [`LEFT_OUT`] of the surface can hold; what holds it; and σ of its squares.
fn limited(
    noise: &DeviationNoise<'_>,
    valid: &[bool],
    tolerance_mm: f64,
) -> (f64, Vec<bool>, Vec<f32>) {
    let least = (1.0 - LEFT_OUT) * count(valid);
    let mut limit = tolerance_mm;
    loop {
        let mut compared = valid.to_vec();
        let sigmas = noise.leave_out(&mut compared, SMOOTHING_PX, limit / SIGMAS);
        if count(&compared) >= least || limit > WIDEST * tolerance_mm {
            return (limit, compared, sigmas);
        }
        limit = rounded_up(limit * WIDER);
    }
}

fn count(mask: &[bool]) -> f64 {
    mask.iter().filter(|on| **on).count() as f64
}

fn rounded_up(mm: f64) -> f64 {
    // A whole number of hundredths reads as such.
    (mm / STEP_MM).ceil() / (1.0 / STEP_MM).round()
}

impl GoodPartsFile {
    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(super) fn check_bounds(&self) -> Result<(), String> {
        let [_, longest] = Unit::Length.range();
        within("tolerance_mm", self.tolerance_mm, 0.0, longest)?;
        within("limit_mm", self.limit_mm, 0.0, longest)?;
        within("largest_mm", self.largest_mm, 0.0, longest)?;
        within("scatter_mm", self.scatter_mm, 0.0, longest)?;
        within("beyond", self.beyond, 0.0, 1.0)?;
        within("left_out", self.left_out, 0.0, 1.0)
    }

    /// What is held, in words: a line, and a second one where something is not.
    pub fn words(&self) -> Vec<String> {
        let Self {
            tolerance_mm,
            limit_mm,
            largest_mm,
            scatter_mm,
            beyond,
            left_out,
        } = *self;
        if largest_mm == 0.0 {
            return vec![
                "no place of the surface is seen well enough to be compared: more light, less noise or another pose".into(),
            ];
        }
        let expected = format!(
            "good parts deviate by up to {largest_mm:.3} ± {scatter_mm:.3} mm, {} exceeds ±{limit_mm:.2} mm",
            one_in(beyond)
        );
        let mut lines = vec![match limit_mm > tolerance_mm {
            true => format!(
                "the deviation of ±{tolerance_mm:.2} mm that is asked for cannot be held: {expected}, which is the \
                 limit; more light, less noise or another pose narrows it"
            ),
            false => format!("deviation: {expected}"),
        }];
        if left_out > 0.0 {
            lines.push(format!(
                "{:.2} % of the surface is seen too faintly or too flatly for a limit of ±{limit_mm:.2} mm and is not \
                 compared: another pose brings it back",
                left_out * 100.0
            ));
        }
        lines
    }
}

/// "one in 3.0e6".
fn one_in(share: f64) -> String {
    match share > 1e-12 {
        true => format!("one in {:.1e}", 1.0 / share),
        false => "less than one in 1e12".into(),
    }
}
