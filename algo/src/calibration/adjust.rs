//! One adjustment of everything: both lenses, the relative pose, all poses of the board and its
//! bow.
//!
//! Observed are the corners in the camera (2 residuals each, camera px) and ξ, η at nodes on the
//! board (2 residuals each, projector px: the camera's ray through the node meets the board, and
//! the projector sees that point). Minimised is Σ ρ(|r|/σ) over both, with Huber's ρ (P. J. Huber,
//! 1964), by Levenberg's and Marquardt's method on the normal equations; σ of camera and of
//! projector are estimated from their residuals and the redundancy, in rounds, until the weights
//! agree with the residuals (variance components, W. Förstner, 1979). Derivatives are central
//! differences: each residual depends on 33 numbers only. The inverse of the last normal matrix,
//! and what errors of the print add to it (`uncertainty`), is the covariance.

use super::look::BoardView;
use super::rig::{LENS, POSE, Rig, SHARED};
use crate::math::solve::solve_symmetric;
use alloc::vec;
use alloc::vec::Vec;

/// Residuals beyond this many σ (of two dimensions) have less weight.
const HUBER: f64 = 2.5;
/// Most steps of one round.
const STEPS: usize = 60;
/// Rounds of the weights.
const ROUNDS: usize = 5;
/// A round has converged when a step changes the cost by less than this share.
const STILL: f64 = 1e-9;
/// Least σ, px: exact observations have no noise from which weights could follow.
const LEAST_SIGMA: f64 = 1e-4;
/// First σ of camera and projector, px.
const FIRST_SIGMA: [f64; 2] = [0.3, 0.3];

/// The residuals of corners in the camera or of nodes in the projector; each has two components.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Sum of squared distances, px².
    pub squares: f64,
    /// Number of points.
    pub points: usize,
}

impl Residuals {
    /// RMS of the distances, px.
    pub fn rms(&self) -> f64 {
        libm::sqrt(self.squares / self.points.max(1) as f64)
    }

    /// The residuals of both together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            squares: self.squares + other.squares,
            points: self.points + other.points,
        }
    }
}

/// An adjusted rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// The rig.
    pub rig: Rig,
    /// Residuals of camera and projector in each pose.
    pub residuals: Vec<[Residuals; 2]>,
    /// σ of one coordinate of camera and of projector, px.
    pub sigma: [f64; 2],
    /// Covariance of the rig's numbers, row-major, in the order of [`Rig::moved`]; rows of fixed
    /// numbers are 0.
    pub(super) covariance: Vec<f64>,
}

/// The observations do not determine the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the poses do not determine the models: show the board tilted to all sides, near and far, and all over the picture"
)]
pub struct Undetermined;

/// Whether a number is adjusted. k₃ stays 0: over a frame its effect beside k₁ and k₂ is smaller than
/// the uncertainty that it adds.
fn is_free(number: usize, bowed: bool) -> bool {
    match number {
        at if at < 2 * LENS => at % LENS != LENS - 1,
        at if (SHARED - 3..SHARED).contains(&at) => bowed,
        _ => true,
    }
}

/// Adjusts a rig from first values, with the board's bow if it is `bowed`.
///
/// # Errors
/// If the views do not determine it.
pub(super) fn adjust(
    first: Rig,
    views: &[BoardView],
    bowed: bool,
) -> Result<Adjusted, Undetermined> {
    let free: Vec<usize> = (0..first.numbers())
        .filter(|&at| is_free(at, bowed))
        .collect();
    let mut problem = Adjustment {
        views,
        free,
        sigma: FIRST_SIGMA,
    };
    let mut rig = first;
    for _ in 0..ROUNDS {
        rig = problem.round(rig)?;
        let sigma = problem.estimated(&rig).ok_or(Undetermined)?;
        let same = |(a, b): (&f64, &f64)| libm::fabs(a - b) < 0.01 * b;
        let settled = problem.sigma.iter().zip(&sigma).all(same);
        problem.sigma = sigma;
        if settled {
            break;
        }
    }
    let residuals = problem.residuals(&rig).ok_or(Undetermined)?;
    let covariance = problem.covariance(&rig).ok_or(Undetermined)?;
    Ok(Adjusted {
        residuals,
        sigma: problem.sigma,
        covariance,
        rig,
    })
}

pub(super) struct Adjustment<'a> {
    pub views: &'a [BoardView],
    /// The numbers that are adjusted.
    pub free: Vec<usize>,
    pub sigma: [f64; 2],
}

/// Normal equations scaled to a diagonal of ones.
struct ScaledNormal {
    /// The lower triangle, row-major.
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// 1/√ of the diagonal before it was scaled: the unknowns are the solution times these factors.
    scale: Vec<f64>,
}

