//! The law of propagation of uncertainty, by numeric derivatives (JCGM 100:2008, 5.1.3 note 2, with
//! 5.2.2 for covariances).
//!
//! ```text
//! σ² = Σ gᵀ C g        gᵢ = [f(qᵢ + uᵢ) − f(qᵢ − uᵢ)] / 2uᵢ        uᵢ = √Cᵢᵢ
//! ```
//!
//! Where the function has a kink within ± its step, as an angle has at 0, the two halves of the
//! difference have different signs and would cancel; the derivative is then the larger of both.

/// Least step of a difference, in mm, and in mm per mm: much more than rounding.
const LEAST_STEP: f64 = 1e-7;

/// How a value depends on quantities that are uncertain together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dependence<const N: usize> {
    /// g: by how much the value grows with each of them.
    pub gradient: [f64; N],
    /// σ² of the value by them.
    pub variance: f64,
}

impl<const N: usize> Dependence<N> {
    /// On quantities with this covariance: `changed` is the value where one of them, by its number,
    /// is larger by so much, and `here` the value where none is.
    pub fn new(here: f64, covariance: &[[f64; N]; N], changed: impl Fn(usize, f64) -> f64) -> Self {
        let gradient: [f64; N] = core::array::from_fn(|i| {
            let sigma = libm::sqrt(covariance[i][i].max(0.0));
            derivative(here, sigma, |by| changed(i, by))
        });
        let row = |row: &[f64; N]| row.iter().zip(gradient).map(|(c, g)| c * g).sum::<f64>();
        let terms = covariance.iter().zip(gradient).map(|(c, g)| g * row(c));
        Self {
            gradient,
            variance: terms.sum::<f64>().max(0.0),
        }
    }
}

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
