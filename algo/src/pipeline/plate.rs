//! A reference phase map, measured on a flat plate in the plane z = 0.
//!
//! Φ_R^V and Φ_R^H (Peng & Gupta 2008, eqs. 10–11) give the projector point that lights each camera
//! pixel's point of the plane: ξ = pitch · Φ_R^V, η = pitch · Φ_R^H. The measured phases are noisy,
//! so their difference from the phases that the models predict is fitted by a polynomial of degree
//! 6, which has a hundredth of the noise.

use super::PhaseMap;
use crate::geometry::{FittedMap, ReferenceError, fit_map};
use crate::trust::Trust;
use alloc::vec;
use alloc::vec::Vec;

/// Pixels whose residual to the first fit is more than this many times its RMS (dust, scratches)
/// are left out of the second.
const OUTLIER: f64 = 4.0;
/// Least share of the frame that the plate must fill: beyond the plate the fit extrapolates.
const LEAST_FILLED: f64 = 0.6;
/// Side of the squares over which residuals are averaged, so that noise averages out and the lack
/// of fit remains, pixels.
const SQUARE: usize = 16;

/// One reference phase map.
#[derive(Clone, Debug)]
pub struct Plate {
    /// Φ_R less the predicted phase, turns.
    pub correction: FittedMap,
    /// RMS of the pixels about the fit, turns: noise.
    pub noise_turns: f64,
    /// Estimated RMS error of the fit, turns: its lack of fit, and the noise of its coefficients.
    pub residual_turns: f64,
    /// Share of the frame with samples.
    pub filled: f64,
}

/// Phases that cannot be those of a plate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlateError {
    /// Too little of the frame is resolved.
    #[error(
        "{:.0} % of the frame shows fringes: put a flat, bright, matt plate into the plane z = 0 that fills it",
        filled * 100.0
    )]
    Small {
        /// The share that is resolved.
        filled: f64,
    },
    /// The resolved pixels do not determine the fit.
    #[error("{0}")]
    Fit(ReferenceError),
}

impl Plate {
    /// Fits the phases of a plate; `predicted` are those of the models at a camera pixel, turns, or
    /// `None` where it does not look at the plane.
    ///
    /// # Errors
    /// If too little of the frame is resolved, or the resolved pixels do not determine the fit.
    pub fn fit(
        phases: &PhaseMap,
        predicted: impl Fn(f64, f64) -> Option<f64>,
    ) -> Result<Self, PlateError> {
        let width = phases.width.max(1);
        let height = phases.phase.len() / width;
        let resolved: Vec<(f64, f64, f64)> = phases
            .phase
            .iter()
            .zip(&phases.trust)
            .enumerate()
            .filter(|(_, (_, trust))| **trust == Trust::Resolved)
            .filter_map(|(at, (phase, _))| {
                let (u, v) = ((at % width) as f64, (at / width) as f64);
                Some((u, v, phase.turns() - predicted(u, v)?))
            })
            .collect();
        let filled = resolved.len() as f64 / phases.phase.len().max(1) as f64;
        if filled < LEAST_FILLED {
            return Err(PlateError::Small { filled });
        }
        let first = fit_map(width, height, resolved.iter().copied()).map_err(PlateError::Fit)?;
        let limit = OUTLIER * first.residual();
        let near = |&&(u, v, turns): &&(f64, f64, f64)| libm::fabs(first.at(u, v) - turns) <= limit;
        let kept: Vec<_> = resolved.iter().filter(near).copied().collect();
        let correction = fit_map(width, height, kept.iter().copied()).map_err(PlateError::Fit)?;
        let noise_turns = correction.residual();
        let lack = lack_of_fit(&correction, &kept, width, height);
        // 28 coefficients, each with 1/N of the noise's variance.
        let left = noise_turns * libm::sqrt(28.0 / kept.len() as f64);
        Ok(Self {
            correction,
            noise_turns,
            residual_turns: libm::hypot(lack, left),
            filled,
        })
    }
}

