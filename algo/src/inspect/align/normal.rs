//! The normal equations of the least-squares fit of a motion, with robust weights.
//!
//! The six unknowns are shifts along x, y, z and turns about x, y, z, all in mm (a turn as the way of a point at the part's radius).

use super::directions::Matrix6;
use super::fit::Equation;
use crate::geometry::Vector;

/// Residual from which Huber's weights fall, in σ.
const HUBER: f64 = 1.345;
/// Residual from which Tukey's weights are 0, in σ.
pub(super) const TUKEY: f64 = 4.685;

/// The function that gives the weight of a point by its residual.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum WeightFunction {
    Huber,
    Tukey,
}

impl WeightFunction {
    /// The weight of a residual in σ.
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

/// The normal equations: `matrix` times the unknowns is `right_side`.
pub(super) struct Normal {
    pub matrix: Matrix6,
    pub right_side: [f64; 6],
    /// The part of the matrix that the errors of the facets' lifts ([`Facet::lift`](super::surface::Facet::lift)) are expected to add.
    pub noise: Matrix6,
    /// Points with a weight above 0.
    pub inside: usize,
}

impl Normal {
    /// The sums over points. Each point has the weight of its residual after a further motion, divided by `scale` (σ in mm).
    pub fn of(
        equations: &[Equation],
        weights: WeightFunction,
        further: &[f64; 6],
        scale: f64,
    ) -> Self {
        let (mut matrix, mut right_side, mut inside) = ([[0.0; 6]; 6], [0.0; 6], 0);
        let mut noise = LiftNoise::default();
        for equation in equations {
            let weight = weights.of(equation.residual_after(further) / scale);
            inside += usize::from(weight > 0.0);
            noise.add(
                equation.lever,
                weight * equation.lift_noise * equation.lift_noise,
            );
            add_square(&mut matrix, &equation.jacobian, weight);
            for (sum, r) in right_side.iter_mut().zip(equation.jacobian) {
                *sum += weight * r * equation.residual;
            }
        }
        Self {
            matrix: mirrored(matrix),
            right_side,
            noise: noise.matrix(),
            inside,
        }
    }

    /// Covariance of the right-hand side, mm², with Tukey's weights; `scale` as in [`Self::of`].
    pub fn covariance(equations: &[Equation], further: &[f64; 6], scale: f64) -> Matrix6 {
        let mut covariance = [[0.0; 6]; 6];
        for equation in equations {
            let weight = WeightFunction::Tukey.of(equation.residual_after(further) / scale);
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
fn add_square(matrix: &mut Matrix6, r: &[f64; 6], weight: f64) {
    for (i, sums) in matrix.iter_mut().enumerate() {
        let scaled = weight * r[i];
        for (sum, r) in sums[i..].iter_mut().zip(&r[i..]) {
            *sum += scaled * r;
        }
    }
}

/// A symmetric matrix from its upper half.
fn mirrored(upper: Matrix6) -> Matrix6 {
    core::array::from_fn(|i| core::array::from_fn(|j| upper[i.min(j)][i.max(j)]))
}

/// The sums of Σ n (x xᵀ + y yᵀ) over points. n is the weighted variance of the x and y of a point's lift m, and q its lever. The point's
/// Jacobian is (m, q × m); its derivatives by m_x and m_y are x = (1, 0, 0, 0, q_z, −q_y) and y = (0, 1, 0, −q_z, 0, q_x).
#[derive(Default)]
struct LiftNoise {
    n: f64,
    x: f64,
    y: f64,
    z: f64,
    zz: f64,
    xz: f64,
    yz: f64,
    /// Σ n (q_x² + q_y²).
    xx_yy: f64,
}

impl LiftNoise {
    fn add(&mut self, q: Vector, n: f64) {
        let (x, y, z) = (n * q.x, n * q.y, n * q.z);
        self.n += n;
        self.x += x;
        self.y += y;
        self.z += z;
        self.zz += z * q.z;
        self.xz += x * q.z;
        self.yz += y * q.z;
        self.xx_yy += x * q.x + y * q.y;
    }

    fn matrix(&self) -> Matrix6 {
        mirrored([
            [self.n, 0.0, 0.0, 0.0, self.z, -self.y],
            [0.0, self.n, 0.0, -self.z, 0.0, self.x],
            [0.0; 6],
            [0.0, 0.0, 0.0, self.zz, 0.0, -self.xz],
            [0.0, 0.0, 0.0, 0.0, self.zz, -self.yz],
            [0.0, 0.0, 0.0, 0.0, 0.0, self.xx_yy],
        ])
    }
}
