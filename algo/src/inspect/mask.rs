//! Masks of pixels.

use crate::math::around;
use crate::pipeline::over_squares;
use alloc::vec;
use alloc::vec::Vec;

/// The connected components of a mask, by region growing: their places in a row-major map. Pixels
/// that share an edge are connected, and with `corners` those that share a corner.
pub(crate) fn components(mask: &[bool], width: usize, corners: bool) -> Vec<Vec<usize>> {
    let rows = mask.len() / width.max(1);
    let mut left = mask.to_vec();
    let mut found = Vec::new();
    for start in 0..mask.len() {
        if !left[start] {
            continue;
        }
        left[start] = false;
        let mut component = vec![start];
        let mut next = 0;
        while let Some(&place) = component.get(next) {
            next += 1;
            let (u, v) = (place % width, place / width);
            for row in around(v, 1, rows) {
                for column in around(u, 1, width) {
                    let beside = row * width + column;
                    if left[beside] && (corners || row == v || column == u) {
                        left[beside] = false;
                        component.push(beside);
                    }
                }
            }
        }
        found.push(component);
    }
    found
}

/// Takes `by` pixels off every edge of a mask (square neighbourhood); the frame's border is an
/// edge.
pub fn eroded(mask: &[bool], width: usize, by: usize) -> Vec<bool> {
    let rows = mask.len() / width.max(1);
    let inside = |column: usize, row: usize| {
        column >= by && row >= by && column + by < width && row + by < rows
    };
    let whole = over_squares(mask, width, by, |a, b| a && b);
    let whole = whole.into_iter().enumerate();
    whole
        .map(|(at, whole)| whole && inside(at % width, at / width))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erosion_takes_pixels_off_the_border_of_the_frame_and_around_every_hole() {
        let (width, height) = (9, 7);
        let hole = 3 * width + 6;
        let mut mask = [true; 63];
        mask[hole] = false;
        let left = eroded(&mask, width, 1);
        for (at, left) in left.into_iter().enumerate() {
            let (u, v) = (at % width, at / width);
            let inside = u >= 1 && v >= 1 && u + 1 < width && v + 1 < height;
            let near_hole = u.abs_diff(6) <= 1 && v.abs_diff(3) <= 1;
            assert_eq!(left, inside && !near_hole, "({u}, {v})");
        }
        assert_eq!(eroded(&mask, width, 0), mask);
    }
}
