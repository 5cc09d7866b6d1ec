//! Pictures of boards, rendered from their geometry.

use super::Random;
use crate::calibration::corner::locate;
use crate::calibration::{Board, BoardError, FringeMaps, GreyPicture, PoseError, look};
use crate::pipeline::PhaseMap;
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use std::vec::Vec;

const SIZE: (usize, usize) = (360, 300);
const BOARD: Board = Board {
    columns: 5,
    rows: 7,
    square: 10.0,
};
/// Samples per pixel along each axis.
const SUB: usize = 6;

/// A board in perspective: from places on it in mm to pixels.
fn seen(shift: (f64, f64), x: f64, y: f64) -> (f64, f64) {
    let depth = 1.0 + 0.0025 * x - 0.0015 * y;
    (
        (175.3 + 2.9 * x + 0.35 * y) / depth + shift.0,
        (148.7 + 0.3 * x - 2.8 * y) / depth + shift.1,
    )
}

/// The place on the board that is seen at a pixel, by Newton's method with differences.
fn place(shift: (f64, f64), u: f64, v: f64) -> (f64, f64) {
    let (mut x, mut y) = (0.0, 0.0);
    for _ in 0..12 {
        let (a, b) = seen(shift, x, y);
        let ((ax, bx), (ay, by)) = (seen(shift, x + 1e-4, y), seen(shift, x, y + 1e-4));
        let (ux, vx) = ((ax - a) * 1e4, (bx - b) * 1e4);
        let (uy, vy) = ((ay - a) * 1e4, (by - b) * 1e4);
        let determinant = ux * vy - uy * vx;
        let (du, dv) = (u - a, v - b);
        x += (du * vy - dv * uy) / determinant;
        y += (dv * ux - du * vx) / determinant;
    }
    (x, y)
}

/// A picture of the board under light that falls off to a fifth, with noise of σ 1.5 counts.
fn picture(shift: (f64, f64), seed: u64, blur: f64) -> GreyPicture {
    let mut random = Random::new(seed);
    let side = |at: f64, corners: usize| at / BOARD.square + (corners as f64 - 1.0) / 2.0;
    let colour = |u: f64, v: f64| {
        let (x, y) = place(shift, u, v);
        let (column, row) = (side(x, BOARD.columns), side(y, BOARD.rows));
        let inside = |at: f64, corners: usize| (-1.0..corners as f64).contains(&at);
        if !inside(column, BOARD.columns) || !inside(row, BOARD.rows) {
            return 180.0;
        }
        let odd = (libm::floor(column) + libm::floor(row)) as i64 % 2 != 0;
        if odd { 50.0 } else { 180.0 }
    };
    let pixels = (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v)));
    let counts = pixels.map(|(u, v)| {
        let mut sum = 0.0;
        for at in 0..SUB * SUB {
            let off = |at: usize| (at as f64 + 0.5) / SUB as f64 - 0.5;
            let spread = blur.max(1.0);
            sum += colour(
                u as f64 + spread * off(at % SUB),
                v as f64 + spread * off(at / SUB),
            );
        }
        let light = 1.0 - 0.8 * u as f64 / SIZE.0 as f64;
        (sum / (SUB * SUB) as f64 * light + 1.5 * random.normal()) as f32
    });
    GreyPicture {
        width: SIZE.0,
        height: SIZE.1,
        counts: counts.collect(),
    }
}

/// Phases of fringes of 20 projector pixels: ξ = 300 + 2u, η = 100 + 2v, resolved in columns from
/// `from`.
fn phases(from: usize) -> [PhaseMap; 2] {
    let map = |turns: &dyn Fn(usize, usize) -> f64| {
        let mut map = PhaseMap::new(SIZE.0, SIZE.1);
        for at in 0..SIZE.0 * SIZE.1 {
            let (u, v) = (at % SIZE.0, at / SIZE.0);
            if u >= from {
                map.phase[at] = AbsolutePhase::from_turns(turns(u, v));
                map.trust[at] = Trust::Resolved;
            }
        }
        map
    };
    [
        map(&|u, _| (300.0 + 2.0 * u as f64) / 20.0),
        map(&|_, v| (100.0 + 2.0 * v as f64) / 20.0),
    ]
}

fn looked(levels: &[GreyPicture], from: usize) -> Result<crate::calibration::BoardView, PoseError> {
    let [vertical, horizontal] = phases(from);
    let fringes = FringeMaps {
        vertical: &vertical,
        horizontal: &horizontal,
        pitch: (20.0, 20.0),
    };
    look(&BOARD, levels, &fringes)
}

