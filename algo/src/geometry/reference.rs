//! The reference phase map Φ_R: the phase that the camera sees on the plane z = 0.
//!
//! For any phase function, Φ_R(u, v) = Φ_P(ξ, η) at the projector point that lights the plane where
//! the camera pixel looks (Peng & Gupta 2008, eqs. 10–11). That point comes from the device models,
//! or from two measured maps of the plane, ξ = Φ_R^V / c_V and η = Φ_R^H / c_H. Raw, their noise is
//! twice the measurement's, so what they are off the models is fitted smoothly: models that are
//! exact then leave nothing to fit, and beyond the frame, where nothing was measured, the
//! correction stays that of the frame's edge.

use crate::math::solve::Normal;

/// Degree of the fit.
const DEGREE: usize = 6;
/// Coefficients of a polynomial of total degree 6 in two variables.
pub const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;

/// How the projector point of a camera pixel on the reference plane is found.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one per rig")]
pub enum Reference {
    /// Computed from the two device models.
    Models,
    /// Computed from the models and corrected by what a plate in the plane z = 0 was off them under
    /// a vertical and a horizontal pattern.
    Measured {
        /// Measured ξ(u, v) less that of the models, projector columns.
        xi: FittedMap,
        /// Measured η(u, v) less that of the models, projector rows.
        eta: FittedMap,
    },
}

/// A smooth map over the camera's frame: a polynomial of degree 6. Beyond the frame it has the
/// values of the frame's edge.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedMap {
    coefficients: [f64; TERMS],
    /// Centre and half size of the frame, which the polynomial is scaled to.
    centre: (f64, f64),
    half: (f64, f64),
    residual: f64,
}

/// The samples do not determine a smooth map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{samples} samples do not determine the reference phase map: the plate must fill most of the \
     frame in both directions"
)]
pub struct ReferenceError {
    /// Samples that were given.
    pub samples: usize,
}

impl FittedMap {
    /// The map with these coefficients over a frame of `width` × `height` pixels. It has no
    /// samples, so its residual is 0.
    pub fn new(width: usize, height: usize, coefficients: [f64; TERMS]) -> Self {
        let half = (
            (width as f64 / 2.0).max(0.5),
            (height as f64 / 2.0).max(0.5),
        );
        Self {
            coefficients,
            centre: (half.0 - 0.5, half.1 - 0.5),
            half,
            residual: 0.0,
        }
    }

    /// The coefficients of the products T_i(x)·T_j(y), i + j ≤ 6, of Chebyshev polynomials, ordered
    /// by i and then by j; x and y run from -1 to 1 over the frame.
    pub fn coefficients(&self) -> &[f64; TERMS] {
        &self.coefficients
    }

    /// The value at pixel (u, v), also outside the frame.
    pub fn at(&self, u: f64, v: f64) -> f64 {
        let terms = self.terms(u, v);
        terms
            .iter()
            .zip(&self.coefficients)
            .map(|(t, c)| t * c)
            .sum()
    }

    /// RMS of the samples about the fit, in the samples' unit.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// The products that [`Self::coefficients`] belong to.
    fn terms(&self, u: f64, v: f64) -> [f64; TERMS] {
        let x = chebyshev(((u - self.centre.0) / self.half.0).clamp(-1.0, 1.0));
        let y = chebyshev(((v - self.centre.1) / self.half.1).clamp(-1.0, 1.0));
        let mut terms = [0.0; TERMS];
        let pairs = (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| (i, j)));
        for (term, (i, j)) in terms.iter_mut().zip(pairs) {
            *term = x[i] * y[j];
        }
        terms
    }
}

/// T₀(x) … T₆(x).
fn chebyshev(x: f64) -> [f64; DEGREE + 1] {
    let mut t = [1.0; DEGREE + 1];
    t[1] = x;
    for i in 2..=DEGREE {
        t[i] = 2.0 * x * t[i - 1] - t[i - 2];
    }
    t
}

/// Fits a smooth map to samples (u, v, value) in a frame of `width` × `height` pixels by least
/// squares.
///
/// # Errors
/// If the samples are too few or too badly spread to determine a polynomial of degree 6.
pub fn fit_map(
    width: usize,
    height: usize,
    samples: impl Iterator<Item = (f64, f64, f64)> + Clone,
) -> Result<FittedMap, ReferenceError> {
    let mut map = FittedMap::new(width, height, [0.0; TERMS]);
    let mut normal = Normal::default();
    let mut count = 0_usize;
    for (u, v, value) in samples.clone() {
        normal.add(&map.terms(u, v), value);
        count += 1;
    }
    let error = ReferenceError { samples: count };
    if count < 2 * TERMS {
        return Err(error);
    }
    map.coefficients = normal.solve().ok_or(error)?;
    let squares: f64 = samples
        .map(|(u, v, value)| {
            let off = map.at(u, v) - value;
            off * off
        })
        .sum();
    map.residual = libm::sqrt(squares / count as f64);
    if map.residual.is_finite() {
        Ok(map)
    } else {
        Err(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};
    use std::vec::Vec;

    #[test]
    fn the_fit_follows_the_map_and_drops_its_noise() {
        let truth =
            |u: f64, v: f64| 500.0 + 1.4 * u - 2e-4 * u * u + 1e-4 * u * v + 1e-7 * v * v * v;
        let mut random = SplitMix64::seed_from_u64(7);
        let samples: Vec<_> = (0..128 * 96)
            .map(|i| {
                let (u, v) = (f64::from(i % 128), f64::from(i / 128));
                let noise = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
                (u, v, truth(u, v) + noise)
            })
            .collect();
        let map = fit_map(128, 96, samples.iter().copied()).unwrap();
        // The noise is uniform over one unit: σ = 0.289; 28 of 12288 degrees of freedom remain.
        assert!((map.residual() - 0.2887).abs() < 0.01, "{}", map.residual());
        let squares: f64 = samples
            .iter()
            .map(|&(u, v, _)| (map.at(u, v) - truth(u, v)).powi(2))
            .sum();
        let rms = libm::sqrt(squares / samples.len() as f64);
        assert!(rms < 0.2887 * libm::sqrt(28.0 / 12_288.0) * 1.5, "{rms}");
    }

    #[test]
    fn samples_along_a_line_or_too_few_are_refused() {
        let line = (0..500).map(|i| (f64::from(i), 4.0, 1.0));
        assert_eq!(
            fit_map(512, 512, line),
            Err(ReferenceError { samples: 500 })
        );
        let few = (0..20).map(|i| (f64::from(i), f64::from(i * i % 7), 1.0));
        assert!(fit_map(512, 512, few).is_err());
    }
}
