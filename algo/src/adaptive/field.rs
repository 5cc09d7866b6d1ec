//! A field of values over a raster, usually fringe frequencies over the projector's: its filters,
//! and its integral, a phase function.

use crate::pipeline::{for_each_row, map_rows, over_squares};
use alloc::vec;
use alloc::vec::Vec;

/// Values over a raster, row-major; usually G(s, t), the frequency along ξ in turns per projector
/// pixel at row s, column t.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Columns.
    pub columns: usize,
    /// Values; NaN where not known.
    pub values: Vec<f64>,
}

impl Field {
    /// A field with the same value everywhere.
    pub fn uniform(columns: usize, rows: usize, value: f64) -> Self {
        Self {
            columns,
            values: vec![value; columns * rows],
        }
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    /// The cell of a projector point, if it lies on the raster.
    #[inline]
    pub fn cell(&self, [xi, eta]: [f64; 2]) -> Option<usize> {
        let (column, row) = (libm::rint(xi), libm::rint(eta));
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows() as f64;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Gaussian smoothing with σ in pixels along rows and along columns; edge values are repeated
    /// beyond the raster.
    pub fn smoothed(&self, [rows, columns]: [f64; 2]) -> Self {
        let rows = self.smoothed_rows(rows).transposed();
        rows.smoothed_rows(columns).transposed()
    }

    fn smoothed_rows(&self, sigma: f64) -> Self {
        let reach = libm::ceil(4.0 * sigma) as isize;
        let weights: Vec<f64> = (-reach..=reach)
            .map(|i| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma)))
            .collect();
        let sum: f64 = weights.iter().sum();
        let mut out = self.clone();
        for_each_row(&mut out.values, self.columns, |row, out| {
            let line = &self.values[row * self.columns..][..self.columns];
            let last = self.columns as isize - 1;
            let padded: Vec<f64> = (-reach..=last + reach)
                .map(|i| line[i.clamp(0, last) as usize])
                .collect();
            for (value, window) in out.iter_mut().zip(padded.windows(weights.len())) {
                let products = window.iter().zip(&weights).map(|(g, w)| g * w);
                *value = products.sum::<f64>() / sum;
            }
        });
        out
    }

    /// The smallest value within `reach` pixels along both axes.
    pub fn minimum(&self, reach: usize) -> Self {
        Self {
            columns: self.columns,
            values: over_squares(&self.values, self.columns, reach, f64::min),
        }
    }

    fn transposed(&self) -> Self {
        let (columns, rows) = (self.columns, self.rows());
        let value = |place: usize| self.values[place % rows * columns + place / rows];
        Self {
            columns: rows,
            values: (0..self.values.len()).map(value).collect(),
        }
    }

    /// Gives unknown cells the value of the nearest known cell within `reach` pixels (chessboard
    /// steps, the left and upper neighbour first).
    pub fn fill_near(&mut self, reach: usize) {
        let (columns, rows) = (self.columns, self.rows());
        for _ in 0..reach {
            let before = self.values.clone();
            let known = |row: isize, column: isize| {
                let inside =
                    row >= 0 && column >= 0 && row < rows as isize && column < columns as isize;
                let value = inside.then(|| before[row as usize * columns + column as usize])?;
                (!value.is_nan()).then_some(value)
            };
            for_each_row(&mut self.values, columns, |row, line| {
                for (column, value) in line.iter_mut().enumerate() {
                    if !value.is_nan() {
                        continue;
                    }
                    let (r, c) = (row as isize, column as isize);
                    let beside = [
                        (0, -1),
                        (-1, 0),
                        (0, 1),
                        (1, 0),
                        (-1, -1),
                        (-1, 1),
                        (1, -1),
                        (1, 1),
                    ];
                    let found = beside.iter().find_map(|(dr, dc)| known(r + dr, c + dc));
                    *value = found.unwrap_or(f64::NAN);
                }
            });
        }
    }

    /// Gives unknown cells the value of the nearest known row of their column.
    pub fn fill_columns(&mut self) {
        let (columns, rows) = (self.columns, self.rows());
        for column in 0..columns {
            let cell = |row: usize| row * columns + column;
            let known: Vec<usize> = (0..rows)
                .filter(|&row| !self.values[cell(row)].is_nan())
                .collect();
            let mut next = 0;
            for row in 0..rows {
                while next + 1 < known.len()
                    && known[next + 1].abs_diff(row) <= known[next].abs_diff(row)
                {
                    next += 1;
                }
                if let Some(&nearest) = known.get(next) {
                    self.values[cell(row)] = self.values[cell(nearest)];
                }
            }
        }
    }

