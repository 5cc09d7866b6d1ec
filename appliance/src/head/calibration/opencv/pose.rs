//! A pose: translation, and rotation as a matrix or a rotation vector, checked to be a rotation.

use super::matrix::Matrix;
use super::node;
use super::tree::Node;

/// Largest element of R·Rᵀ − 1: a rotation matrix that was rounded to six digits has less.
const TOLERANCE: f64 = 1e-4;

/// X_to = R · X_from + t.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// R, row-major.
    pub rotation: [f64; 9],
    /// t, mm.
    pub translation_mm: [f64; 3],
}

impl Pose {
    /// Reads a pose; `names` are the accepted names of the node of the rotation and of that of the translation. A unit of length in the
    /// file is `mm_per_unit` millimetres.
    ///
    /// # Errors
    /// In words: a node is missing or has another shape, R is not a rotation, or it mirrors.
    pub fn read(
        tree: &Node,
        names: (&[&'static str], &[&'static str]),
        mm_per_unit: f64,
    ) -> Result<Self, String> {
        let (name, found) = node(tree, names.0)
            .map_err(|error| format!("{error}: a rotation, 3×3 or a vector of 3"))?;
        let matrix = Matrix::read(name, found)?;
        let rotation = if matrix.is_vector() && matrix.numbers.len() == 3 {
            rodrigues(matrix.expect(name, (3, 1))?)
        } else {
            matrix.expect(name, (3, 3))?
        };
        is_rotation(name, &rotation)?;
        let (name, found) =
            node(tree, names.1).map_err(|error| format!("{error}: a translation, 3×1"))?;
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

    /// The same pose with respect to a world turned by half a turn about its x axis: y and z point the other way.
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

fn is_rotation(name: &str, r: &[f64; 9]) -> Result<(), String> {
    let transposed = std::array::from_fn(|at| r[at % 3 * 3 + at / 3]);
    let square = product(r, &transposed);
    let off = (0..9)
        .map(|at| (square[at] - if at % 4 == 0 { 1.0 } else { 0.0 }).abs())
        .fold(0.0, f64::max);
    let determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        + r[2] * (r[3] * r[7] - r[4] * r[6]);
    if !(off <= TOLERANCE) {
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
    Ok(())
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
