//! The squares that come near the largest deviation: where several do, noise decides which of them
//! is found, and the reading scatters less than any of them.

use super::extreme::{Extreme, strength};
use crate::math::common;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// How many squares are returned at most. More lower the scatter of the largest hardly any further.
const RIVALS: usize = 8;
/// Least rows of a tile; else as many as a square has.
const LEAST_ROWS: usize = 8;
/// Columns of a tile.
const COLUMNS: usize = 64;

/// The square of largest mean deviation, and that of the largest sum in each tile of the frame.
#[derive(Clone, Debug, Default)]
pub struct Extremes {
    side: usize,
    /// The first row of tiles, and how many there are.
    bands: Range<usize>,
    /// Tiles of a band.
    columns: usize,
    tiles: Vec<Option<Extreme>>,
    largest: Option<Extreme>,
}

impl Extremes {
    /// Of squares of `side` pixels about those of some rows of so many columns.
    pub fn new(side: usize, rows: &Range<usize>, width: usize) -> Self {
        let band = side.max(LEAST_ROWS);
        let bands = rows.start / band..rows.end.div_ceil(band);
        let columns = width.div_ceil(COLUMNS);
        Self {
            side,
            columns,
            tiles: vec![None; bands.len() * columns],
            bands,
            largest: None,
        }
    }

    /// Bytes of its tiles.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.tiles)
    }

    pub fn clear(&mut self) {
        self.tiles.fill(None);
        self.largest = None;
    }

    /// Looks for larger ones about the pixels of a span of a row, tile by tile: `search` gets the
    /// largest and the tile's.
    pub fn update(
        &mut self,
        row: usize,
        span: &Range<usize>,
        mut search: impl FnMut([&mut Option<Extreme>; 2], Range<usize>),
    ) {
        let band = row / self.side.max(LEAST_ROWS) - self.bands.start;
        for column in span.start / COLUMNS..span.end.div_ceil(COLUMNS) {
            let tile = &mut self.tiles[band * self.columns + column];
            let columns = column * COLUMNS..(column + 1) * COLUMNS;
            search([&mut self.largest, tile], common(span, &columns));
        }
    }

    /// Takes the tiles that it shares with the strip above.
    pub fn join(&mut self, above: &mut Self) {
        if self.bands.start < above.bands.end {
            let shared = above.tiles.len() - self.columns;
            for (tile, above) in self.tiles.iter_mut().zip(&mut above.tiles[shared..]) {
                let above = above.take();
                if strength(above) >= strength(*tile) {
                    *tile = above;
                }
            }
        }
    }
}

/// The largest of strips that are joined, and the largest of other tiles that share no pixel with a
/// larger one: those with at least half of its deviation, in falling order.
pub fn rivals<'a>(
    strips: impl Iterator<Item = &'a Extremes> + Clone,
) -> heapless::Vec<Extreme, RIVALS> {
    let mut rivals = heapless::Vec::<Extreme, RIVALS>::new();
    let mut next = None;
    let largest = strips.clone().filter_map(|strip| strip.largest);
    largest.for_each(|found| found.raise(&mut next));
    let least = next.map(half);
    while let Some(rival) = next {
        if rivals.push(rival).is_err() {
            break;
        }
        next = None;
        for strip in strips.clone() {
            let apart = |a: &Extreme, b: &Extreme| {
                a.row.abs_diff(b.row).max(a.column.abs_diff(b.column)) >= strip.side
            };
            let tiles = strip.tiles.iter().flatten();
            tiles
                .filter(|tile| least.is_none_or(|least| tile.reaches(&least)))
                .filter(|tile| rivals.iter().all(|rival| apart(rival, tile)))
                .for_each(|tile| tile.raise(&mut next));
        }
    }
    rivals
}

/// Half the deviation.
fn half(whole: Extreme) -> Extreme {
    let sum = whole.sum / 2;
    Extreme { sum, ..whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(row: usize, column: usize, sum: i64) -> Extreme {
        Extreme {
            sum,
            count: 50,
            row,
            column,
        }
    }

    /// The rivals of these squares, by strips that end before the rows `cuts`.
    fn found(squares: &[Extreme], cuts: &[usize]) -> Vec<(usize, usize)> {
        let mut strips = Vec::new();
        let mut top = 0;
        for &bottom in cuts.iter().chain(&[90]) {
            let mut strip = Extremes::new(9, &(top..bottom), 200);
            for row in top..bottom {
                strip.update(row, &(3..190), |[largest, strongest], span| {
                    let here = |found: &&Extreme| found.row == row && span.contains(&found.column);
                    for found in squares.iter().filter(here) {
                        found.raise(largest);
                        if strength(Some(*found)) > strength(*strongest) {
                            *strongest = Some(*found);
                        }
                    }
                });
            }
            strips.push(strip);
            top = bottom;
        }
        for below in 1..strips.len() {
            let (above, below) = strips.split_at_mut(below);
            below[0].join(above.last_mut().unwrap());
        }
        let rivals = rivals(strips.iter());
        strips.iter_mut().for_each(Extremes::clear);
        assert!(super::rivals(strips.iter()).is_empty());
        rivals
            .iter()
            .map(|rival| (rival.row, rival.column))
            .collect()
    }

    #[test]
    fn rivals_share_no_pixel_and_do_not_depend_on_strips() {
        let squares = [
            square(3, 70, 900),
            // One tile: the lesser one is not kept.
            square(20, 10, -1500),
            square(22, 60, 1400),
            // Another tile.
            square(22, 64, 1300),
            square(40, 40, 2000),
            // Shares pixels with the largest.
            square(46, 44, 1900),
            square(60, 40, 1200),
            // Half of the largest, and below.
            square(70, 5, -1000),
            square(80, 5, 999),
        ];
        let expected = [(40, 40), (20, 10), (22, 64), (60, 40), (70, 5)];
        for cuts in [&[][..], &[41], &[21, 22, 45, 61], &[1, 40, 79, 80, 81]] {
            assert_eq!(found(&squares, cuts), expected, "{cuts:?}");
        }
    }
}