    /// Fills unknown cells of each row by linear interpolation between known ones; beyond the
    /// outermost known cell its value is repeated. A row without known cells becomes `otherwise`.
    pub fn fill_rows(&mut self, otherwise: f64) {
        for_each_row(&mut self.values, self.columns, |_, line| {
            let mut before: Option<usize> = None;
            for column in 0..line.len() {
                if line[column].is_nan() {
                    continue;
                }
                let (start, from) = match before {
                    Some(known) => (known + 1, line[known]),
                    None => (0, line[column]),
                };
                let steps = (column + 1 - start) as f64;
                let rise = (line[column] - from) / steps;
                for (step, value) in line[start..column].iter_mut().enumerate() {
                    *value = from + rise * (step + 1) as f64;
                }
                before = Some(column);
            }
            let (start, value) = match before {
                Some(known) => (known + 1, line[known]),
                None => (0, otherwise),
            };
            line[start..].fill(value);
        });
    }
}

/// Φ(s, t) = Φ(s, t−1) + G(s, t−1) with a zero first column (Peng & Gupta 2008, eq. 8), in f64:
/// each column rounds by at most half a unit of the last place, 2⁻⁴⁰ turn up to 16,384 turns. Over
/// 10⁵ columns that is below 9.1e-8 turn, a tenth of a unit of Q20
/// (`integration_over_a_hundred_thousand_columns_is_the_exact_sum`).
pub(super) fn rows_from_zero(field: &Field) -> Vec<f64> {
    let mut turns = Vec::with_capacity(field.values.len());
    for row in field.values.chunks(field.columns.max(1)) {
        let mut sum = 0.0;
        for frequency in row {
            turns.push(sum);
            sum += frequency;
        }
    }
    turns
}

