//! Stage 5, gauge: the reading of a deviation, the square with the largest mean.
//!
//! Height differences are multiplied by the factors w of their pixels: the share along golden's
//! normal times the weight. The mean over n pixels has, with σ_p the noise of a pixel's height and
//! C the covariance of the motion that was taken back,
//!
//! ```text
//! σ² = Σ w² σ_p² / n² + gᵀ C g        g = Σ w j / n
//! ```
//!
//! The deviation is the largest of many such means, so its own error is that of an extreme
//! ([`largest`](crate::inspect::largest)): of noise, and of all squares that come near the one that
//! was found. The motion's error differs from place to place, so each of these has its own. j is
//! the Jacobian of a pixel's height over the motion
//! ([`Facet::jacobian`](crate::inspect::align::Facet::jacobian)); it changes little over a square,
//! so its mean over some pixels is taken.

use super::uncertainty::{ErrorBudget, Taken};
use crate::inspect::align::{Placed, form};
use crate::inspect::gauge::{Reading, Square};
use crate::inspect::largest::Largest;
use crate::inspect::strips::accumulate::squares::extreme::Extreme;

/// Pixels of a square whose Jacobians are averaged, in each direction.
const SAMPLES: usize = 4;

/// Sums over the pixels of a square, from which the error of its mean follows.
#[derive(Clone, Copy, Debug, Default)]
pub struct SquareNoise {
    /// Every so many columns and rows a pixel's Jacobian is taken.
    stride: usize,
    /// Σ w² σ_p², mm².
    variance: f64,
    /// Σ w.
    factors: f64,
    /// Σ j, and how many.
    jacobian: [f64; 6],
    sampled: f64,
}

impl SquareNoise {
    /// Of a square of `side` pixels.
    pub fn new(side: usize) -> Self {
        Self {
            stride: (side / SAMPLES).max(1),
            ..Self::default()
        }
    }

    /// Whether the Jacobian of this pixel is taken.
    pub fn is_sampled(&self, u: usize, v: usize) -> bool {
        u.is_multiple_of(self.stride) && v.is_multiple_of(self.stride)
    }

    /// Adds a pixel: its factor, σ_p in mm and, of a sampled one, its Jacobian.
    pub fn add(&mut self, factor: f64, sigma: f64, jacobian: Option<[f64; 6]>) {
        self.variance += factor * factor * sigma * sigma;
        self.factors += factor;
        if let Some(jacobian) = jacobian {
            self.sampled += 1.0;
            for (sum, value) in self.jacobian.iter_mut().zip(jacobian) {
                *sum += value;
            }
        }
    }

    /// The variances of the mean over `count` pixels, mm²: by the pixels' noise and by the motion;
    /// and its lever, by which an error of all heights changes it.
    fn variances(&self, count: f64, placed: Option<&Placed>) -> (f64, f64, f64) {
        // Beside an edge no pixel may have a facet: the surface is then taken to be flat.
        let mean = match self.sampled > 0.0 {
            true => self.jacobian.map(|sum| sum / self.sampled),
            false => [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        };
        let lever = self.factors / count;
        let g = mean.map(|value| value * lever);
        let motion = placed.map_or(0.0, |placed| form(&g, &placed.covariance, &g).max(0.0));
        (self.variance / (count * count), motion, lever)
    }
}

impl ErrorBudget {
    /// The reading of the first of the squares of `side` pixels that were found, in falling order;
    /// none if there is none. The noise of the squares is asked for here, for these few alone.
    pub fn deviation(
        &self,
        (found, side): (&[Extreme], usize),
        mut noise_of: impl FnMut(&Extreme) -> SquareNoise,
        placed: Option<&Placed>,
        (gauge, taken): (usize, Taken),
    ) -> Option<Reading> {
        let best = found.first()?;
        let smoothed = self.square_variance(side);
        let mut variances = found.iter().map(|square| {
            let (pixels, motion, lever) = noise_of(square).variances(square.count as f64, placed);
            (pixels * smoothed, motion, lever)
        });
        let (pixels, motion, lever) = variances.next()?;
        let others = found[1..].iter().zip(variances);
        let others =
            others.map(|(square, (pixels, motion, _))| [magnitude(square), pixels + motion]);
        // What good parts read: golden's noise and that of this measurement.
        let golden = self.golden_variance(taken.noisier) / smoothed;
        let largest = self.largest.get(gauge).copied().unwrap_or_default();
        let largest = largest.times(libm::sqrt(1.0 + 1.0 / golden));
        let largest = self.of_displaced(largest, gauge, placed);
        let extreme = largest.uncertain([magnitude(best), pixels + motion], others);
        let sigma = libm::sqrt(extreme.variance + (1.0 - extreme.defect) * motion);
        // The extreme of noise scatters with golden's noise, too; that of a defect is shifted by it.
        let golden = libm::sqrt(
            golden * (extreme.defect * pixels + motion * smoothed / self.spot_variance()),
        );
        let wrong = libm::hypot(self.displaced(placed), self.rippled(taken) * lever);
        let systematic = libm::hypot(golden, wrong);
        Some(Reading {
            value: best.sum as f64 / best.count as f64 / 1e6,
            sigma: (sigma > 0.0).then_some(sigma),
            expected: Some(largest.mean).filter(|mean| *mean > 0.0),
            systematic,
            compared: systematic,
            rims: 0.0,
            square: Some(Square {
                column: best.column,
                row: best.row,
                side,
            }),
        })
    }

    /// What good parts read that lie so, where noise alone would make this: golden is interpolated
    /// between pixels, which a part that is displaced by a pixel shows in full.
    fn of_displaced(&self, noise: Largest, gauge: usize, placed: Option<&Placed>) -> Largest {
        let displaced = self.displaced.get(gauge).copied().flatten();
        let (Some(displaced), Some(placed)) = (displaced, placed) else {
            return noise;
        };
        let share = (placed.reach / self.pixel_mm.max(f64::MIN_POSITIVE)).min(1.0);
        let between = |noise: f64, displaced: f64| noise + share * (displaced - noise).max(0.0);
        Largest {
            mean: between(noise.mean, displaced.mean),
            scatter: between(noise.scatter, displaced.scatter),
        }
    }
}

/// |mean| of a square, mm.
fn magnitude(square: &Extreme) -> f64 {
    square.sum.abs() as f64 / square.count as f64 / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;

    #[test]
    fn noise_falls_with_the_pixels_of_a_square_and_the_error_of_the_motion_does_not() {
        let mut covariance = [[0.0; 6]; 6];
        covariance[2][2] = 0.02 * 0.02;
        let placed = Placed::lying(Vector::default(), covariance);
        let mut noise = SquareNoise::new(8);
        for at in 0..64 {
            // On a slope a shift along z by 1 mm lifts what a pixel sees by 2 mm.
            let lift = noise.is_sampled(at % 8, at / 8);
            noise.add(0.5, 0.1, lift.then_some([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]));
        }
        assert_eq!(noise.sampled, 16.0);
        let (pixels, motion, lever) = noise.variances(64.0, Some(&placed));
        assert_eq!(lever, 0.5);
        assert!((libm::sqrt(pixels) - 0.5 * 0.1 / 8.0).abs() < 1e-12);
        assert!((libm::sqrt(motion) - 0.5 * 2.0 * 0.02).abs() < 1e-12);
        assert_eq!(noise.variances(64.0, None).1, 0.0);
    }
}
