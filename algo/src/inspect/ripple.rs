//! Ripple: what a periodic error leaves in means over squares.
//!
//! **Idea.** An imperfect response gives phases an error that depends on where in a fringe a pixel
//! lies, and on the sequence of shifts and levels. Where the same scene is measured by two
//! sequences their difference has that error, and noise. Two such differences have the same error
//! but not the same noise: so the mean of their product is the variance of the error alone.
//!
//! The error is not the same everywhere: where its period is near a whole number of pixels, a mean
//! over a square does not take it out. The largest value over the part counts.
//!
//! **Equation.** With ā and b̄ the means of both differences over the square of L × L pixels about
//! a pixel, and ⟨⟩ the mean over patches of 4 L × 4 L pixels,
//!
//! ```text
//! ripple = max √ max(0, ⟨ā b̄⟩ − 3/4 ⟨(ā − b̄)²⟩ / 2)
//! ```
//!
//! ⟨(ā − b̄)²⟩ / 2 is the variance of the noise of ā. A patch has 16 independent squares, so the
//! mean of the products of noises has an error of a fourth of that variance; three such errors are
//! subtracted.
//!
//! **Shapes and units.** Maps are row-major; the ripple has the unit of the maps.
//!
//! **Accuracy.** Noise alone gives 0: `what_two_maps_have_in_common_is_found_below_their_noise`.

use super::gauge::MIN_SUPPORT;
use super::table::IntegralTable;
use crate::pipeline::map_rows;

/// Sides of a patch and of a square.
const PATCH: usize = 4;
/// Three errors of the mean product in a patch, over twice the variance of the noise.
const NOISE: f64 = 3.0 / PATCH as f64 / 2.0;
/// A patch has squares about at least this share of its pixels.
const FILLED: f64 = 0.5;

/// Rows that are looked at together: as many as keep their tables of sums small.
const BAND: usize = 128;

/// What the means of two maps over squares of `side` pixels have in common, RMS over the patch
/// where that is largest, in frames of `width` columns with so many `pixels`. `values` gives the
/// values of a pixel in both maps; pixels without values are left out, and so are squares and
/// patches with too few pixels. 0 if there is no patch.
pub fn ripple(
    (width, pixels): (usize, usize),
    side: usize,
    values: impl Fn(usize) -> Option<[f64; 2]> + Sync,
) -> f64 {
    let width = width.max(1);
    let rows = pixels / width;
    let patch = PATCH * side;
    let reach = patch / 2 + side / 2;
    let squares = map_rows(rows.div_ceil(BAND), |band| {
        let inside = band * BAND..rows.min((band + 1) * BAND);
        // The rows that patches about those inside reach.
        let first = inside.start.saturating_sub(reach);
        let (start, end) = (first * width, rows.min(inside.end + reach) * width);
        let place = |at: usize| (at / width, at % width);
        let values = |at: usize| values(start + at);
        let sums = IntegralTable::new(width, end - start, |at| {
            values(at).map(|[a, b]| [1.0, a, b])
        });
        let products = IntegralTable::new(width, end - start, |at| {
            let (row, column) = place(at);
            values(at)?;
            let [count, a, b] = sums.square(row, column, side);
            let enough = count >= MIN_SUPPORT * (side * side) as f64;
            let (a, b) = (a / count, b / count);
            enough.then_some([1.0, a * b - NOISE * (a - b) * (a - b)])
        });
        let least = FILLED * (patch * patch) as f64;
        let mean = |at: usize| {
            let (row, column) = place(at);
            let [count, product] = products.square(row, column, patch);
            (count >= least).then(|| product / count)
        };
        let inside = (inside.start - first) * width..(inside.end - first) * width;
        inside.filter_map(mean).fold(0.0, f64::max)
    });
    libm::sqrt(squares.into_iter().fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};
    use std::vec::Vec;

    #[test]
    fn what_two_maps_have_in_common_is_found_below_their_noise() {
        const WIDTH: usize = 200;
        const SIDE: usize = 9;
        const WAVES: usize = 100;
        let mut random = SplitMix64::seed_from_u64(3);
        // Uniform noise of σ = 1.
        let mut noise = || {
            let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            (2.0 * share - 1.0) * libm::sqrt(3.0)
        };
        let noises: Vec<[f64; 2]> = (0..WIDTH * WIDTH).map(|_| [noise(), noise()]).collect();
        // Only the left half has it.
        for size in [0.0, 0.5] {
            let wave = |at: usize| match at % WIDTH {
                column @ ..WAVES => size * libm::sin(core::f64::consts::TAU * column as f64 / 50.0),
                _ => 0.0,
            };
            let both = |at: usize| {
                let [a, b] = noises[at];
                // A seam without values.
                (at / WIDTH != 100).then(|| [a + wave(at), b + wave(at)])
            };
            let found = ripple((WIDTH, WIDTH * WIDTH), SIDE, both);
            let expected = size / core::f64::consts::SQRT_2;
            std::println!("{found} of {expected}");
            assert!(
                (found - expected).abs() <= 0.25 * expected,
                "{found} {expected}"
            );
        }
        assert_eq!(ripple((WIDTH, 0), SIDE, |_| None), 0.0);
    }
}
