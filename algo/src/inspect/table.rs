//! An integral table: sums over any square of a map in constant time (F. C. Crow, 1984).

use super::gauge::MIN_SUPPORT;
use alloc::vec;
use alloc::vec::Vec;

/// Sums of N values over the pixels above and left of each corner of a map's pixels.
#[derive(Clone, Debug)]
pub(super) struct IntegralTable<const N: usize> {
    width: usize,
    rows: usize,
    /// Row-major, (width + 1) × (rows + 1).
    sums: Vec<[f64; N]>,
}

impl<const N: usize> IntegralTable<N> {
    /// The table of a row-major map of `pixels` pixels in rows of `width`; pixels without values
    /// add nothing.
    pub fn new(width: usize, pixels: usize, values: impl Fn(usize) -> Option<[f64; N]>) -> Self {
        let rows = pixels / width.max(1);
        let stride = width + 1;
        let mut sums = vec![[0.0; N]; stride * (rows + 1)];
        for row in 0..rows {
            let mut sum = [0.0; N];
            for column in 0..width {
                if let Some(values) = values(row * width + column) {
                    for (sum, value) in sum.iter_mut().zip(values) {
                        *sum += value;
                    }
                }
                let mut here = sums[row * stride + column + 1];
                for (here, sum) in here.iter_mut().zip(sum) {
                    *here += sum;
                }
                sums[(row + 1) * stride + column + 1] = here;
            }
        }
        Self { width, rows, sums }
    }

    /// Sums over the square of `side` pixels about a pixel, as far as it lies inside the map.
    pub fn square(&self, row: usize, column: usize, side: usize) -> [f64; N] {
        let (stride, half) = (self.width + 1, side / 2);
        let (top, bottom) = (row.saturating_sub(half), (row + half + 1).min(self.rows));
        let (left, right) = (
            column.saturating_sub(half),
            (column + half + 1).min(self.width),
        );
        let at = |row: usize, column: usize| &self.sums[row * stride + column];
        let mut sums = *at(bottom, right);
        let others = (at(top, left), at(bottom, left), at(top, right));
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = *sum + others.0[i] - others.1[i] - others.2[i];
        }
        sums
    }

    /// The same of the pixel at `place`, over their first value, the number of its compared pixels;
    /// `None` where less than half of the square is compared.
    pub fn means(&self, place: usize, side: usize) -> Option<[f64; N]> {
        let sums = self.square(place / self.width, place % self.width, side);
        (sums[0] >= MIN_SUPPORT * (side * side) as f64).then(|| sums.map(|sum| sum / sums[0]))
    }
}