/// Lack of fit, RMS: the mean square of the squares' mean residuals, less the contribution of
/// noise.
fn lack_of_fit(fit: &FittedMap, samples: &[(f64, f64, f64)], width: usize, height: usize) -> f64 {
    let across = width.div_ceil(SQUARE);
    let mut squares = vec![(0.0, 0.0, 0.0); across * height.div_ceil(SQUARE)];
    for &(u, v, turns) in samples {
        let off = turns - fit.at(u, v);
        // u and v are whole numbers inside the frame.
        let square = &mut squares[v as usize / SQUARE * across + u as usize / SQUARE];
        *square = (square.0 + 1.0, square.1 + off, square.2 + off * off);
    }
    let (mut pixels, mut beyond) = (0.0, 0.0);
    for (n, sum, sum_of_squares) in squares {
        if n >= 16.0 {
            let mean = sum / n;
            let variance = (sum_of_squares / n - mean * mean) * n / (n - 1.0);
            pixels += n;
            beyond += n * (mean * mean - variance / n);
        }
    }
    if pixels > 0.0 {
        libm::sqrt((beyond / pixels).max(0.0))
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::AbsolutePhase;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};
    use std::string::ToString;

    const SIDE: usize = 96;
    /// Half width of the uniform noise, turns.
    const NOISE: f64 = 0.01;

    fn turns(u: f64, v: f64) -> f64 {
        3.0 + 0.1 * u + 0.02 * v + 1e-4 * u * v
    }

    /// A noisy plate whose first rows are not resolved.
    fn plate(unresolved_rows: usize) -> PhaseMap {
        let mut random = SplitMix64::seed_from_u64(3);
        let mut phases = PhaseMap::new(SIDE, SIDE);
        for at in unresolved_rows * SIDE..SIDE * SIDE {
            let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            let noise = NOISE * (2.0 * share - 1.0);
            let true_turns = turns((at % SIDE) as f64, (at / SIDE) as f64);
            phases.phase[at] = AbsolutePhase::from_turns(true_turns + noise);
            phases.trust[at] = Trust::Resolved;
        }
        phases
    }

    #[test]
    fn the_fit_follows_the_plate_and_tells_noise_from_lack_of_fit() {
        let mut phases = plate(4);
        // A scratch is left out.
        for at in 50 * SIDE + 20..50 * SIDE + 60 {
            phases.phase[at] = AbsolutePhase::from_turns(0.0);
        }
        // The models say nothing of the last column, and are off the plate by all that is not
        // linear.
        let predicted = |u: f64, v: f64| {
            let seen = u < (SIDE - 1) as f64;
            seen.then_some(3.0 + 0.1 * u + 0.02 * v)
        };
        let plate = Plate::fit(&phases, predicted).unwrap();
        assert!((plate.filled - 92.0 * 95.0 / (96.0 * 96.0)).abs() < 1e-12);
        let sigma = NOISE / libm::sqrt(3.0);
        assert!((plate.noise_turns / sigma - 1.0).abs() < 0.05, "{plate:?}");
        assert!(plate.residual_turns < 0.2 * sigma, "{plate:?}");
        let off = |(u, v): (f64, f64)| {
            let corrected = predicted(u, v).unwrap() + plate.correction.at(u, v);
            libm::fabs(corrected - turns(u, v))
        };
        let worst = [(0.0, 0.0), (48.0, 50.0), (94.0, 95.0)]
            .map(off)
            .into_iter()
            .fold(0.0, f64::max);
        assert!(worst < sigma, "{worst}");
    }

    #[test]
    fn a_plate_that_fills_little_of_the_frame_is_refused_with_its_share() {
        let error = Plate::fit(&plate(48), |_, _| Some(0.0)).unwrap_err();
        assert_eq!(error, PlateError::Small { filled: 0.5 });
        assert!(error.to_string().starts_with("50 % of the frame"));
    }
}
