//! The noise of means over results of windows that share pixels.
//!
//! Along each axis the mean over a square is a box of [`SIDE`] pixels averaged by one of the
//! square's side, with pixels that are independent of each other.
//!
//! Accuracy: `means_over_squares_scatter_as_their_shared_pixels_make_them`.

use super::sums::SIDE;

/// The variance of the mean over a square of `side` pixels, over that of the mean of as many
/// independent pixels of two shifts.
pub fn smoothed(side: usize) -> f64 {
    let side = side.max(1);
    let along = shared(side, 0) * side as f64;
    along * along
}

/// By how much the means over neighbouring squares of `side` pixels that share pixels add to the
/// variance of a sum of their squares: Σ ρ² over all squares about one, with ρ the correlation of
/// two means.
pub fn correlated(side: usize) -> f64 {
    let side = side.max(1);
    let beside = (1..=SIDE.div_ceil(side)).map(|away| {
        let correlation = shared(side, away * side) / shared(side, 0);
        2.0 * correlation * correlation
    });
    let along = 1.0 + beside.sum::<f64>();
    along * along
}

/// Along an axis: the covariance of two means over `side` pixels, each the mean of a window, that
/// are `apart` pixels away from each other; pixels have variance 1.
fn shared(side: usize, apart: usize) -> f64 {
    // A box of one length, averaged by one of the other.
    let end = SIDE + side - 1;
    let weight = |at: usize| (at + 1).min(end - at).min(SIDE.min(side)) as f64;
    let products = (apart..end).map(|at| weight(at) * weight(at - apart));
    products.sum::<f64>() / ((SIDE * side) * (SIDE * side)) as f64
}
