//! The normal equations of a motion, with robust weights.

use super::directions::Six;
use super::fit::Equation;
use crate::geometry::Vector;

/// Residual from which Huber's weights fall, in σ.
const HUBER: f64 = 1.345;
/// Residual from which Tukey's weights are 0, in σ.
pub(super) const TUKEY: f64 = 4.685;

/// The weight of a point by its residual.
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
    /// What errors of the lifts add to the matrix, in expectation.
    pub noise: Six,
    /// Points with a weight above 0.
    pub inside: usize,
}

impl Normal {
    /// Of points by their residuals after a further motion, in units of `scale`.
    pub fn of(equations: &[Equation], weights: Weights, further: &[f64; 6], scale: f64) -> Self {
        let (mut matrix, mut right, mut inside) = ([[0.0; 6]; 6], [0.0; 6], 0);
        let mut lifts = Lifts::default();
        for equation in equations {
            let weight = weights.of(equation.left(further) / scale);
            inside += usize::from(weight > 0.0);
            lifts.add(
                equation.lever,
                weight * equation.lift_noise * equation.lift_noise,
            );
            add_square(&mut matrix, &equation.jacobian, weight);
            for (sum, r) in right.iter_mut().zip(equation.jacobian) {
                *sum += weight * r * equation.residual;
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
    pub fn covariance(equations: &[Equation], further: &[f64; 6], scale: f64) -> Six {
        let mut covariance = [[0.0; 6]; 6];
        for equation in equations {
            let weight = Weights::Tukey.of(equation.left(further) / scale);
            add_square(
                &mut covariance,
                &equation.jacobian,
                weight * weight * equation.variance,
            );
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

/// Σ n (x xᵀ + y yᵀ): n is the variance of a lift, x = (1, 0, 0, 0, q_z, −q_y) and y = (0, 1, 0, −q_z, 0, q_x) are the derivatives of
/// the Jacobian of a point with the lever q with respect to x and y of the lift.
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
    fn add(&mut self, q: Vector, n: f64) {
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
