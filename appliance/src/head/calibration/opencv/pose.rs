//! A pose: translation, and rotation as a matrix or a rotation vector, checked to be a rotation.

use super::matrix::Matrix;
use super::names::{self, Row};
use super::tree::Node;

/// Largest element of R·Rᵀ − 1: a rotation matrix that was rounded to six digits has less.
const TOLERANCE: f64 = 1e-4;
/// Largest element of the difference of R and the nearest rotation up to which R is replaced by
/// that rotation: rounding to three digits causes half as much.
const ROUNDED: f64 = 1e-3;

/// X_to = R · X_from + t.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// R, row-major.
    pub rotation: [f64; 9],
    /// t, mm.
    pub translation_mm: [f64; 3],
}

impl Pose {
    /// The pose of a device in its own frame of coordinates.
    pub fn identity() -> Self {
        Self {
            rotation: UNIT,
            translation_mm: [0.0; 3],
        }
    }

    /// Reads a pose; `rows` are the accepted names of the nodes of the rotation, each with those of
    /// the translation. A unit of length in the file is `mm_per_unit` millimetres. `notes` gets
    /// what was corrected.
    ///
    /// # Errors
    /// In words: a node is missing or has another shape, R is not a rotation, or it mirrors.
    pub fn read(
        tree: &Node,
        rows: &[Row],
        mm_per_unit: f64,
        notes: &mut Vec<String>,
    ) -> Result<Self, String> {
        let (name, found, translations) = names::first(tree, rows)
            .map_err(|error| format!("{error}: a rotation, 3×3 or a vector of 3"))?;
        let matrix = Matrix::read(name, found)?;
        let rotation = if matrix.is_vector() && matrix.numbers.len() == 3 {
            rodrigues(matrix.expect(name, (3, 1))?)
        } else {
            matrix.expect(name, (3, 3))?
        };
        let rotation = checked(name, rotation, notes)?;
        let (name, found) = names::one(tree, translations)
            .map_err(|error| format!("{error}: a translation, 3×1"))?;
        let translation: [f64; 3] = Matrix::read(name, found)?.expect(name, (3, 1))?;
        Ok(Self {
            rotation,
            translation_mm: translation.map(|length| length * mm_per_unit),
        })
    }

    /// This pose (R₂, t₂) applied after `first` (R₁, t₁): X_to = R₂(R₁X_from + t₁) + t₂.
    pub fn after(&self, first: &Self) -> Self {
        let moved = apply(&self.rotation, first.translation_mm);
        let mut translation_mm = self.translation_mm;
        translation_mm
            .iter_mut()
            .zip(moved)
            .for_each(|(to, by)| *to += by);
        Self {
            rotation: product(&self.rotation, &first.rotation),
            translation_mm,
        }
    }

    /// The same pose with respect to a world turned by half a turn about its x axis: y and z point
    /// the other way.
    pub fn about_x(&self) -> Self {
        let half_turn = [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0];
        Self {
            rotation: product(&self.rotation, &half_turn),
            translation_mm: self.translation_mm,
        }
    }
}

fn apply(m: &[f64; 9], v: [f64; 3]) -> [f64; 3] {
    [0, 3, 6].map(|row| m[row] * v[0] + m[row + 1] * v[1] + m[row + 2] * v[2])
}

fn product(a: &[f64; 9], b: &[f64; 9]) -> [f64; 9] {
    std::array::from_fn(|at| {
        let (row, column) = (at / 3 * 3, at % 3);
        (0..3).map(|k| a[row + k] * b[3 * k + column]).sum()
    })
}

const UNIT: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Largest element by which two matrices differ.
fn apart(a: &[f64; 9], b: &[f64; 9]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    // A NaN stays one, so that it is refused.
    apart.fold(0.0, |most, apart| if most > apart { most } else { apart })
}

/// The rotation that a file states: as it is, or the nearest one where it was rounded to few
/// digits.
fn checked(name: &str, r: [f64; 9], notes: &mut Vec<String>) -> Result<[f64; 9], String> {
    let transposed = std::array::from_fn(|at| r[at % 3 * 3 + at / 3]);
    let off = apart(&product(&r, &transposed), &UNIT);
    let determinant = determinant(&r);
    let nearest = match off <= TOLERANCE {
        true => r,
        false => nearest(r),
    };
    let rounded = apart(&nearest, &r);
    if !(rounded <= ROUNDED) {
        return Err(format!(
            "{name} is not a rotation matrix: R·Rᵀ differs from the unit matrix by {off:.1e}; write R as OpenCV gives it, with all its digits"
        ));
    }
    if determinant < 0.0 {
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

fn determinant(r: &[f64; 9]) -> f64 {
    r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        + r[2] * (r[3] * r[7] - r[4] * r[6])
}

/// The orthogonal matrix nearest to `r`: the mean of a matrix and its transposed inverse converges
/// to it (Higham 1986).
fn nearest(mut r: [f64; 9]) -> [f64; 9] {
    for _ in 0..20 {
        let determinant = determinant(&r);
        // The cofactors over the determinant are the transposed inverse.
        let inverse: [f64; 9] = std::array::from_fn(|at| {
            let (row, column) = (at / 3, at % 3);
            let of = |down: usize, right: usize| r[(row + down) % 3 * 3 + (column + right) % 3];
            (of(1, 1) * of(2, 2) - of(1, 2) * of(2, 1)) / determinant
        });
        r = std::array::from_fn(|at| 0.5 * (r[at] + inverse[at]));
    }
    r
}

/// The rotation about a vector by its length in radians (Rodrigues 1840), as OpenCV's `rvec`.
fn rodrigues([x, y, z]: [f64; 3]) -> [f64; 9] {
    let angle = (x * x + y * y + z * z).sqrt();
    if angle < 1e-12 {
        return [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    }
    let (x, y, z) = (x / angle, y / angle, z / angle);
    let (s, c) = angle.sin_cos();
    let v = 1.0 - c;
    [
        c + x * x * v,
        x * y * v - z * s,
        x * z * v + y * s,
        y * x * v + z * s,
        c + y * y * v,
        y * z * v - x * s,
        z * x * v - y * s,
        z * y * v + x * s,
        c + z * z * v,
    ]
}
