//! Interpolation of a raster: Catmull–Rom along both axes, continued linearly beyond the raster.

/// The value at a point (ξ, η) of `turns`, a raster of `(columns, rows)`, at least two of each.
#[inline]
pub(super) fn catmull_rom(turns: &[f64], size: (usize, usize), point: (f64, f64)) -> f64 {
    inside(turns, size, point).unwrap_or_else(|| anywhere(turns, size, point))
}

/// The value anywhere.
fn anywhere(turns: &[f64], (columns, rows): (usize, usize), (xi, eta): (f64, f64)) -> f64 {
    let (column, across) = LinePosition::new(xi, columns);
    let (row, down) = LinePosition::new(eta, rows);
    let mut lines = [0.0; 4];
    for (line, offset) in lines.iter_mut().zip(-1_isize..) {
        *line = extended(row + offset, rows, |row| {
            let start = row * columns;
            let turns = &turns[start..start + columns];
            let mut taps = [0.0; 4];
            for (tap, offset) in taps.iter_mut().zip(-1_isize..) {
                *tap = extended(column + offset, columns, |i| turns[i]);
            }
            across.interpolate(taps)
        });
    }
    down.interpolate(lines)
}

/// The value where all 16 samples around a point lie on the raster, as they do nearly everywhere;
/// computed by weights, which is faster.
#[inline]
fn inside(turns: &[f64], (columns, rows): (usize, usize), (xi, eta): (f64, f64)) -> Option<f64> {
    let fits = |x: f64, count: usize| x >= 1.0 && x < (count - 2) as f64;
    if !(fits(xi, columns) && fits(eta, rows)) {
        return None;
    }
    // Both are positive, so truncation is the floor; no raster has 2³¹ columns or rows.
    let (column, row) = (xi as i32, eta as i32);
    let across = weights(xi - f64::from(column));
    let down = weights(eta - f64::from(row));
    let start = (row as usize - 1) * columns + column as usize - 1;
    let taps =
        |line: usize| -> Option<&[f64; 4]> { turns.get(start + line * columns..)?.first_chunk() };
    let (first, second, third, last) = (taps(0)?, taps(1)?, taps(2)?, taps(3)?);
    let column_value = |i: usize| {
        (down[0] * first[i] + down[1] * second[i]) + (down[2] * third[i] + down[3] * last[i])
    };
    let [a, b, c, d] = [
        column_value(0),
        column_value(1),
        column_value(2),
        column_value(3),
    ];
    Some((across[0] * a + across[1] * b) + (across[2] * c + across[3] * d))
}

/// Sample `i` of a line of `count`, continued linearly beyond both ends.
#[inline]
fn extended(i: isize, count: usize, sample: impl Fn(usize) -> f64) -> f64 {
    let last = count as isize - 1;
    if i < 0 {
        let (first, second) = (sample(0), sample(1));
        first + (second - first) * i as f64
    } else if i > last {
        let (end, before) = (sample(count - 1), sample(count - 2));
        end + (end - before) * (i - last) as f64
    } else {
        sample(i as usize)
    }
}

/// Catmull–Rom weights of taps at −1, 0, 1, 2 for a place t of 0 to 1.
#[inline]
fn weights(t: f64) -> [f64; 4] {
    let (half, rest) = (0.5 * t, 1.0 - t);
    let (first, last) = (-half * rest * rest, -half * t * rest);
    let third = half * (1.0 + t * (4.0 - 3.0 * t));
    [first, 1.0 - first - third - last, third, last]
}

/// The position of a point between two samples of a line.
enum LinePosition {
    /// In or next to the raster: the fraction of the cell, for Catmull–Rom.
    Within(f64),
    /// Far outside: the distance from the cell's start, for linear continuation.
    Beyond(f64),
}

impl LinePosition {
    /// The sample before `x` on a line of `count` samples, and the position after it.
    #[inline]
    fn new(x: f64, count: usize) -> (isize, Self) {
        let floor = libm::floor(x);
        if floor >= -2.0 && floor <= count as f64 {
            (floor as isize, LinePosition::Within(x - floor))
        } else if x < 0.0 {
            (-2, LinePosition::Beyond(x + 2.0))
        } else {
            // A NaN lands here and stays a NaN.
            (count as isize, LinePosition::Beyond(x - count as f64))
        }
    }

    /// The value from taps at −1, 0, 1, 2.
    #[inline]
    fn interpolate(&self, [a, b, c, d]: [f64; 4]) -> f64 {
        match *self {
            LinePosition::Within(t) => {
                let cubic = 3.0 * (b - c) + d - a;
                let square = 2.0 * a - 5.0 * b + 4.0 * c - d;
                b + 0.5 * t * ((c - a) + t * (square + t * cubic))
            }
            LinePosition::Beyond(distance) => b + distance * (c - b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const SIZE: (usize, usize) = (16, 9);

    #[test]
    fn both_ways_to_interpolate_agree_wherever_both_may_be_taken() {
        let turns: Vec<f64> = (0..SIZE.0 * SIZE.1)
            .map(|i| 500.0 * libm::sin((i * i % 977) as f64))
            .collect();
        let mut both = 0;
        for step in 0..40_000 {
            let point = (
                f64::from(step % 200) * 0.09 - 1.0,
                f64::from(step / 200) * 0.055 - 1.0,
            );
            let expected = anywhere(&turns, SIZE, point);
            if let Some(value) = inside(&turns, SIZE, point) {
                // Some dozen roundings of numbers up to 1000.
                assert!((value - expected).abs() < 1e-11, "{point:?}");
                both += 1;
            }
            assert!((catmull_rom(&turns, SIZE, point) - expected).abs() < 1e-11);
        }
        assert!(both > 15_000, "{both}");
        for point in [(f64::NAN, 3.0), (3.0, f64::NAN), (14.0, 3.0), (0.99, 3.0)] {
            assert_eq!(inside(&turns, SIZE, point), None);
        }
    }
}
