//! Numeric pieces that several rooms need: ranges of columns, the normal density and
//! roots in a bracket here; complex
//! numbers, rounding to whole numbers, least squares, and the propagation of uncertainty in files of
//! their own.

pub mod complex;
pub(crate) mod nearest;
pub(crate) mod propagate;
pub mod solve;

use core::ops::Range;

/// The columns (or rows) within `reach` of one column, in a frame of `end` columns.
pub(crate) fn around(column: usize, reach: usize, end: usize) -> Range<usize> {
    column.saturating_sub(reach)..(column + reach + 1).min(end)
}

/// The intersection of two; it may be empty.
#[inline]
pub(crate) fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// From the first to the last of either.
#[inline]
pub(crate) fn hull(a: Range<usize>, b: Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b,
        (_, true) => a,
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

/// φ, the density of the standard normal distribution.
pub(crate) fn normal_density(x: f64) -> f64 {
    libm::exp(-x * x / 2.0) / libm::sqrt(2.0 * core::f64::consts::PI)
}

/// A root of `f` between `a` and `b`, where f(a) = `fa` and f(b) = `fb` have opposite signs (or one
/// is zero), to `tolerance` in the argument. `None` as soon as `f` returns `None`.
///
/// Regula falsi with Anderson and Björck's weights (1973). Every third step is a bisection if the
/// two before it have not halved the bracket, so three evaluations halve it at least once: at most
/// about 3 log₂(|b − a| / tolerance) evaluations, typically 6. After 200 it returns the best point
/// so far. `f` is never evaluated outside of the bracket.
pub(crate) fn bracketed(
    f: impl Fn(f64) -> Option<f64>,
    (mut a, mut fa): (f64, f64),
    (mut b, mut fb): (f64, f64),
    tolerance: f64,
) -> Option<f64> {
    if fa == 0.0 {
        return Some(a);
    }
    let mut width = libm::fabs(b - a);
    for step in 1..=200 {
        if fb == 0.0 || libm::fabs(b - a) <= tolerance {
            return Some(b);
        }
        let bisect = step % 3 == 0 && libm::fabs(b - a) > 0.5 * width;
        if step % 3 == 0 {
            width = libm::fabs(b - a) * if bisect { 0.5 } else { 1.0 };
        }
        let mut c = if bisect {
            0.5 * (a + b)
        } else {
            b - fb * (b - a) / (fb - fa)
        };
        // A point closer than half the tolerance to an end would hardly shrink the bracket: move it
        // away from that end, so that it may fall beyond the root. Signed as b − a.
        let least = 0.5 * tolerance * if b > a { 1.0 } else { -1.0 };
        if libm::fabs(c - b) < libm::fabs(least) {
            c = b - least;
        } else if libm::fabs(c - a) < libm::fabs(least) {
            c = a + least;
        }
        let fc = f(c)?;
        if fc * fb < 0.0 {
            (a, fa) = (b, fb);
        } else {
            // The end `a` stays: its value is weighted down, so that the next point lies nearer to
            // it.
            let weight = 1.0 - fc / fb;
            fa *= if weight > 0.0 { weight } else { 0.5 };
        }
        (b, fb) = (c, fc);
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::Cell;

    const TOLERANCE: f64 = 1e-9;

    fn solve(f: impl Fn(f64) -> f64, a: f64, b: f64) -> (f64, u32) {
        let calls = Cell::new(0);
        let counted = |x| {
            calls.set(calls.get() + 1);
            Some(f(x))
        };
        let root = bracketed(counted, (a, f(a)), (b, f(b)), TOLERANCE).unwrap();
        (root, calls.get())
    }

    #[test]
    fn roots_are_found_inside_the_bracket_within_the_tolerance() {
        for (f, root) in [
            (
                (|x| x * x * x - 2.0) as fn(f64) -> f64,
                1.259_921_049_894_873,
            ),
            (|x| libm::exp(x) - 5.0, 1.609_437_912_434_100_3),
            (|x| libm::atan(1e3 * (x - 0.123_456)), 0.123_456),
            (|x| if x < 0.7 { -1e-6 } else { 1.0 }, 0.7),
        ] {
            for (a, b) in [(-3.0, 5.0), (5.0, -3.0)] {
                let (found, calls) = solve(f, a, b);
                assert!((found - root).abs() <= TOLERANCE, "{found} for {root}");
                // Three evaluations for each of log₂(8 / TOLERANCE) = 33 halvings.
                assert!(calls <= 3 * 33, "{calls} evaluations");
            }
        }
    }

    #[test]
    fn a_smooth_function_takes_few_evaluations() {
        // As a phase over the height, for a head 600 mm above the plane and a range of ± 115 mm.
        let (_, calls) = solve(|x| x / (600.0 - x) - 0.05, -115.0, 115.0);
        assert!(calls <= 8, "{calls}");
    }
}
