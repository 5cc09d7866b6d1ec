//! The directions of a motion, and which of them a part's shape determines.

/// A symmetric matrix of the six unknowns: shifts along x, y, z, turns about x, y, z.
pub type Matrix6 = [[f64; 6]; 6];

/// Largest number of sweeps of Jacobi's method; six unknowns need five at most to reach the
/// precision of `f64`.
const SWEEPS: usize = 12;
/// Off-diagonal entries below this share of the diagonal are taken as 0: rounding adds as much.
const ROUNDING: f64 = 1e-17;

/// Eigenvalues and eigenvectors (as rows) of a symmetric matrix, by cyclic Jacobi rotations
/// (Golub, Van Loan, *Matrix Computations*, 8.5).
pub fn eigen(matrix: &Matrix6) -> ([f64; 6], Matrix6) {
    let mut a = *matrix;
    let mut vectors = [[0.0; 6]; 6];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..5 {
            for q in p + 1..6 {
                let size = libm::fabs(a[p][p]) + libm::fabs(a[q][q]);
                if libm::fabs(a[p][q]) <= ROUNDING * size {
                    continue;
                }
                rotated = true;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let sign = if theta < 0.0 { -1.0 } else { 1.0 };
                let t = sign / (libm::fabs(theta) + libm::sqrt(theta * theta + 1.0));
                let cos = 1.0 / libm::sqrt(t * t + 1.0);
                let sin = t * cos;
                for row in &mut a {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (cos * x - sin * y, sin * x + cos * y);
                }
                for rows in [&mut a, &mut vectors] {
                    let (upper, lower) = (rows[p], rows[q]);
                    for i in 0..6 {
                        rows[p][i] = cos * upper[i] - sin * lower[i];
                        rows[q][i] = sin * upper[i] + cos * lower[i];
                    }
                }
            }
        }
        if !rotated {
            break;
        }
    }
    (core::array::from_fn(|i| a[i][i]), vectors)
}

/// uᵀ M v.
pub fn form(u: &[f64; 6], matrix: &Matrix6, v: &[f64; 6]) -> f64 {
    let row = |i: usize| (0..6).map(|j| matrix[i][j] * v[j]).sum::<f64>();
    (0..6).map(|i| u[i] * row(i)).sum()
}

/// The directions that a normal matrix determines.
#[derive(Clone, Debug, PartialEq)]
pub struct Directions {
    /// Eigenvalue and unit vector of each that is determined.
    kept: heapless::Vec<(f64, [f64; 6]), 6>,
    /// Unit vectors of the others.
    pub free: heapless::Vec<[f64; 6], 6>,
    /// Components that the shape does not determine.
    pub left_out: [bool; 6],
}

/// A direction is determined only if its eigenvalue is at least this many times what the noise of
/// the normals alone gives.
const OVER_NOISE: f64 = 10.0;
/// A direction is determined only if the noise of the points moves the part along it by at most
/// this many mm (1 σ); turns are measured as the way of a point at the part's radius.
const LARGEST_SIGMA_MM: f64 = 0.05;
/// A component is left out if more than this share of it lies in directions that are not
/// determined.
const SHARE: f64 = 0.5;

impl Directions {
    /// The directions of a normal matrix Σ j jᵀ of rows in mm per mm. `noise` is what errors of the
    /// normals add to the matrix, `sigma_mm` the error of a residual, 1 σ.
    pub fn of(normal: &Matrix6, noise: &Matrix6, sigma_mm: f64) -> Self {
        let (values, vectors) = eigen(normal);
        let (mut kept, mut free) = (heapless::Vec::new(), heapless::Vec::new());
        let mut lost = [0.0; 6];
        let mut worst = None;
        for (value, vector) in values.into_iter().zip(vectors) {
            let spurious = form(&vector, noise, &vector).max(0.0);
            let enough = sigma_mm <= LARGEST_SIGMA_MM * libm::sqrt(value.max(0.0));
            if enough && value > 0.0 && value >= OVER_NOISE * spurious {
                // There are six at most.
                let _ = kept.push((value, vector));
                continue;
            }
            let _ = free.push(vector);
            for (lost, part) in lost.iter_mut().zip(vector) {
                *lost += part * part;
            }
            worst = (0..6).max_by(|&a, &b| lost[a].total_cmp(&lost[b]));
        }
        let mut left_out = lost.map(|share| share > SHARE);
        if let Some(worst) = worst {
            left_out[worst] = true;
        }
        Self {
            kept,
            free,
            left_out,
        }
    }

    /// The x with A x = b along the directions that are determined, 0 along the others.
    pub fn solve(&self, b: &[f64; 6]) -> [f64; 6] {
        let mut x = [0.0; 6];
        for (value, vector) in &self.kept {
            let along: f64 = vector.iter().zip(b).map(|(v, b)| v * b).sum();
            for (x, v) in x.iter_mut().zip(vector) {
                *x += along / value * v;
            }
        }
        x
    }

    /// A⁺ C A⁺, A⁺ the inverse along the directions that are determined: the covariance of x where
    /// b has covariance C.
    pub fn covariance(&self, of_right: &Matrix6) -> Matrix6 {
        let mut covariance = [[0.0; 6]; 6];
        for (p, u) in &self.kept {
            for (q, v) in &self.kept {
                let share = form(u, of_right, v) / (p * q);
                for i in 0..6 {
                    for j in 0..6 {
                        covariance[i][j] += share * u[i] * v[j];
                    }
                }
            }
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_put_the_matrix_together_again() {
        let entry = |i: usize, j: usize| 1.0 / (1.0 + i as f64 + j as f64);
        let matrix: Matrix6 = core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j)));
        let (values, vectors) = eigen(&matrix);
        for i in 0..6 {
            for j in 0..6 {
                let sum: f64 = (0..6)
                    .map(|k| values[k] * vectors[k][i] * vectors[k][j])
                    .sum();
                assert!((sum - entry(i, j)).abs() < 1e-13);
                let product: f64 = (0..6).map(|k| vectors[i][k] * vectors[j][k]).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_plate_determines_height_and_tilt_only_whatever_the_noise_of_its_normals_says() {
        let diagonal = |values: [f64; 6]| -> Matrix6 {
            core::array::from_fn(|i| core::array::from_fn(|j| if i == j { values[i] } else { 0.0 }))
        };
        let normal = diagonal([30.0, 30.0, 1000.0, 1000.0, 1000.0, 30.0]);
        let noise = diagonal([25.0, 25.0, 0.0, 0.0, 0.0, 25.0]);
        let directions = Directions::of(&normal, &noise, 0.05);
        assert_eq!(directions.kept.len(), 3);
        assert_eq!(directions.left_out, [true, true, false, false, false, true]);
        let step = directions.solve(&[5.0, 5.0, 10.0, 0.0, 0.0, 5.0]);
        assert_eq!(step, [0.0, 0.0, 0.01, 0.0, 0.0, 0.0]);
        let exact = Directions::of(&normal, &[[0.0; 6]; 6], 0.05);
        assert_eq!(exact.kept.len(), 6);
        // 0.05 mm / √30 = 9 µm is known well enough, 0.5 mm / √30 = 91 µm is not.
        assert_eq!(Directions::of(&normal, &[[0.0; 6]; 6], 0.5).kept.len(), 3);
    }
}
