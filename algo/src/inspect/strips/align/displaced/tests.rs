//! Blocks of pixels against single ones.

use super::*;
use crate::inspect::weight::Factor;
use crate::pipeline::{NO_OFFSET, SQUARE};
use crate::units::Height;
use std::vec;
use std::vec::Vec;

const WIDTH: usize = 150;
const ROWS: usize = 24;

/// A hash of a place, which has the same number wherever it is asked for.
fn scatter(place: usize) -> i32 {
    (place as u32).wrapping_mul(2_654_435_761).rotate_left(13) as i32
}

#[test]
fn blocks_have_the_bits_of_one_pixel_after_the_other() {
    let places = 0..WIDTH * ROWS;
    let steep = |at: usize| scatter(at) >> if at % 500 < 400 { 14 } else { 8 };
    let height: Vec<_> = places
        .clone()
        .map(|at| Height::from_nm(steep(at)))
        .collect();
    let taught: Vec<_> = places
        .clone()
        .map(|at| if scatter(at) % 9 == 0 { 0 } else { SQUARE })
        .collect();
    let factor: Vec<_> = places
        .clone()
        .map(|at| Factor::of(f64::from(scatter(at) % 100).abs() / 90.0))
        .collect();
    let golden = GoldenMap {
        height: &height,
        taught: &taught,
        factor: &factor,
        width: WIDTH,
    };
    let mut kinds = [0; 2];
    for (shift, bend) in [
        (0.0, 0.0),
        (0.4, 0.3),
        (-2.6, 0.02),
        (1.5, 6.0),
        (-40.0, 1.0),
    ] {
        let node = |at: usize| {
            let value = [shift + bend * at as f64, bend - shift * 0.5, 0.01];
            [value, [0.02, -0.03, 0.001], [1e-4, -2e-4, 3e-5]]
        };
        let block = |at: usize| {
            let (left, column) = (at / 2, at % 2 * BLOCK);
            let pixels = (64 * left + 64).min(WIDTH - 1) - 64 * left;
            between([&node(left), &node(left + 1)], pixels, column, 0.3)
        };
        let blocks: Vec<_> = (0..WIDTH.div_ceil(BLOCK)).map(block).collect();
        for v in 0..ROWS {
            let offset: Vec<_> = (0..WIDTH)
                .map(|u| match scatter(u + v) % 5 {
                    0 => NO_OFFSET,
                    // A block that sees no part.
                    _ if u / BLOCK == v % 8 => NO_OFFSET,
                    _ => scatter(7 * u + v) >> 12,
                })
                .collect();
            let row = OffsetRow {
                v,
                offset: &offset,
                blocks: &blocks,
            };
            let found = |backend, columns: Range<usize>| {
                let (mut height, mut normal) = (vec![NO_OFFSET; WIDTH], vec![NO_OFFSET; WIDTH]);
                let (mut column, mut line) = (vec![0; WIDTH], vec![0; WIDTH]);
                let out = Deviations {
                    height: &mut height,
                    normal: &mut normal,
                };
                align_row(backend, golden, row, columns.clone(), out);
                taught_coordinates(backend, golden, row, columns, (&mut column, &mut line));
                ((height, normal), column, line)
            };
            for backend in Backend::available() {
                let whole = found(backend, 0..WIDTH);
                for u in 0..WIDTH {
                    // A single pixel has the neighbours of no other.
                    let one = found(backend, u..u + 1);
                    let (one_by, all_by) = (&one.0, &whole.0);
                    assert_eq!(one_by.0[u], all_by.0[u], "{shift} {bend}, {v} {u}");
                    assert_eq!(one_by.1[u], all_by.1[u], "{shift} {bend}, {v} {u}");
                    assert_eq!((one.1[u], one.2[u]), (whole.1[u], whole.2[u]));
                    kinds[usize::from(whole.0.0[u] == NO_OFFSET)] += 1;
                }
            }
        }
    }
    assert!(kinds.iter().all(|count| *count > 1000), "{kinds:?}");
}
