//! Integrates a field of frequencies to a phase function.

use super::Field;
use crate::pipeline::map_rows;
use alloc::vec::Vec;

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
