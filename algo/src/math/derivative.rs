//! Numeric derivatives over a standard uncertainty.
//!
//! Where the function has a kink within ± its step, as an angle has at 0, the two halves of the
//! difference have different signs and would cancel; the derivative is then the larger of both.

/// Least step of a difference, in mm, and in mm per mm: much more than rounding.
const LEAST_STEP: f64 = 1e-7;

/// The derivative of a function about 0, where it has the value `here`, over a step of this size.
pub(crate) fn derivative(here: f64, step: f64, f: impl Fn(f64) -> f64) -> f64 {
    let step = step.max(LEAST_STEP);
    let (up, down) = (f(step) - here, here - f(-step));
    let both = match up * down < 0.0 {
        true if libm::fabs(up) > libm::fabs(down) => 2.0 * up,
        true => 2.0 * down,
        false => up + down,
    };
    both / (2.0 * step)
}
