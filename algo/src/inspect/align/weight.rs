//! Robust weights of residuals.

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
