//! Mean and sum of squares of values, as offsets from the first of them.
//!
//! ```text
//! x̄ = Σ x/n        SS = Σ (x − x̄)² − (Σ (x − x̄))²/n        s² = SS / (n − 1)
//! ```
//!
//! in two passes (Chan, Golub and LeVeque 1983, equation 1.7). Offsets are differences in decimal, so that values with
//! 13 equal leading digits keep what distinguishes them.

use super::decimal::Decimal;

/// How values lie about a number that is not part of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// How many.
    pub n: usize,
    /// Mean; 0 of none.
    pub mean: f64,
    /// Sum of the squared distances from the mean.
    pub squares: f64,
}

impl Spread {
    /// Of these offsets.
    pub fn of(offsets: &[f64]) -> Self {
        let n = offsets.len() as f64;
        let mean = |about: f64| offsets.iter().map(|x| x - about).sum::<f64>() / n.max(1.0);
        let first = mean(0.0);
        let mean = first + mean(first);
        let sum: f64 = offsets.iter().map(|x| x - mean).sum();
        let squares: f64 = offsets.iter().map(|x| (x - mean) * (x - mean)).sum();
        let squares = squares - sum * sum / n.max(1.0);
        let largest = offsets.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        Self {
            n: offsets.len(),
            mean,
            squares: more_than_rounding(squares, offsets.len(), largest),
        }
    }

    /// Degrees of freedom.
    pub fn df(&self) -> f64 {
        self.n as f64 - 1.0
    }

    /// Standard deviation; none of fewer than two values.
    pub fn s(&self) -> Option<f64> {
        defined((self.squares / self.df()).sqrt()).filter(|_| self.n > 1)
    }
}

/// A sum of n squares; 0 where roundings of numbers of this size explain it.
pub fn more_than_rounding(squares: f64, n: usize, largest: f64) -> f64 {
    let rounding = 8.0 * f64::EPSILON * largest;
    if squares > n as f64 * rounding * rounding {
        squares
    } else {
        0.0
    }
}

/// The values as offsets from the first of them, and that.
pub fn offsets(values: impl Iterator<Item = Decimal> + Clone) -> (Decimal, Vec<f64>) {
    let first = values.clone().next().unwrap_or_default();
    (first, values.map(|value| value.minus(first)).collect())
}

/// A figure that can be formed: none if it is not finite, as after a division by zero.
pub fn defined(figure: f64) -> Option<f64> {
    figure.is_finite().then_some(figure)
}
