//! Stage 5, gauge: from a value with the parts of its error to a reading.
//!
//! What changes from one measurement to the next is in σ; what is the same in each of them is
//! systematic, and both together make the uncertainty u = √(σ² + systematic²) (JCGM 100:2008,
//! 5.1.2). Systematic are:
//!
//! - the noise of golden, once, as a deviation from golden and through the motion, which is found
//!   against golden;
//! - the error of the calibration: of a value that is made of heights the σ of heights times the
//!   value's lever, that is, as if errors had the sign that does most everywhere; of one that is
//!   compared with golden, which the same head measured, only what a length as long as the part's
//!   displacement is wrong by;
//! - the periodic error of phases by an imperfect response, of RMS ρ
//!   ([`ripple`](crate::inspect::ripple)): a part that is displaced has it at other places of the
//!   fringes than golden, so its deviation has √2 ρ, and 2 u is the largest by which two sines
//!   differ. What is left of light that changed ([`flicker`](crate::flicker)) is such an error, too. ρ is that of the place where it is largest, and taken to have the sign that does most
//!   everywhere.

use crate::inspect::align::Placed;
use crate::inspect::gauge::{FoundValue, Reading};
use crate::inspect::largest::Largest;
use crate::inspect::strips::pair::{correlated, smoothed};
use alloc::vec::Vec;

/// σ by the error of the calibration; 0 where it is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CalibrationUncertainty {
    /// Of a height, mm.
    pub height: f64,
    /// Of a length, relative.
    pub length: f64,
}

/// A part whose noise is less than this share of that as taught was not measured at all.
const LEAST_NOISE: f64 = 0.01;

/// What the errors of readings are made of, besides the noise of the part that is measured.
#[derive(Debug)]
pub struct ErrorBudget {
    /// σ of golden's heights, as a multiple of the taught σ.
    pub golden_noise: f64,
    /// Per gauge, what a deviation is on good parts whose only noise is golden's, and on those that
    /// lie elsewhere than golden.
    pub largest: Vec<Largest>,
    pub displaced: Vec<Option<Largest>>,
    /// What a pixel in the middle of the frame sees, mm.
    pub pixel_mm: f64,
    pub calibration: CalibrationUncertainty,
    /// RMS of the periodic error of a mean height, mm.
    pub ripple: f64,
    /// Whether neighbouring phases share pixels: those of a pair.
    pub shared: bool,
    /// About how many pixels there are to each spot of the alignment.
    pub pixels_per_spot: f64,
}

/// How a part was measured.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// σ_z over that as taught.
    pub noisier: f64,
    /// RMS of the periodic error of heights that changes of light left, mm.
    pub unsteady: f64,
}

impl ErrorBudget {
    /// The reading of a value that is made of heights; of one that is made of deviations from golden
    /// `compared` is the systematic error as well. The variances of pixels were multiplied by
    /// `smoothed`.
    pub fn reading_of(
        &self,
        found: FoundValue,
        (taken, smoothed): (Taken, f64),
        placed: Option<&Placed>,
    ) -> Reading {
        let FoundValue {
            value,
            pixels,
            motion,
            lever,
            unknown,
        } = found;
        // Golden's pixels are independent of each other.
        let moved = motion / self.spot_variance();
        let systematic = |golden: f64, wrong: f64| {
            let golden = golden * self.golden_variance(taken.noisier);
            let wrong = libm::hypot(wrong, self.rippled(taken));
            libm::sqrt(golden + wrong * wrong * lever * lever + unknown * unknown)
        };
        let compared = systematic(pixels / smoothed + moved, self.displaced(placed));
        Reading {
            value,
            sigma: Some(libm::sqrt(pixels + motion)),
            systematic: systematic(moved, self.calibration.height),
            compared,
            ..Reading::default()
        }
    }

    /// Variance of golden's heights over that of the measured ones.
    pub fn golden_variance(&self, noisier: f64) -> f64 {
        let ratio = self.golden_noise / noisier.max(LEAST_NOISE);
        ratio * ratio
    }

    /// The variance of the mean over a square of `side` pixels, over that of the mean of as many
    /// independent pixels ([`smoothed`]): 1 but for a pair.
    pub fn square_variance(&self, side: usize) -> f64 {
        match self.shared {
            true => smoothed(side),
            false => 1.0,
        }
    }

    /// What neighbouring cells of `side` pixels add to the variance of a sum over the squares of
    /// all ([`correlated`]): 1 but for a pair.
    pub fn cells_together(&self, side: usize) -> f64 {
        match self.shared {
            true => correlated(side),
            false => 1.0,
        }
    }

    /// The variance of a spot of the alignment, over that of an independent pixel: 1 but for a
    /// pair, whose windows share pixels where the spots are dense.
    pub fn spot_variance(&self) -> f64 {
        let apart = self.pixels_per_spot.max(1.0);
        self.square_variance(1).max(1.0 / apart).min(1.0)
    }

    /// What the periodic errors of golden and of a displaced part make of a deviation, with what
    /// changes of light left in the part's, mm.
    pub fn rippled(&self, taken: Taken) -> f64 {
        libm::hypot(core::f64::consts::SQRT_2 * self.ripple, taken.unsteady)
    }

    /// By how much a length as long as the part's displacement is wrong, mm.
    pub fn displaced(&self, placed: Option<&Placed>) -> f64 {
        placed.map_or(0.0, |placed| placed.reach * self.calibration.length)
    }
}
