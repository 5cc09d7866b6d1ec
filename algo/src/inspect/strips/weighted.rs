//! Stage 4, accumulate: weights of deviations. Few pixels have one that is not 1; tiles tell quickly where.

use super::Taught;
use crate::pipeline::NO_OFFSET;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::RangeInclusive;

/// The tiles of a frame that hold such weights.
#[derive(Debug)]
pub(super) struct WeightedTiles {
    width: usize,
    /// Whether some pixel of each tile of [`TILE`]² pixels has a weight that is not 1, row-major.
    tiles: Vec<bool>,
}

/// Side of a tile in pixels; pixels of a row that are looked at together.
const TILE: usize = 32;

impl WeightedTiles {
    /// Of a frame of `width` columns; none if every compared pixel counts in full.
    pub fn new(width: usize, taught: &Taught) -> Option<Self> {
        let weights = taught.weights();
        let across = width.div_ceil(TILE);
        let rows = weights.len() / width.max(1);
        let mut tiles = vec![false; across * rows.div_ceil(TILE)];
        for (place, weight) in weights.iter().enumerate() {
            tiles[place / width / TILE * across + place % width / TILE] |= weight.partial();
        }
        (!weights.is_empty()).then_some(Self { width, tiles })
    }

    /// Multiplies deviations along a row by the weights at their taught coordinates.
    pub fn apply(&self, taught: &Taught, columns: &[i32], rows: &[i32], deviations: &mut [i32]) {
        let blocks = columns.chunks(TILE).zip(rows.chunks(TILE));
        for ((columns, rows), deviations) in blocks.zip(deviations.chunks_mut(TILE)) {
            if !self.any(range(columns), range(rows)) {
                continue;
            }
            for ((deviation, &column), &row) in deviations.iter_mut().zip(columns).zip(rows) {
                if *deviation != NO_OFFSET {
                    let weight = taught.weight(row as usize * self.width + column as usize);
                    *deviation = weight.apply(i64::from(*deviation)) as i32;
                }
            }
        }
    }

    /// Whether a tile between these columns and rows has a weight that is not 1.
    fn any(&self, columns: RangeInclusive<i32>, rows: RangeInclusive<i32>) -> bool {
        let across = self.width.div_ceil(TILE);
        // Coordinates of pixels without a deviation may lie outside of the frame.
        let tile = |pixel: i32, tiles: usize| (pixel.max(0) as usize / TILE).min(tiles - 1);
        let down = self.tiles.len() / across;
        (tile(*rows.start(), down)..=tile(*rows.end(), down)).any(|row| {
            let first = row * across + tile(*columns.start(), across);
            let last = row * across + tile(*columns.end(), across);
            self.tiles[first..=last].contains(&true)
        })
    }
}

/// The least and the largest.
fn range(values: &[i32]) -> RangeInclusive<i32> {
    let (mut least, mut most) = (i32::MAX, i32::MIN);
    for &value in values {
        least = if value < least { value } else { least };
        most = if value > most { value } else { most };
    }
    least..=most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::Weight;

    #[test]
    fn only_deviations_at_weighted_pixels_change_wherever_they_were_found() {
        const WIDTH: usize = 100;
        const ROWS: usize = 70;
        let mut weights = vec![Weight::FULL; WIDTH * ROWS];
        weights[WIDTH * ROWS - 1] = Weight::from_bits(128);
        weights[33 * WIDTH + 64] = Weight::from_bits(64);
        let taught = Taught::new(weights.into_iter().map(|weight| (weight, 0.1)));
        let tiles = WeightedTiles::new(WIDTH, &taught).unwrap();
        for (shift, row) in [(0, 33), (-3, 33), (40, 33), (1, 69), (500, 0), (-500, 69)] {
            let columns: Vec<i32> = (0..WIDTH as i32).map(|u| u + shift).collect();
            let inside = |column: i32| (0..WIDTH as i32).contains(&column);
            let before: Vec<i32> = columns
                .iter()
                .map(|&c| if inside(c) { 1000 } else { NO_OFFSET })
                .collect();
            let mut after = before.clone();
            tiles.apply(&taught, &columns, &[row; WIDTH], &mut after);
            for ((&column, before), after) in columns.iter().zip(before).zip(after) {
                let expected = match (column, row) {
                    (64, 33) => 250,
                    (99, 69) => 500,
                    _ => before,
                };
                assert_eq!(after, expected, "{column} {row}");
            }
        }
    }
}
