//! A pose: translation, and rotation as a matrix or a rotation vector, checked to be a rotation.

use super::matrix::Matrix;
use super::names::{self, Row};
use super::tree::Node;
use algo::calibration::Pose;
use algo::geometry::Vector;

/// Largest element of R·Rᵀ − 1: a rotation matrix that was rounded to six digits has less.
const TOLERANCE: f64 = 1e-4;
/// Largest element of R less the nearest rotation, for R to be taken as that: rounding to three
/// digits leaves half of it.
const ROUNDED: f64 = 1e-3;

/// A pose of a device in its own frame.
pub const OWN: Pose = about_x(1.0);
/// Half a turn about the x axis: y and z point the other way.
pub const HALF_TURN: Pose = about_x(-1.0);

const fn about_x(cos: f64) -> Pose {
    Pose {
        rows: [
            Vector::new(1.0, 0.0, 0.0),
            Vector::new(0.0, cos, 0.0),
            Vector::new(0.0, 0.0, cos),
        ],
        shift: Vector::new(0.0, 0.0, 0.0),
    }
}

/// Reads a pose; `rows` are the accepted names of the nodes of the rotation, each with those of the
/// translation. A unit of length in the file is `mm_per_unit` millimetres. `notes` gets what was
/// corrected.
///
/// # Errors
/// In words: a node is missing or has another shape, R is not a rotation, or it mirrors.
pub fn read(
    tree: &Node,
    rows: &[Row],
    mm_per_unit: f64,
    notes: &mut Vec<String>,
) -> Result<Pose, String> {
    let (name, found, translations) = names::first(tree, rows)
        .map_err(|error| format!("{error}: a rotation, 3×3 or a vector of 3"))?;
    let matrix = Matrix::read(name, found)?;
    let stated = if matrix.is_vector() && matrix.numbers.len() == 3 {
        // The rotation about a vector by its length in radians, as OpenCV's `rvec`.
        let [x, y, z] = matrix.expect(name, (3, 1))?;
        OWN.moved(&[x, y, z, 0.0, 0.0, 0.0])
    } else {
        let [a, b, c, d, e, f, g, h, i] = matrix.expect(name, (3, 3))?;
        Pose {
            rows: [
                Vector::new(a, b, c),
                Vector::new(d, e, f),
                Vector::new(g, h, i),
            ],
            ..OWN
        }
    };
    let rotation = checked(name, stated, notes)?;
    let (name, found) =
        names::one(tree, translations).map_err(|error| format!("{error}: a translation, 3×1"))?;
    let [x, y, z] = Matrix::read(name, found)?.expect(name, (3, 1))?;
    Ok(Pose {
        shift: Vector::new(x, y, z) * mm_per_unit,
        ..rotation
    })
}

/// Largest element by which two matrices differ.
fn apart(a: &Pose, b: &Pose) -> f64 {
    let rows = a.rows.into_iter().zip(b.rows).map(|(a, b)| a - b);
    let apart = rows.flat_map(|row| [row.x, row.y, row.z].map(f64::abs));
    // A NaN stays one, so that it is refused.
    apart.fold(0.0, |most, apart| if most > apart { most } else { apart })
}

/// The rotation that a file states: as it is, or the nearest one where it was rounded to few
/// digits.
fn checked(name: &str, stated: Pose, notes: &mut Vec<String>) -> Result<Pose, String> {
    let off = apart(&stated.after(&stated.inverse()), &OWN);
    let nearest = match off <= TOLERANCE {
        true => stated,
        false => nearest(stated),
    };
    let rounded = apart(&nearest, &stated);
    if !(rounded <= ROUNDED) {
        return Err(format!(
            "{name} is not a rotation matrix: R·Rᵀ differs from the unit matrix by {off:.1e}; write R as OpenCV gives it, with all its digits"
        ));
    }
    if determinant(stated) < 0.0 {
        return Err(format!(
            "{name} mirrors (det R = −1): its world is left-handed, or an axis was flipped by hand; calibrate with \
             right-handed coordinates, and turn a plate's z with --z-away"
        ));
    }
    if rounded > 0.0 {
        notes.push(format!(
            "{name} is a rotation to few digits only (R·Rᵀ differs from the unit matrix by {off:.1e}), and the nearest rotation was \
             taken: points are off by up to {rounded:.0e} of their distance, write R with all its digits"
        ));
    }
    Ok(nearest)
}

fn determinant(
    Pose {
        rows: [a, b, c], ..
    }: Pose,
) -> f64 {
    a.dot(b.cross(c))
}

/// The orthogonal matrix nearest to that of a pose: the mean of a matrix and its transposed inverse
/// converges to it (Higham 1986).
fn nearest(mut pose: Pose) -> Pose {
    for _ in 0..20 {
        // The cofactors over the determinant are the transposed inverse.
        let ([a, b, c], over) = (pose.rows, 1.0 / determinant(pose));
        let mean = |row: Vector, cofactors: Vector| (row + cofactors * over) * 0.5;
        pose.rows = [
            mean(a, b.cross(c)),
            mean(b, c.cross(a)),
            mean(c, a.cross(b)),
        ];
    }
    pose
}
