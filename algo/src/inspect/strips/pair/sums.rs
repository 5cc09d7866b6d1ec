//! The sums over a window: what the fit multiplies of each pixel of a row, the sums of these products
//! down the columns, which slide from row to row, and the noise of means over windows that share
//! pixels.
//!
//! Along each axis the mean over a square is a box of [`SIDE`] pixels averaged by one of the
//! square's side, with pixels that are independent of each other.
//!
//! Accuracy: `means_over_squares_scatter_as_their_shared_pixels_make_them`.

use crate::simd::{Backend, Lanes, back_end_entry};
use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// The window's side in pixels.
pub const SIDE: usize = 7;
pub const REACH: usize = SIDE / 2;
/// Pixels of a window.
pub const PIXELS: f64 = (SIDE * SIDE) as f64;
/// By so many bits the terms of pixels are smaller where golden is not compared: beside the others
/// they hardly count.
pub const FAINT: u8 = 3;

/// A row as the fit needs it. Whole blocks of pixels; those behind the row are 0, and nothing is
/// expected there.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    pub phase: Vec<AbsolutePhase>,
    pub compared: Vec<bool>,
    /// (I₁ + I₂) / 2 in the unit of the sums, less than 0 where a sample is at full scale.
    pub light: Vec<f32>,
    /// s, c and d in 12 bits.
    pub s: Vec<i16>,
    pub c: Vec<i16>,
    pub d: Vec<i16>,
}

impl Terms {
    pub fn clear(&mut self, pixels: usize) {
        refill(&mut self.phase, pixels, AbsolutePhase::UNKNOWN);
        refill(&mut self.compared, pixels, false);
        refill(&mut self.light, pixels, 0.0);
        for list in [&mut self.s, &mut self.c, &mut self.d] {
            refill(list, pixels, 0);
        }
    }
}

pub fn refill<T: Copy>(list: &mut Vec<T>, length: usize, value: T) {
    list.clear();
    list.resize(length, value);
}

/// Pixels that are solved together.
pub const BLOCK: usize = 64;
/// Columns of their windows.
pub const WIDE: usize = BLOCK + 2 * REACH;
/// Σs², Σsc, Σc², Σds, Σdc, Σd².
pub const SUMS: usize = 6;

/// The sums over the rows of a window, per column; [`REACH`] columns of 0 on both sides.
#[derive(Clone, Debug, Default)]
pub struct Columns([Vec<i32>; SUMS]);

impl Columns {
    /// Begins with no rows of so many pixels.
    pub fn clear(&mut self, pixels: usize) {
        for sums in &mut self.0 {
            sums.clear();
            sums.resize(pixels + 2 * REACH, 0);
        }
    }

    /// Adds a row, and takes one off.
    pub fn slide(&mut self, backend: Backend, entering: &Terms, leaving: &Terms) {
        let (a, b) = (entering, leaving);
        let [ss, sc, cc, ds, dc, dd] = &mut self.0;
        let slide = |sums: &mut [i32], new: [&[i16]; 2], old: [&[i16]; 2]| {
            let sums = &mut sums[REACH..REACH + new[0].len()];
            slide_products(backend, new, old, sums);
        };
        slide(ss, [&a.s, &a.s], [&b.s, &b.s]);
        slide(sc, [&a.s, &a.c], [&b.s, &b.c]);
        slide(cc, [&a.c, &a.c], [&b.c, &b.c]);
        slide(ds, [&a.d, &a.s], [&b.d, &b.s]);
        slide(dc, [&a.d, &a.c], [&b.d, &b.c]);
        slide(dd, [&a.d, &a.d], [&b.d, &b.d]);
    }

    /// The columns of the windows around the pixels of the block that begins at `start`.
    pub fn of_windows(&self, start: usize) -> [&[i32]; SUMS] {
        self.0.each_ref().map(|sums| &sums[start..start + WIDE])
    }
}

back_end_entry! {
    /// Adds the products of two lists of terms to sums, and takes off those of two others.
    fn slide_products [] = slide_row(new: [&[i16]; 2], old: [&[i16]; 2], sums: &mut [i32])
}

#[inline(always)]
fn slide_row<V: Lanes>(_: V, new: [&[i16]; 2], old: [&[i16]; 2], sums: &mut [i32]) {
    let length = sums.len();
    let [a, b] = [&new[0][..length], &new[1][..length]];
    let [c, d] = [&old[0][..length], &old[1][..length]];
    for i in 0..length {
        let (enters, leaves) = (
            i32::from(a[i]) * i32::from(b[i]),
            i32::from(c[i]) * i32::from(d[i]),
        );
        sums[i] += enters - leaves;
    }
}

/// The sums over windows, from those of their columns.
#[inline(always)]
pub fn sum_up(columns: &[i32], windows: &mut [i32; BLOCK]) {
    let columns = &columns[..WIDE];
    for i in 0..BLOCK {
        let mut sum = columns[i];
        for j in 1..SIDE {
            sum += columns[i + j];
        }
        windows[i] = sum;
    }
}

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
