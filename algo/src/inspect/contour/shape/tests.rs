//! What every shape promises: its distance and its places agree.

use super::outline::{Outline, PlanePlace};
use std::vec::Vec;

/// Places of an outline, all equally far apart.
pub fn corners(outline: &Outline, count: u32) -> Vec<PlanePlace> {
    (0..count)
        .map(|i| outline.at(f64::from(i) / f64::from(count)))
        .collect()
}

/// Feet lie on the contour, the distance grows by 1 along their normal, and they are found again;
/// marks lie on it, too.
pub fn agrees(outline: &Outline) {
    let (shape, p) = (&outline.shape, &outline.parameters);
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
    for (x, y) in shape.marks(p) {
        assert!(shape.distance(p, x, y).abs() < 1e-9, "{x} {y}");
    }
}
