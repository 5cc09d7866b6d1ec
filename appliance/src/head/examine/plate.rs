//! The two reference phase maps: a flat plate in the plane z = 0 under vertical and under horizontal fringes, fitted smoothly.
//!
//! Φ_R^V and Φ_R^H (Peng & Gupta 2008, eqs. 10–11) tell which projector point lights each camera pixel's point of the plane: ξ =
//! pitch · Φ_R^V, η = pitch · Φ_R^H. Raw they have the noise of a measurement; a polynomial of degree 6 has a hundredth of it.

use crate::head::calibration::Calibration;
use crate::head::scan::{self, Scan};
use algo::geometry::{FittedMap, fit_map};
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use hal::head::DynHead;
use std::time::Duration;

/// Levels, and shifts of each but the finest, whose many shifts make noise and harmonics small.
const LEVELS: usize = 3;
const SHIFTS: usize = 4;
const FINEST_SHIFTS: usize = 16;
/// What lies so many times the scatter off the fit is dust or a scratch, and left out of a second one.
const OUTLIER: f64 = 4.0;
/// The plate must fill this share of the frame: beyond it the fit would guess.
const LEAST_FILLED: f64 = 0.6;
/// Side of the squares over which noise is averaged, so that what is left tells how well the polynomial follows the plate.
const SQUARE: usize = 16;

/// One reference phase map.
#[derive(Clone, Debug)]
pub struct Plate {
    fit: FittedMap,
    /// Scatter of the pixels about the fit, turns: noise.
    pub noise_turns: f64,
    /// How far the fit is from the plate, RMS, turns: what squares of pixels are off on the mean beyond their noise, and what noise
    /// leaves in the coefficients.
    pub residual_turns: f64,
    /// Share of the frame that told it.
    pub filled: f64,
}

/// A plate that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlateError {
    /// A device failed.
    #[error(transparent)]
    Device(#[from] hal::error::Error),
    /// It is no flat plate, or the projector cannot show its patterns.
    #[error("measure the reference plane: {0}")]
    Unfit(String),
}

fn unfit(error: impl std::fmt::Display) -> PlateError {
    PlateError::Unfit(error.to_string())
}

impl Plate {
    /// Pitch of both patterns, projector pixels.
    pub const PITCH: f64 = 20.0;

    /// Measures the plate under vertical fringes, or under horizontal ones. The head's time is known already.
    ///
    /// # Errors
    /// Of a device, or if too little of the frame shows a plate.
    pub fn measure(
        head: &mut DynHead,
        calibration: &Calibration,
        vertical: bool,
        timeout: Duration,
    ) -> Result<Self, PlateError> {
        let (columns, rows) = head.projector_size();
        let (columns, rows) = (columns as usize, rows as usize);
        let function = if vertical {
            PhaseFunction::vertical(columns, rows, columns as f64 / Self::PITCH)
        } else {
            PhaseFunction::horizontal(columns, rows, rows as f64 / Self::PITCH)
        };
        let function = function.map_err(unfit)?;
        let mut shots = Sequence::geometric(function.range(), LEVELS, SHIFTS);
        shots.truncate((LEVELS - 1) * SHIFTS);
        shots.extend(Shot::level(1.0, FINEST_SHIFTS));
        let taken = scan::take(head, calibration, &function, &shots, timeout, &|_| ())?;
        let scan = Scan::new(function.range(), &shots, &taken).map_err(unfit)?;
        Self::fit(&scan.phases(None).map_err(unfit)?)
    }

    fn fit(phases: &PhaseMap) -> Result<Self, PlateError> {
        let width = phases.width.max(1);
        let height = phases.phase.len() / width;
        let resolved: Vec<(f64, f64, f64)> = phases
            .phase
            .iter()
            .zip(&phases.trust)
            .enumerate()
            .filter(|(_, (_, trust))| **trust == Trust::Resolved)
            .map(|(at, (phase, _))| ((at % width) as f64, (at / width) as f64, phase.turns()))
            .collect();
        let filled = resolved.len() as f64 / phases.phase.len().max(1) as f64;
        if filled < LEAST_FILLED {
            return Err(unfit(format!(
                "{:.0} % of the frame shows fringes: put a flat, bright, matt plate into the plane z = 0 that fills it",
                filled * 100.0
            )));
        }
        let first = fit_map(width, height, resolved.iter().copied()).map_err(unfit)?;
        let limit = OUTLIER * first.residual();
        let near = |&&(u, v, turns): &&(f64, f64, f64)| (first.at(u, v) - turns).abs() <= limit;
        let kept: Vec<_> = resolved.iter().filter(near).copied().collect();
        let fit = fit_map(width, height, kept.iter().copied()).map_err(unfit)?;
        let noise_turns = fit.residual();
        let lack = lack_of_fit(&fit, &kept, width, height);
        // Of 28 coefficients, each takes one part in N of the noise.
        let left = noise_turns * (28.0 / kept.len() as f64).sqrt();
        Ok(Self {
            fit,
            noise_turns,
            residual_turns: lack.hypot(left),
            filled,
        })
    }

    /// Φ_R at a camera pixel, turns.
    pub fn turns(&self, u: f64, v: f64) -> f64 {
        self.fit.at(u, v)
    }

    /// Φ_R of the whole frame, row-major, turns.
    pub fn map(&self, width: usize, height: usize) -> Vec<f64> {
        let places = (0..height).flat_map(|v| (0..width).map(move |u| (u as f64, v as f64)));
        places.map(|(u, v)| self.turns(u, v)).collect()
    }
}

/// What the fit is off the plate beyond noise, RMS: the variance of squares' means less what noise makes of it.
fn lack_of_fit(fit: &FittedMap, samples: &[(f64, f64, f64)], width: usize, height: usize) -> f64 {
    let across = width.div_ceil(SQUARE);
    let mut squares = vec![(0.0, 0.0, 0.0); across * height.div_ceil(SQUARE)];
    for &(u, v, turns) in samples {
        let off = turns - fit.at(u, v);
        // Pixels of the frame: whole numbers inside it.
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
        (beyond / pixels).max(0.0).sqrt()
    } else {
        0.0
    }
}
