//! What a pixel tells of a contour: its light, demodulated by the phase that the plane has there.
//!
//! # Idea
//! w = Z e^{−2πi r Φ̂}: light from the plane is real and positive, light from elsewhere has another
//! phase, and light that is not projected has no Z. Material is in phase in every level, so levels
//! are added once per pixel, with weights N r over their sum: N is for the noise, r for coarse
//! fringes, in which a floor hardly differs from the sheet.

use super::complex::Complex;
use super::view::{Fringes, Setup, Spot, View};
use alloc::vec::Vec;

/// A view with what is known of its light.
#[derive(Clone, Debug)]
pub struct Signals<'a, V> {
    /// The camera.
    pub view: &'a V,
    /// Light, material and camera.
    pub setup: &'a Setup,
    /// The weight of each level, 1 together.
    weights: Vec<f64>,
    /// The levels' mean ratio.
    pub ratio: f64,
    /// Variance of each part of the sum of levels, counts².
    pub variance: f64,
}

impl<'a, V: View> Signals<'a, V> {
    /// Of this view.
    pub fn new(view: &'a V, setup: &'a Setup) -> Self {
        let weight = |of: &Fringes| of.shifts as f64 * of.ratio;
        let whole: f64 = setup.levels.iter().map(weight).sum();
        let weights: Vec<f64> = setup.levels.iter().map(|of| weight(of) / whole).collect();
        let mut signals = Self {
            view,
            setup,
            weights,
            ratio: 0.0,
            variance: 0.0,
        };
        signals.variance = signals.mean(|of| weight(of) / whole * of.variance(setup.noise));
        signals.ratio = signals.mean(|of| of.ratio);
        signals
    }

    /// The weighted mean of something of levels.
    pub fn mean(&self, of: impl Fn(&Fringes) -> f64) -> f64 {
        let levels = self.weights.iter().zip(&self.setup.levels);
        levels.map(|(weight, level)| weight * of(level)).sum()
    }

    /// The weighted mean of what levels of these ratios have, each times a factor of its own.
    pub fn sum(&self, factors: &[f64], of: impl Fn(f64) -> Complex) -> Complex {
        let levels = self.weights.iter().zip(&self.setup.levels).zip(factors);
        levels.fold(Complex::default(), |sum, ((weight, level), factor)| {
            sum + of(level.ratio) * (weight * factor)
        })
    }

    /// The sum of levels of a pixel that looks at this spot, and the same with each times its share
    /// of the mean ratio; `None` if one is overexposed.
    pub fn light(&self, at: (usize, usize), spot: &Spot) -> Option<[Complex; 2]> {
        let mut sums = [Complex::default(); 2];
        for (level, weight) in self.weights.iter().enumerate() {
            let light = self.level(at, spot, level)? * *weight;
            sums[0] += light;
            sums[1] += light * (self.setup.levels[level].ratio / self.ratio);
        }
        Some(sums)
    }

    /// w of one level of such a pixel.
    pub fn level(&self, (u, v): (usize, usize), spot: &Spot, level: usize) -> Option<Complex> {
        let back = Complex::turned(-self.setup.levels[level].ratio * spot.phase);
        Some(self.view.signal(u, v, level)? * back)
    }
}