/// As [`rows_from_zero`], with each row shifted so that its mean difference to the row above is 0
/// over the cells that are `seen` in both. With a zero first column rows shear against each other,
/// which makes fringes across the rows as fine as the shear is steep. The lowest phase is 0.
pub(super) fn balanced_rows(field: &Field, seen: &[bool]) -> Vec<f64> {
    let columns = field.columns.max(1);
    let mut turns = rows_from_zero(field);
    let rows = field.rows();
    let steps = map_rows(rows, |row| {
        if row == 0 {
            return 0.0;
        }
        let (mut both, mut all, mut count) = (0.0, 0.0, 0.0);
        for column in 0..columns {
            let (here, above) = (row * columns + column, (row - 1) * columns + column);
            let step = turns[here] - turns[above];
            all += step;
            if seen[here] && seen[above] {
                both += step;
                count += 1.0;
            }
        }
        if count > 0.0 {
            both / count
        } else {
            all / columns as f64
        }
    });
    let mut offset = 0.0;
    for (row, step) in turns.chunks_mut(columns).zip(steps) {
        offset -= step;
        row.iter_mut().for_each(|phase| *phase += offset);
    }
    let lowest = turns.iter().copied().fold(f64::INFINITY, f64::min);
    turns.iter_mut().for_each(|phase| *phase -= lowest);
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;

    #[test]
    fn smoothing_keeps_a_uniform_field_and_the_mean_of_a_spike() {
        let mut field = Field::uniform(40, 30, 0.1);
        let smooth = field.smoothed([3.0, 5.0]);
        assert!(smooth.values.iter().all(|g| (g - 0.1).abs() < 1e-12));
        field.values[15 * 40 + 20] = 1.1;
        let sum: f64 = field
            .smoothed([2.0, 3.0])
            .values
            .iter()
            .map(|g| g - 0.1)
            .sum();
        assert!((sum - 1.0).abs() < 1e-9);
    }

    #[test]
    fn unknown_cells_are_filled_by_their_rule_and_known_ones_kept() {
        let mut field = Field::uniform(9, 5, f64::NAN);
        field.values[2 * 9 + 2] = 0.1;
        field.values[2 * 9 + 6] = 0.3;
        let mut rows = field.clone();
        rows.fill_rows(0.5);
        assert_eq!(rows.values[0], 0.5);
        assert!((rows.values[2 * 9 + 4] - 0.2).abs() < 1e-12);
        assert_eq!(rows.values[2 * 9 + 8], 0.3);
        let mut near = field.clone();
        near.fill_near(1);
        assert_eq!(near.values[9 + 1], 0.1);
        assert!(near.values[2 * 9 + 4].is_nan());
        field.fill_columns();
        assert_eq!(field.values[6], 0.3);
        assert!(field.values[5].is_nan());
    }

    #[test]
    fn the_minimum_filter_spreads_low_values() {
        let mut field = Field::uniform(9, 9, 0.2);
        field.values[4 * 9 + 4] = 0.05;
        let low = field.minimum(3);
        let count = low.values.iter().filter(|g| **g == 0.05).count();
        assert_eq!(count, 49);
    }

    #[test]
    fn a_uniform_field_gives_straight_fringes_either_way() {
        let field = Field::uniform(100, 20, 0.125);
        let plain = rows_from_zero(&field);
        assert_eq!(plain, balanced_rows(&field, &vec![true; 2000]));
        assert_eq!(plain[99], 99.0 * 0.125);
    }

    const COLUMNS: usize = 100_000;
    /// Half a unit of the last place below 16,384 turns, 2⁻⁴⁰, for each column: a tenth of a unit
    /// of Q20.
    const SUM_ERROR: f64 = COLUMNS as f64 / 1_099_511_627_776.0;

    /// The phase in front of each column, exact: frequencies from 2⁻¹¹ on are whole numbers of
    /// 2⁻⁶⁴.
    fn exact(row: &[f64]) -> Vec<f64> {
        let unit = 18_446_744_073_709_551_616.0;
        let mut sum = 0_i128;
        let before = row.iter().map(|frequency| {
            let turns = sum as f64 / unit;
            sum += (frequency * unit) as i128;
            turns
        });
        before.collect()
    }

    fn worst(found: &[f64], truth: &[f64]) -> f64 {
        let errors = found.iter().zip(truth).map(|(a, b)| (a - b).abs());
        errors.fold(0.0, f64::max)
    }

    /// Rows of 10⁵ columns: uniform (every rounding alike), swept over all pitches from 4 to 128
    /// px, and a pitch that jumps between both.
    fn long_rows() -> Field {
        let mut field = Field::uniform(COLUMNS, 4, 0.1);
        for column in 0..COLUMNS {
            let share = column as f64 / COLUMNS as f64;
            field.values[COLUMNS + column] = 1.0 / (4.0 + 124.0 * share);
            field.values[2 * COLUMNS + column] = 1.0 / (128.0 - 124.0 * share);
            let jump = [4.1, 127.3][column / 7 % 2];
            field.values[3 * COLUMNS + column] = 1.0 / jump;
        }
        field
    }

    #[test]
    fn integration_over_a_hundred_thousand_columns_is_the_exact_sum() {
        let field = long_rows();
        let turns = rows_from_zero(&field);
        for (row, found) in turns.chunks(COLUMNS).enumerate() {
            let truth = exact(&field.values[row * COLUMNS..][..COLUMNS]);
            let worst = worst(found, &truth);
            std::println!(
                "row {row}: {:.1} turns, off by {worst:.1e} at most",
                truth[COLUMNS - 1]
            );
            assert!(truth[COLUMNS - 1] > 1000.0 && truth[COLUMNS - 1] < 16_384.0);
            assert!(worst <= SUM_ERROR, "row {row}: {worst:e}");
        }
    }

    #[test]
    fn balancing_rows_of_a_hundred_thousand_columns_only_shifts_them() {
        let field = long_rows();
        let seen: Vec<bool> = (0..4 * COLUMNS).map(|place| place % 3 > 0).collect();
        let turns = balanced_rows(&field, &seen);
        for (row, found) in turns.chunks(COLUMNS).enumerate() {
            let truth = exact(&field.values[row * COLUMNS..][..COLUMNS]);
            let shifted: Vec<f64> = truth.iter().map(|phase| phase + found[0]).collect();
            let worst = worst(found, &shifted);
            // The balance, the offset and the lowest phase round once more each.
            assert!(worst <= SUM_ERROR * 1.001, "row {row}: {worst:e}");
        }
    }

    #[test]
    fn balanced_rows_agree_where_the_part_is_seen() {
        // The left half, unseen, is twice as fine in odd rows.
        let mut field = Field::uniform(100, 10, 0.1);
        for row in (1..10).step_by(2) {
            field.values[row * 100..row * 100 + 50].fill(0.2);
        }
        let seen: Vec<bool> = (0..1000).map(|place| place % 100 >= 50).collect();
        let turns = balanced_rows(&field, &seen);
        for row in 1..10 {
            let step = turns[row * 100 + 75] - turns[(row - 1) * 100 + 75];
            assert!(step.abs() < 1e-12, "row {row}: {step}");
        }
        assert!(turns.iter().all(|phase| *phase >= 0.0));
    }
}
