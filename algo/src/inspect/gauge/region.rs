//! Where the point of a plane is taken: where its region lies on the part.
//!
//! # Idea
//! A part is placed as a whole. Of one whose flange is bent, some of the bend is taken for a shift, and what
//! is the middle of the flange's region as taught lies elsewhere on the face. The middle is found again from
//! what the gauge itself is of.
//!
//! # Equations
//! In a datum system that says where the part lies in its xy plane, the point is that with x and y as
//! taught. Beside a reference plane alone, through o with normal n, the point p of a plane with normal m slides
//! along the steepest way d = (n − m (m·n)) / |n − m (m·n)| to where its distance from the line in which both
//! planes cross, n·(p − o) / (n·d), is that as taught.
//!
//! Planes that hardly cross, and faces along z, keep their point: there it hardly matters, or is not known.
//!
//! # Accuracy
//! `the_point_of_a_bent_flange_stays_where_its_region_lies`.

use crate::geometry::Vector;
use crate::inspect::feature::{FeatureKind, Geometry};

/// Least sine of the angle at which two planes cross, and least share of z in a normal.
const LEAST_SINE: f64 = 0.2;

/// The same plane with its point where its region lies beside a reference plane; `taught` are both as taught.
pub fn beside(plane: Geometry, reference: Geometry, taught: [Geometry; 2]) -> Geometry {
    let slid = || {
        let (now, way) = from_crossing(plane, reference)?;
        let (before, _) = from_crossing(taught[0], taught[1])?;
        let point = plane.point + way * (before - now);
        Some(Geometry { point, ..plane })
    };
    slid().unwrap_or(plane)
}

/// The same plane with its point above the x and y that it has as taught.
pub fn above(plane: Geometry, taught: Geometry) -> Geometry {
    let Geometry { point, normal, .. } = plane;
    if plane.kind != FeatureKind::Plane || libm::fabs(normal.z) < LEAST_SINE {
        return plane;
    }
    let Vector { x, y, .. } = taught.point;
    let down = normal.x * (x - point.x) + normal.y * (y - point.y);
    let point = Vector::new(x, y, point.z - down / normal.z);
    Geometry { point, ..plane }
}

/// How far a plane's point lies from the line in which it crosses another one, mm, and the way there.
fn from_crossing(plane: Geometry, other: Geometry) -> Option<(f64, Vector)> {
    if [plane.kind, other.kind] != [FeatureKind::Plane; 2] {
        return None;
    }
    let (Geometry { point, normal, .. }, up) = (plane, other.normal);
    let steepest = up - normal * normal.dot(up);
    let sine = steepest.length();
    (sine >= LEAST_SINE).then(|| {
        let way = steepest * (1.0 / sine);
        (up.dot(point - other.point) / up.dot(way), way)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane through (x, 5, z) that rises by so many degrees towards +x.
    fn plane(x: f64, z: f64, degrees: f64) -> Geometry {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Geometry::plane(Vector::new(x, 5.0, z), Vector::new(-sin, 0.0, cos))
    }

    #[test]
    fn the_point_of_a_bent_flange_stays_where_its_region_lies() {
        let base = plane(0.0, 2.0, 0.0);
        let taught = plane(10.0, 12.0, 45.0);
        // Bent by 5° more about the line in which both cross, and placed 0.3 mm off along x.
        let (sin, cos) = 50.0_f64.to_radians().sin_cos();
        let (length, off) = (10.0 * 2.0_f64.sqrt(), 0.3);
        let seen = plane(off + (length + 1.7) * cos, 2.0 + (length + 1.7) * sin, 50.0);
        let point = beside(seen, base, [taught, base]).point;
        assert!((point.x - (off + length * cos)).abs() < 1e-9, "{point:?}");
        assert!((point.z - (2.0 + length * sin)).abs() < 1e-9, "{point:?}");
        // Nearly parallel planes say nothing.
        let flat = plane(3.0, 9.0, 5.0);
        assert_eq!(beside(flat, base, [flat, base]), flat);
    }

    #[test]
    fn in_a_datum_system_the_point_has_x_and_y_as_taught() {
        let point = above(plane(10.3, 12.0, 45.0), plane(10.0, 0.0, 40.0)).point;
        assert!(
            (point.x - 10.0).abs() < 1e-12 && (point.z - 11.7).abs() < 1e-9,
            "{point:?}"
        );
        let wall = plane(1.0, 2.0, 88.0);
        assert_eq!(above(wall, plane(9.0, 0.0, 88.0)), wall);
    }
}
