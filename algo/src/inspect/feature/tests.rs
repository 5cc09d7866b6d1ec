//! The fit of a plane to made cells, with exact answers.

use super::*;
use crate::geometry::Vector;
use crate::inspect::align::Motion;
use alloc::vec::Vec;

/// Cells of 4 pixels on the plane z = c + a x + b y as taught, 2 mm apart about (x, 0), whose rays
/// lean by 20° and a little differently at each of them. They were measured on the plane with the
/// other parameters.
fn measured(x: f64, taught: [f64; 3], now: [f64; 3], columns: usize) -> Vec<Cell> {
    let meet = |[c, a, b]: [f64; 3], point: Vector, ray: [f64; 2]| {
        let rise = c + a * point.x + b * point.y - point.z;
        rise / (1.0 - a * ray[0] - b * ray[1])
    };
    let cells = (0..columns * 11).map(|at| {
        let (right, down) = ((at % columns) as f64 - 5.0, (at / columns) as f64 - 5.0);
        let point = Vector::new(x + 2.0 * right, 2.0 * down, 0.0);
        let z = taught[0] + taught[1] * point.x + taught[2] * point.y;
        let point = Vector { z, ..point };
        let ray = [0.364 + 0.003 * right, 0.002 * down];
        let taught = TaughtCell {
            pixels: 4,
            height: z,
            x: point.x,
            y: point.y,
            ray,
            ..TaughtCell::default()
        };
        let deviation = meet(now, point, ray);
        Cell {
            at,
            pixels: 4.0,
            height: z + deviation,
            deviation,
            taught,
        }
    });
    cells.collect()
}

fn fitted(cells: &[Cell]) -> Option<(FittedPlane, Vec<[f64; 3]>)> {
    let taught: Vec<TaughtCell> = cells.iter().map(|cell| cell.taught).collect();
    let mut rows = Vec::new();
    let plane = FittedPlane::of(cells, Middle::of(&taught), 1e-4, &mut rows)?;
    Some((plane, rows))
}

#[test]
fn a_plane_is_found_exactly_from_points_on_rays() {
    let steep = f64::tan(80_f64.to_radians());
    for (taught, now) in [
        ([3.0, 0.0, 0.0], [3.2, 0.01, -0.02]),
        // 45° and 47°, falling and rising along the rays; both cross golden.
        ([0.0, -1.0, 0.1], [0.1, -1.07, 0.1]),
        ([0.0, 1.0, 0.0], [-0.3, 1.07, -0.05]),
        ([1.0, -steep, 0.0], [1.5, -steep - 0.3, 0.2]),
        // An overhang: the camera sees its lower side.
        ([0.0, 6.0, 0.0], [0.0, 6.5, 0.0]),
    ] {
        let (plane, rows) = fitted(&measured(7.0, taught, now, 11)).unwrap();
        let [c, a, b] = plane.parameters;
        assert!(
            (a - now[1]).abs() < 1e-9 && (b - now[2]).abs() < 1e-9,
            "{a} {b} {now:?}"
        );
        let middle = now[0] + now[1] * 7.0;
        assert!((c - middle).abs() < 1e-9, "{c} {middle}");
        let normal = plane.geometry(plane.parameters).normal;
        let seen = normal.dot(Vector::new(0.364, 0.0, 1.0));
        assert!(
            seen > 0.0 && (normal.length() - 1.0).abs() < 1e-12,
            "{normal:?}"
        );
        // What all cells do together is what the plane does.
        let sum: f64 = rows.iter().map(|row| row[0]).sum();
        let lifted = 1.0 - a * 0.364;
        assert!((sum / lifted - 1.0).abs() < 0.1, "{sum} {lifted}");
    }
}

#[test]
fn the_middle_stays_where_it_is_whatever_pixels_are_missing() {
    let all = measured(0.0, [0.0, 0.0, 0.0], [0.0, 0.05, 0.0], 11);
    let taught: Vec<TaughtCell> = all.iter().map(|cell| cell.taught).collect();
    let some: Vec<Cell> = all
        .into_iter()
        .filter(|cell| cell.taught.x > -3.0)
        .collect();
    let plane = FittedPlane::of(&some, Middle::of(&taught), 1e-4, &mut Vec::new()).unwrap();
    let point = plane.geometry(plane.parameters).point;
    assert!(point.length() < 1e-9, "{point:?}");
}

#[test]
fn cells_at_one_place_or_on_a_line_have_no_plane() {
    let plane = [1.0, 0.2, 0.1];
    assert!(fitted(&[]).is_none());
    assert!(fitted(&measured(0.0, plane, plane, 1)).is_none());
    let one = measured(0.0, plane, plane, 11)[0];
    assert!(fitted(&[one; 9]).is_none());
    let mut broken = measured(0.0, plane, plane, 11);
    broken[3].deviation = f64::NAN;
    assert!(fitted(&broken).is_none());
}

#[test]
fn a_plane_moves_with_the_part() {
    let (plane, _) = fitted(&measured(7.0, [0.0, 0.3, 0.1], [0.0, 0.3, 0.1], 11)).unwrap();
    let motion = Motion::new(
        Vector::new(1.0, 2.0, 3.0),
        Vector::new(0.5, -0.4, 0.3),
        Vector::new(0.01, -0.02, 0.03),
    );
    let [c, a, b] = plane.moved(&motion);
    for (x, y) in [(0.0, 0.0), (9.0, -4.0), (-3.0, 8.0)] {
        let point = motion.apply(Vector::new(x, y, 0.3 * x + 0.1 * y));
        let z = c + a * (point.x - 7.0) + b * point.y;
        assert!((z - point.z).abs() < 1e-9, "{z} {point:?}");
    }
}
