//! The normal equations of the least-squares fit of a motion, with robust weights.
//!
//! The six unknowns are shifts along x, y, z and turns about x, y, z, all in mm (a turn as the way of a point at the part's radius).

use super::directions::Matrix6;
use super::equations::Equations;
use crate::simd::Backend;

/// Residual from which Huber's weights fall, in σ.
const HUBER: f64 = 1.345;
/// Residual from which Tukey's weights are 0, in σ.
pub(super) const TUKEY: f64 = 4.685;

/// The function that gives the weight of a point by its residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WeightFunction {
    Huber,
    Tukey,
}

impl WeightFunction {
    /// Huber's weight of a residual in σ.
    #[inline(always)]
    pub fn huber(residual: f64) -> f64 {
        let size = residual.abs();
        if size <= HUBER { 1.0 } else { HUBER / size }
    }

    /// Tukey's weight of a residual in σ.
    #[inline(always)]
    pub fn tukey(residual: f64) -> f64 {
        let size = residual.abs();
        let rest = 1.0 - (size / TUKEY) * (size / TUKEY);
        if size >= TUKEY { 0.0 } else { rest * rest }
    }
}

/// The normal equations: `matrix` times the unknowns is `right_side`.
pub(super) struct Normal {
    pub matrix: Matrix6,
    pub right_side: [f64; 6],
    /// The part of the matrix that the errors of the facets' lifts ([`Facet::lift`](super::surface::Facet::lift)) are expected to add.
    pub noise: Matrix6,
    /// σ of the residuals, mm.
    pub scale: f64,
    /// Points with a weight above 0.
    pub inside: usize,
}

impl Normal {
    /// The sums over points. Each point has the weight of its residual after a further motion, divided by σ of the residuals, which is at
    /// least `least`.
    pub fn of(
        equations: &mut Equations,
        backend: Backend,
        weights: WeightFunction,
        further: &[f64; 6],
        least: f64,
    ) -> Self {
        let scale = equations.weigh(backend, weights, further, least);
        let sums = equations.sums(backend);
        Self {
            matrix: sums.matrix(),
            right_side: sums.right_side(),
            noise: sums.lift_noise(),
            scale,
            inside: equations.inside(),
        }
    }
}
