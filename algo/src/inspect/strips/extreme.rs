//! The square with the largest mean deviation, found from sums down the columns.

use super::columns::COUNT_BIT;
use crate::inspect::deviation::MIN_SUPPORT;
use crate::pipeline::NO_RISE;
use core::ops::Range;

/// A square and the deviations in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extreme {
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

/// Whether sums over squares of `side` pixels of deviations up to `span_nm` fit beside their count.
pub(super) fn fits(side: usize, span_nm: f64) -> bool {
    let pixels = ((side | 1) * (side | 1)) as f64;
    // A signed sum of 44 bits; a count of 19 bits.
    pixels * span_nm < f64::from(1_u32 << 31) * 4096.0 && pixels < 524_288.0
}

/// Least number of deviations in a square that counts.
pub(super) fn least_support(side: usize) -> i64 {
    libm::ceil(MIN_SUPPORT * (side * side) as f64) as i64
}

/// Looks at the squares around the known pixels of a span of row `row`; `sums` are the packed sums down the columns, with
/// half a side of padding in front. Of equals the last counts.
pub(super) fn search(
    best: &mut Option<Extreme>,
    sums: &[i64],
    centres: &[i32],
    side: usize,
    row: usize,
    span: Range<usize>,
) {
    let reach = side / 2 * 2;
    let least = least_support(side);
    let mut floor = floor_of(*best, least);
    let mut packed = sums[span.start..span.start + reach].iter().sum::<i64>();
    let entering = &sums[span.start + reach..span.end + reach];
    let leaving = &sums[span.clone()];
    for (offset, (enters, leaves)) in entering.iter().zip(leaving).enumerate() {
        packed += enters;
        let sum = (packed << (64 - COUNT_BIT)) >> (64 - COUNT_BIT);
        if sum.abs() >= floor {
            let column = span.start + offset;
            let found = Extreme {
                sum,
                count: (packed - sum) >> COUNT_BIT,
                row,
                column,
            };
            let counts = found.count >= least && centres[column] != NO_RISE;
            if counts && best.is_none_or(|best| found.reaches(&best)) {
                *best = Some(found);
                floor = floor_of(*best, least);
            }
        }
        packed -= leaves;
    }
}

/// No sum below this reaches the best: it has at least the least support.
fn floor_of(best: Option<Extreme>, least: i64) -> i64 {
    // Rounded down, so nothing that could reach it is left out.
    best.map_or(0, |best| best.sum.abs() * least / best.count)
}
