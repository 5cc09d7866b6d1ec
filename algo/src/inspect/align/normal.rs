//! The normal equations of a motion, and the weights of their points.

use super::directions::Six;
use super::fit::Row;

/// Where Huber's weights begin to fall, and where Tukey's are 0, in σ of the residuals.
const HUBER: f64 = 1.345;
pub(super) const TUKEY: f64 = 4.685;

/// How much points off the surface weigh.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Weights {
    Huber,
    Tukey,
}

impl Weights {
    /// Of a residual in σ.
    fn of(self, residual: f64) -> f64 {
        let size = libm::fabs(residual);
        match self {
            Self::Huber if size <= HUBER => 1.0,
            Self::Huber => HUBER / size,
            Self::Tukey if size >= TUKEY => 0.0,
            Self::Tukey => {
                let rest = 1.0 - (size / TUKEY) * (size / TUKEY);
                rest * rest
            }
        }
    }
}

/// The normal equations.
pub(super) struct Normal {
    pub matrix: Six,
    pub right: [f64; 6],
    /// What errors of the lifts add to the matrix.
    pub noise: Six,
    /// Points with a weight.
    pub inside: usize,
}

impl Normal {
    /// Of points that a motion leaves residuals of, in units of `scale`.
    pub fn of(rows: &[Row], weights: Weights, further: &[f64; 6], scale: f64) -> Self {
        let (mut matrix, mut right, mut inside) = ([[0.0; 6]; 6], [0.0; 6], 0);
        let mut lifts = Lifts::default();
        for row in rows {
            let weight = weights.of(row.left(further) / scale);
            inside += usize::from(weight > 0.0);
            lifts.add(row, weight * row.lift_noise * row.lift_noise);
            add_square(&mut matrix, &row.row, weight);
            for (sum, r) in right.iter_mut().zip(row.row) {
                *sum += weight * r * row.residual;
            }
        }
        Self {
            matrix: mirrored(matrix),
            right,
            noise: lifts.matrix(),
            inside,
        }
    }

    /// Covariance of the right side, with Tukey's weights.
    pub fn covariance(rows: &[Row], further: &[f64; 6], scale: f64) -> Six {
        let mut covariance = [[0.0; 6]; 6];
        for row in rows {
            let weight = Weights::Tukey.of(row.left(further) / scale);
            add_square(&mut covariance, &row.row, weight * weight * row.variance);
        }
        mirrored(covariance)
    }
}

/// Adds weight · r rᵀ to the upper half of a matrix.
fn add_square(matrix: &mut Six, r: &[f64; 6], weight: f64) {
    for (i, sums) in matrix.iter_mut().enumerate() {
        let scaled = weight * r[i];
        for (sum, r) in sums[i..].iter_mut().zip(&r[i..]) {
            *sum += scaled * r;
        }
    }
}

/// A symmetric matrix from its upper half.
fn mirrored(upper: Six) -> Six {
    core::array::from_fn(|i| core::array::from_fn(|j| upper[i.min(j)][i.max(j)]))
}

/// Σ n (x xᵀ + y yᵀ), n the variance of a lift, x = (1, 0, 0, 0, q_z, −q_y) and y = (0, 1, 0, −q_z, 0, q_x) what the row of
/// a point with the lever q gains with the lift's x and y.
#[derive(Default)]
struct Lifts {
    n: f64,
    x: f64,
    y: f64,
    z: f64,
    zz: f64,
    xz: f64,
    yz: f64,
    across: f64,
}

impl Lifts {
    fn add(&mut self, row: &Row, n: f64) {
        let q = row.lever;
        let (x, y, z) = (n * q.x, n * q.y, n * q.z);
        self.n += n;
        self.x += x;
        self.y += y;
        self.z += z;
        self.zz += z * q.z;
        self.xz += x * q.z;
        self.yz += y * q.z;
        self.across += x * q.x + y * q.y;
    }

    fn matrix(&self) -> Six {
        mirrored([
            [self.n, 0.0, 0.0, 0.0, self.z, -self.y],
            [0.0, self.n, 0.0, -self.z, 0.0, self.x],
            [0.0; 6],
            [0.0, 0.0, 0.0, self.zz, 0.0, -self.xz],
            [0.0, 0.0, 0.0, 0.0, self.zz, -self.yz],
            [0.0, 0.0, 0.0, 0.0, 0.0, self.across],
        ])
    }
}
