//! The square of largest mean deviation, exactly, from packed sums down the columns.

use crate::inspect::gauge::MIN_SUPPORT;
use crate::pipeline::NO_OFFSET;
use core::ops::Range;

/// A packed sum holds the number of its terms above this bit, and their sum below it.
pub const COUNT_BIT: u32 = 44;

/// A square and the deviations in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extreme {
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

    /// Becomes the largest if it reaches that: of equal ones the last counts.
    pub fn raise(self, largest: &mut Option<Self>) {
        if largest.is_none_or(|largest| self.reaches(&largest)) {
            *largest = Some(self);
        }
    }
}

/// Whether packed sums hold squares of `side` pixels with deviations of up to `span_nm`.
pub fn fits(side: usize, span_nm: f64) -> bool {
    let side = (side | 1) as f64;
    let pixels = side * side;
    // A signed sum of 44 bits; a count of 19 bits.
    pixels * span_nm < f64::from(1_u32 << 31) * 4096.0 && pixels < 524_288.0
}

/// Least number of deviations in a square that counts.
pub fn least_support(side: usize) -> i64 {
    libm::ceil(MIN_SUPPORT * (side * side) as f64) as i64
}

/// The squares around the pixels of one row.
pub struct SquareRow<'a> {
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
    /// Searches the squares around the compared pixels of a span for the largest mean, of equal ones
    /// the last, and for the largest sum.
    pub fn search(&self, [largest, strongest]: [&mut Option<Extreme>; 2], span: Range<usize>) {
        let least = least_support(self.side);
        let mut floor = floor_of(*largest, least);
        let mut most = strength(*strongest) + 1;
        let mut found: Option<Extreme> = None;
        for square in self.squares(span) {
            let sum = square.sum.abs();
            if sum >= floor.min(most) && self.centres[square.column] != NO_OFFSET {
                if square.count >= least {
                    square.raise(largest);
                }
                floor = floor_of(*largest, least);
                if sum >= most {
                    most = sum;
                    found = Some(square);
                }
            }
        }
        *strongest = found.filter(|found| found.count >= least).or(*strongest);
    }

    /// The squares around the pixels of a span.
    fn squares(&self, span: Range<usize>) -> impl Iterator<Item = Extreme> {
        let reach = self.side / 2 * 2;
        let mut packed = self.sums[span.start..span.start + reach]
            .iter()
            .sum::<i64>();
        let entering = &self.sums[span.start + reach..span.end + reach];
        let leaving = &self.sums[span.clone()];
        let columns = span.zip(entering.iter().zip(leaving));
        columns.map(move |(column, (enters, leaves))| {
            let square = self.unpack(packed + enters, column);
            packed += enters - leaves;
            square
        })
    }

    fn unpack(&self, packed: i64, column: usize) -> Extreme {
        let sum = (packed << (64 - COUNT_BIT)) >> (64 - COUNT_BIT);
        Extreme {
            sum,
            count: (packed - sum) >> COUNT_BIT,
            row: self.row,
            column,
        }
    }
}

/// |sum| of a square; 0 without one.
pub fn strength(square: Option<Extreme>) -> i64 {
    square.map_or(0, |square| square.sum.abs())
}

/// A sum of at least `least` deviations whose magnitude is below this does not reach the best mean.
fn floor_of(best: Option<Extreme>, least: i64) -> i64 {
    // Rounded down, so that a sum of just that mean still reaches it.
    best.map_or(0, |best| best.sum.abs() * least / best.count)
}