impl Adjustment<'_> {
    /// Steps until the cost stands still.
    fn round(&self, first: Rig) -> Result<Rig, Undetermined> {
        let mut rig = first;
        let mut cost = self.cost(&rig).ok_or(Undetermined)?;
        let mut damping = 1e-4;
        for _ in 0..STEPS {
            let normal = self.normal(&rig).ok_or(Undetermined)?;
            loop {
                let next = self.step(&normal, damping).map(|by| rig.moved(&by));
                let found = next.as_ref().and_then(|next| self.cost(next));
                if let (Some(next), Some(found)) = (next, found)
                    && found <= cost
                {
                    let gained = cost - found;
                    (rig, cost, damping) = (next, found, (damping * 0.1).max(1e-12));
                    if gained <= STILL * cost {
                        return Ok(rig);
                    }
                    break;
                }
                damping *= 10.0;
                if damping > 1e8 {
                    return Ok(rig);
                }
            }
        }
        Ok(rig)
    }

    /// Changes of all numbers by one damped step.
    fn step(&self, normal: &ScaledNormal, damping: f64) -> Option<Vec<f64>> {
        let n = self.free.len();
        let (mut damped, mut solved) = (normal.matrix.clone(), normal.right.clone());
        for i in 0..n {
            damped[i * n + i] = 1.0 + damping;
        }
        solve_symmetric(&mut damped, &mut solved)?;
        let mut by = vec![0.0; SHARED + POSE * self.views.len()];
        for ((&at, x), s) in self.free.iter().zip(&solved).zip(&normal.scale) {
            by[at] = x * s;
        }
        Some(by)
    }

    /// Residuals of one view: camera, then projector.
    pub(super) fn view(&self, rig: &Rig, at: usize) -> Option<Vec<[f64; 2]>> {
        let (view, pose) = (&self.views[at], &rig.poses[at]);
        let mut all = Vec::with_capacity(view.found.corners.len() + view.nodes.len());
        for (corner, place) in places(rig, view) {
            let (u, v) = rig.corner(pose, place)?;
            all.push([corner.0 - u, corner.1 - v]);
        }
        for node in &view.nodes {
            let (xi, eta) = rig.node(pose, node.at)?;
            all.push([node.lit_by.0 - xi, node.lit_by.1 - eta]);
        }
        Some(all)
    }

    /// σ of the residuals of a view, in their order.
    fn sigmas(&self, at: usize) -> impl Iterator<Item = f64> + '_ {
        let corners = self.views[at].found.located();
        let [camera, projector] = self.sigma;
        (0..).map(move |at| if at < corners { camera } else { projector })
    }

    fn cost(&self, rig: &Rig) -> Option<f64> {
        let mut sum = 0.0;
        for at in 0..self.views.len() {
            for (residual, sigma) in self.view(rig, at)?.iter().zip(self.sigmas(at)) {
                let r = libm::hypot(residual[0], residual[1]) / sigma;
                sum += if r <= HUBER {
                    r * r
                } else {
                    HUBER * (2.0 * r - HUBER)
                };
            }
        }
        sum.is_finite().then_some(sum)
    }

    /// The normal equations over the free numbers.
    fn normal(&self, rig: &Rig) -> Option<ScaledNormal> {
        let n = self.free.len();
        let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for at in 0..self.views.len() {
            let residuals = self.view(rig, at)?;
            let slopes = self.slopes(rig, at)?;
            for (k, (residual, sigma)) in residuals.iter().zip(self.sigmas(at)).enumerate() {
                let weight = weight(*residual, sigma) / (sigma * sigma);
                for (a, (i, own)) in slopes.iter().enumerate() {
                    let slope = own[k].map(|slope| slope * weight);
                    right[*i] += slope[0] * residual[0] + slope[1] * residual[1];
                    for (j, other) in &slopes[..=a] {
                        matrix[i * n + j] += slope[0] * other[k][0] + slope[1] * other[k][1];
                    }
                }
            }
        }
        let scale = |i: usize| {
            let diagonal = matrix[i * n + i];
            (diagonal > 0.0).then(|| 1.0 / libm::sqrt(diagonal))
        };
        let scale = (0..n).map(scale).collect::<Option<Vec<f64>>>()?;
        for i in 0..n {
            for j in 0..=i {
                matrix[i * n + j] *= scale[i] * scale[j];
            }
            right[i] *= scale[i];
        }
        Some(ScaledNormal {
            matrix,
            right,
            scale,
        })
    }

    /// The places in `free` of the numbers that a view depends on, and the derivatives of its
    /// predictions with each.
    pub(super) fn slopes(&self, rig: &Rig, at: usize) -> Option<Vec<(usize, Vec<[f64; 2]>)>> {
        let own = SHARED + POSE * at..SHARED + POSE * (at + 1);
        let numbers = self.free.iter().enumerate();
        numbers
            .filter(|(_, number)| **number < SHARED || own.contains(number))
            .map(|(i, number)| Some((i, self.slope(rig, at, *number)?)))
            .collect()
    }

    /// Derivatives of a view's predictions with one number.
    fn slope(&self, rig: &Rig, at: usize, number: usize) -> Option<Vec<[f64; 2]>> {
        let step = step_of(number);
        let moved = |by: f64| {
            let mut all = vec![0.0; rig.numbers()];
            all[number] = by;
            self.view(&rig.moved(&all), at)
        };
        let (after, before) = (moved(step)?, moved(-step)?);
        let slope = |(a, b): (&[f64; 2], &[f64; 2])| {
            // Residuals are observed − predicted.
            [(b[0] - a[0]) / (2.0 * step), (b[1] - a[1]) / (2.0 * step)]
        };
        Some(after.iter().zip(&before).map(slope).collect())
    }

    fn residuals(&self, rig: &Rig) -> Option<Vec<[Residuals; 2]>> {
        let sum = |all: &[[f64; 2]]| Residuals {
            squares: all.iter().map(|r| r[0] * r[0] + r[1] * r[1]).sum(),
            points: all.len(),
        };
        let views = 0..self.views.len();
        let split = |at: usize| {
            let all = self.view(rig, at)?;
            let corners = self.views[at].found.located();
            Some([sum(&all[..corners]), sum(&all[corners..])])
        };
        views.map(split).collect()
    }

    /// σ of both devices from their residuals: Σ w r² over the redundancy, shared in proportion to
    /// the observations.
    fn estimated(&self, rig: &Rig) -> Option<[f64; 2]> {
        let (mut sums, mut weights) = ([0.0; 2], [0.0; 2]);
        for at in 0..self.views.len() {
            let corners = self.views[at].found.located();
            let residuals = self.view(rig, at)?;
            for (k, (residual, sigma)) in residuals.iter().zip(self.sigmas(at)).enumerate() {
                let device = usize::from(k >= corners);
                let weight = weight(*residual, sigma);
                let square = residual[0] * residual[0] + residual[1] * residual[1];
                sums[device] += weight * square;
                weights[device] += 2.0 * weight;
            }
        }
        let all = weights[0] + weights[1];
        let left = 1.0 - self.free.len() as f64 / all;
        let sigma = |device: usize| {
            let redundancy = weights[device] * left;
            (redundancy > 0.0).then(|| libm::sqrt(sums[device] / redundancy).max(LEAST_SIGMA))
        };
        Some([sigma(0)?, sigma(1)?])
    }

    fn covariance(&self, rig: &Rig) -> Option<Vec<f64>> {
        let ScaledNormal { matrix, scale, .. } = self.normal(rig)?;
        let n = self.free.len();
        let mut inverse = vec![0.0; n * n];
        for i in 0..n {
            let mut column = vec![0.0; n];
            column[i] = 1.0;
            solve_symmetric(&mut matrix.clone(), &mut column)?;
            for j in 0..n {
                inverse[i * n + j] = column[j] * scale[i] * scale[j];
            }
        }
        let covariance_of_print = self.covariance_of_print(rig, &inverse)?;
        let all = rig.numbers();
        let mut covariance = vec![0.0; all * all];
        for i in 0..n {
            for j in 0..n {
                covariance[self.free[i] * all + self.free[j]] =
                    inverse[i * n + j] + covariance_of_print[i * n + j];
            }
        }
        Some(covariance)
    }
}

