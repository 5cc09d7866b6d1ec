//! The square of largest mean deviation, exactly, from packed sums down the columns.

use super::COUNT_BIT;
use crate::inspect::gauge::MIN_SUPPORT;
use crate::pipeline::NO_OFFSET;
use core::ops::Range;

/// A square and the deviations in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Extreme {
    /// Σ of the deviations in nm.
    pub sum: i64,
    /// How many there are.
    pub count: i64,
    /// The centre's row.
    pub row: usize,
    /// The centre's column.
    pub column: usize,
}

impl Extreme {
    /// Whether |mean| is at least that of another: both products stay below 2⁶³, see [`fits`].
    pub fn reaches(&self, other: &Self) -> bool {
        self.sum.abs() * other.count >= other.sum.abs() * self.count
    }
}

/// Whether packed sums hold squares of `side` pixels with deviations of up to `span_nm`.
pub(in super::super) fn fits(side: usize, span_nm: f64) -> bool {
    let side = (side | 1) as f64;
    let pixels = side * side;
    // A signed sum of 44 bits; a count of 19 bits.
    pixels * span_nm < f64::from(1_u32 << 31) * 4096.0 && pixels < 524_288.0
}

/// Least number of deviations in a square that counts.
pub(in super::super) fn least_support(side: usize) -> i64 {
    libm::ceil(MIN_SUPPORT * (side * side) as f64) as i64
}

/// The squares around the pixels of one row.
pub(in super::super) struct SquareRow<'a> {
    /// Packed sums down the columns, with half a side of padding in front.
    pub sums: &'a [i64],
    /// Deviations of the row itself.
    pub centres: &'a [i32],
    /// Side of the squares.
    pub side: usize,
    /// The row.
    pub row: usize,
}

impl SquareRow<'_> {
    /// Searches the squares around the compared pixels of a span. Of equal ones the last counts.
    pub fn search(&self, best: &mut Option<Extreme>, span: Range<usize>) {
        let reach = self.side / 2 * 2;
        let least = least_support(self.side);
        let mut floor = floor_of(*best, least);
        let mut packed = self.sums[span.start..span.start + reach]
            .iter()
            .sum::<i64>();
        let entering = &self.sums[span.start + reach..span.end + reach];
        let leaving = &self.sums[span.clone()];
        for (offset, (enters, leaves)) in entering.iter().zip(leaving).enumerate() {
            packed += enters;
            let sum = (packed << (64 - COUNT_BIT)) >> (64 - COUNT_BIT);
            if sum.abs() >= floor {
                let column = span.start + offset;
                let found = Extreme {
                    sum,
                    count: (packed - sum) >> COUNT_BIT,
                    row: self.row,
                    column,
                };
                let counts = found.count >= least && self.centres[column] != NO_OFFSET;
                if counts && best.is_none_or(|best| found.reaches(&best)) {
                    *best = Some(found);
                    floor = floor_of(*best, least);
                }
            }
            packed -= leaves;
        }
    }
}

/// A sum of at least `least` deviations whose magnitude is below this does not reach the best mean.
pub(in super::super) fn floor_of(best: Option<Extreme>, least: i64) -> i64 {
    // Rounded down, so that a sum of just that mean still reaches it.
    best.map_or(0, |best| best.sum.abs() * least / best.count)
}
