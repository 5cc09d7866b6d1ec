//! From frequencies to a phase function.

use super::Field;
use crate::pipeline::map_rows;
use alloc::vec::Vec;

/// Φ(s, t) = Φ(s, t−1) + G(s, t−1) with a zero first column (Peng & Gupta 2008, eq. 8), in f64: the
/// sum over 10⁵ columns is exact to 1e-9 turn.
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

/// As [`rows_from_zero`], with each row shifted so that its phase differs from the row above by
/// nothing on average over the cells that are `seen` in both rows: a zero first column shears rows
/// against each other, and the sheared fringes are as fine across as the shear is steep. The lowest
/// phase is 0.
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

    #[test]
    fn integration_over_many_columns_does_not_drift() {
        let field = Field::uniform(100_000, 1, 0.1);
        let turns = rows_from_zero(&field);
        assert!((turns[99_999] - 9_999.9).abs() < 1e-6, "{}", turns[99_999]);
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