/// Located corners of a view and their places on the board.
pub(super) fn places<'a>(
    rig: &'a Rig,
    view: &'a BoardView,
) -> impl Iterator<Item = ((f64, f64), (f64, f64))> + 'a {
    let corners = view.found.corners.iter().enumerate();
    corners.filter_map(|(at, corner)| {
        let corner = (*corner)?;
        Some(((corner.u, corner.v), rig.board.place(at)))
    })
}

/// Huber's weight.
pub(super) fn weight(residual: [f64; 2], sigma: f64) -> f64 {
    let r = libm::hypot(residual[0], residual[1]) / sigma;
    if r <= HUBER { 1.0 } else { HUBER / r }
}

/// Step of a number's differences: its effect on a pixel is about 1e-3 px, where the predictions
/// are exact to 1e-10.
pub(super) fn step_of(number: usize) -> f64 {
    let in_lens = |at: usize| if at < 4 { 1e-2 } else { 1e-5 };
    let in_pose = |at: usize| if at < 3 { 1e-6 } else { 1e-3 };
    match number {
        at if at < 2 * LENS => in_lens(at % LENS),
        at if at < 2 * LENS + POSE => in_pose(at - 2 * LENS),
        at if at < SHARED => 1e-3,
        at => in_pose((at - SHARED) % POSE),
    }
}

/// One residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Place in the device's picture, px.
    pub at: (f64, f64),
    /// What was seen minus what the models predict, px.
    pub off: (f64, f64),
}

impl Adjusted {
    /// The residuals of one pose: of its corners in the camera, and of its nodes in the projector.
    pub fn arrows(&self, pose: usize, view: &BoardView) -> [Vec<Arrow>; 2] {
        let (rig, lies) = (&self.rig, &self.rig.poses[pose]);
        let arrow = |at: (f64, f64), predicted: (f64, f64)| Arrow {
            at,
            off: (at.0 - predicted.0, at.1 - predicted.1),
        };
        let corners = places(rig, view)
            .filter_map(|(corner, place)| Some(arrow(corner, rig.corner(lies, place)?)));
        let nodes = view
            .nodes
            .iter()
            .filter_map(|node| Some(arrow(node.lit_by, rig.node(lies, node.at)?)));
        [corners.collect(), nodes.collect()]
    }
}
