//! Every shape: its distance, its places, and its start from an outline.

use super::*;
use crate::math::solve::Distance;
use std::vec::Vec;

fn corners<const N: usize>(shape: &impl Shape<N>, p: &[f64; N], count: usize) -> Vec<(f64, f64)> {
    let length = shape.length(p);
    let foot = |i: usize| shape.foot(p, length * i as f64 / count as f64);
    (0..count).map(foot).map(|foot| (foot.x, foot.y)).collect()
}

/// Feet lie on the contour, the distance grows by 1 along their normal, and they are found again.
fn agrees<const N: usize>(shape: &impl Shape<N>, p: &[f64; N]) {
    let length = shape.length(p);
    for i in 0..97 {
        let along = length * (f64::from(i) + 0.5) / 97.0;
        let foot = shape.foot(p, along);
        for off in [-0.4, 0.0, 0.7] {
            let (x, y) = (foot.x + off * foot.normal.0, foot.y + off * foot.normal.1);
            assert!(
                (shape.distance(p, x, y) - off).abs() < 1e-9,
                "{along} {off}"
            );
            assert!((shape.along(p, x, y).unwrap() - along).abs() < 1e-9);
        }
    }
}

#[test]
fn distances_and_places_agree() {
    agrees(&Circle, &[3.0, -2.0, 5.0]);
    agrees(&Slot, &[3.0, -2.0, 4.0, 2.5, 0.6]);
    let line = Line::of(&[(1.0, 2.0), (7.0, 10.0)]).unwrap();
    agrees(&line, &[0.3, 0.02]);
    // The material is on the left: from below to above right, the upper left corner.
    assert!(line.distance(&[0.0; 2], 0.0, 10.0) > 0.0);
}

#[test]
fn shapes_start_from_outlines() {
    let circle = [30.0, -20.0, 5.0];
    let found = Circle::of(&corners(&Circle, &circle, 24)).unwrap();
    for (found, is) in found.iter().zip(circle) {
        assert!((found - is).abs() < 1e-9);
    }
    let slot = [3.0, -2.0, 4.0, 2.5, 0.6];
    let found = Slot::of(&corners(&Slot, &slot, 200)).unwrap();
    // The angle is one of two.
    let turn = (found[4] - slot[4]) / core::f64::consts::PI;
    assert!((turn - turn.round()).abs() < 1e-3, "{found:?}");
    for i in 0..4 {
        assert!((found[i] - slot[i]).abs() < 0.01, "{found:?}");
    }
    assert!(Circle::of(&[(0.0, 0.0), (1.0, 1.0)]).is_none());
    assert!(Slot::of(&[(0.0, 0.0), (1.0, 1.0)]).is_none());
    assert!(Line::of(&[(1.0, 1.0), (1.0, 1.0)]).is_none());
}