#[test]
fn every_corner_is_located_to_a_twentieth_of_a_pixel_in_uneven_light() {
    let found = BOARD.find(&picture((0.0, 0.0), 1, 1.0)).unwrap();
    assert_eq!(found.located(), BOARD.corners());
    let (mut squares, mut worst) = (0.0, 0.0_f64);
    for (at, corner) in found.corners.iter().enumerate() {
        let corner = corner.unwrap();
        let (x, y) = BOARD.place(at);
        let (u, v) = seen((0.0, 0.0), x, y);
        let off = libm::hypot(corner.u - u, corner.v - v);
        squares += off * off;
        worst = worst.max(off);
    }
    let rms = libm::sqrt(squares / BOARD.corners() as f64);
    assert!(rms < 0.05 && worst < 0.15, "{rms} {worst}");
}

#[test]
fn a_covered_corner_is_left_out_and_a_board_of_another_size_refused() {
    let mut covered = picture((0.0, 0.0), 2, 1.0);
    let (x, y) = BOARD.place(17);
    let (u, v) = seen((0.0, 0.0), x, y);
    for dv in 0..17 {
        for du in 0..17 {
            let at = (v as usize + dv - 8) * SIZE.0 + u as usize + du - 8;
            covered.counts[at] = 100.0;
        }
    }
    let found = BOARD.find(&covered).unwrap();
    assert_eq!(found.located(), BOARD.corners() - 1);
    assert_eq!(found.corners[17], None);
    let other = Board {
        columns: 6,
        ..BOARD
    };
    let error = other.find(&covered).unwrap_err();
    assert!(
        matches!(
            error,
            BoardError::Size {
                found: (5, 7) | (7, 5)
            }
        ),
        "{error}"
    );
    let empty = GreyPicture {
        counts: std::vec![9.0; SIZE.0 * SIZE.1],
        ..covered
    };
    assert_eq!(BOARD.find(&empty), Err(BoardError::None));
}

#[test]
fn a_pose_gives_corners_and_projector_points_inside_its_squares() {
    let view = looked(
        &[picture((0.0, 0.0), 1, 1.0), picture((0.0, 0.0), 2, 1.0)],
        0,
    )
    .unwrap();
    assert_eq!(view.found.located(), BOARD.corners());
    assert_eq!(view.nodes.len(), 4 * 4 * 6);
    for node in &view.nodes {
        let off = (
            node.lit_by.0 - 300.0 - 2.0 * node.at.0,
            node.lit_by.1 - 100.0 - 2.0 * node.at.1,
        );
        // The phases are rounded to 2⁻¹⁶ turn.
        assert!(libm::hypot(off.0, off.1) < 1e-3, "{node:?}");
    }
}

#[test]
fn a_moved_a_blurred_and_a_badly_lit_pose_are_refused_with_the_reason() {
    let still = |seed| picture((0.0, 0.0), seed, 1.0);
    let error = looked(&[still(1), picture((0.4, 0.1), 2, 1.0)], 0).unwrap_err();
    let PoseError::Moved { pixels } = error else {
        panic!("{error}");
    };
    // Half of the motion, because the mean lies between both.
    assert!((pixels - 0.206).abs() < 0.03, "{pixels}");
    let error = looked(&[picture((0.0, 0.0), 1, 9.0)], 0).unwrap_err();
    assert!(matches!(error, PoseError::Blurred { .. }), "{error}");
    let error = looked(&[still(1)], 180).unwrap_err();
    let PoseError::OffFringes { share } = error else {
        panic!("{error}");
    };
    assert!((0.3..0.7).contains(&share), "{share}");
    let all: Vec<_> = (1..4).map(still).collect();
    assert!(looked(&all, 0).is_ok());
}

#[test]
fn a_sharp_corner_of_small_squares_is_located_from_a_pixel_away() {
    let (width, height, sub) = (24, 24, 8);
    let mut random = Random::new(5);
    for case in 0..200 {
        let mut by = |most: f64| most * random.signed();
        let (u, v) = (11.5 + by(0.5), 11.5 + by(0.5));
        let first = by(3.0);
        let second = first + core::f64::consts::FRAC_PI_2 + by(0.5);
        let start = (u + by(0.7), v + by(0.7));
        let edges = [first, second].map(|angle| (libm::cos(angle), libm::sin(angle)));
        let pixels = (0..width * height).map(|at| {
            let colour = |ray: usize| {
                let off = |at: usize| (at as f64 + 0.5) / sub as f64 - 0.5;
                let x = (at % width) as f64 + off(ray % sub) - u;
                let y = (at / width) as f64 + off(ray / sub) - v;
                let [a, b] = edges.map(|(cos, sin)| y * cos - x * sin > 0.0);
                if a == b { 15.0 } else { 180.0 }
            };
            ((0..sub * sub).map(colour).sum::<f64>() / (sub * sub) as f64) as f32
        });
        let picture = GreyPicture {
            width,
            height,
            counts: pixels.collect(),
        };
        let found = locate(&picture, start, edges, 4.0);
        let found = found.unwrap_or_else(|| panic!("case {case}: not located"));
        let off = libm::hypot(found.u - u, found.v - v);
        assert!(off < 0.15, "case {case}: {off}");
    }
}
