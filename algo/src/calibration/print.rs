//! Errors of the board's print: a corner that is printed off its place is off in all poses, so more
//! poses do not average it out.
//!
//! Let d be the displacement of a corner on the board. Its residuals in the poses that see it are B
//! d and noise, with B the derivative of the corner's pixel with its place; with the weights w,
//! d̂ = (Σ Bᵀ w B)⁻¹ Σ Bᵀ w r. The mean square of d̂ over the corners, less the mean of (Σ Bᵀ w
//! B)⁻¹, which noise alone would leave, is σ_d² (a component of variance, as in W. Förstner, 1979),
//! with the share restored that the adjusted numbers have taken out of the residuals. A
//! displacement moves the adjusted numbers by N⁻¹ G d, with G = Σ Jᵀ w B over the poses, so the
//! covariance N⁻¹, which takes residuals to be independent, grows by σ_d² N⁻¹ (Σ G Gᵀ) N⁻¹
//! (propagation of covariance). What looks like another lens or pose, as a print that is stretched
//! or sheared smoothly, leaves no residuals: it is not seen here.
//!
//! Held by `the_predicted_errors_cover_the_true_ones_of_50_heads_with_a_bad_print`.

use super::adjust::{Problem, weight};
use super::rig::{POSE, Rig, SHARED};
use alloc::vec;
use alloc::vec::Vec;

/// Step of a corner's place, mm.
const STEP: f64 = 1e-3;
/// Fewer corners than this in several poses say nothing of the print.
const LEAST: usize = 12;

/// What the poses say of one corner, in board coordinates.
#[derive(Clone)]
struct Shared {
    /// Poses that see it.
    poses: usize,
    /// Σ Bᵀ w B: xx, xy, yy.
    normal: [f64; 3],
    /// Σ Bᵀ w r.
    right: [f64; 2],
    /// Σ Jᵀ w B over the free numbers.
    moves: Vec<[f64; 2]>,
}

impl Problem<'_> {
    /// σ_d² N⁻¹ (Σ G Gᵀ) N⁻¹ over the free numbers; `inverse` is N⁻¹.
    pub(super) fn of_print(&self, rig: &Rig, inverse: &[f64]) -> Option<Vec<f64>> {
        let n = self.free.len();
        let none = Shared {
            poses: 0,
            normal: [0.0; 3],
            right: [0.0; 2],
            moves: vec![[0.0; 2]; n],
        };
        let mut corners = vec![none; rig.board.corners()];
        for at in 0..self.views.len() {
            self.gather(rig, at, &mut corners)?;
        }
        corners.retain(|corner| corner.poses > 1);
        let variance = self.variance_of_print(&corners);
        let mut added = vec![0.0; n * n];
        if !(variance > 0.0) {
            return Some(added);
        }
        for corner in &corners {
            for axis in 0..2 {
                // N⁻¹ G: the change of each number per mm.
                let change: Vec<f64> = (0..n)
                    .map(|i| {
                        let row = inverse[i * n..(i + 1) * n].iter();
                        row.zip(&corner.moves).map(|(a, b)| a * b[axis]).sum()
                    })
                    .collect();
                for (i, a) in change.iter().enumerate() {
                    for (j, b) in change.iter().enumerate() {
                        added[i * n + j] += variance * a * b;
                    }
                }
            }
        }
        Some(added)
    }

    /// Adds what one view says of its corners.
    fn gather(&self, rig: &Rig, at: usize, corners: &mut [Shared]) -> Option<()> {
        let (view, pose) = (&self.views[at], &rig.poses[at]);
        let residuals = self.view(rig, at)?;
        let own = SHARED + POSE * at..SHARED + POSE * (at + 1);
        let mut slopes = Vec::new();
        for (i, &number) in self.free.iter().enumerate() {
            if number < SHARED || own.contains(&number) {
                slopes.push((i, self.slopes(rig, at, number)?));
            }
        }
        let seen = view.found.corners.iter().enumerate();
        let seen = seen.filter(|(_, corner)| corner.is_some());
        for (k, (corner, _)) in seen.enumerate() {
            let (x, y) = rig.board.place(corner);
            let slope = |dx: f64, dy: f64| {
                let (a, b) = (
                    rig.corner(pose, (x + dx, y + dy))?,
                    rig.corner(pose, (x - dx, y - dy))?,
                );
                Some([(a.0 - b.0) / (2.0 * STEP), (a.1 - b.1) / (2.0 * STEP)])
            };
            let by = [slope(STEP, 0.0)?, slope(0.0, STEP)?];
            let sigma = self.sigma[0];
            let w = weight(residuals[k], sigma) / (sigma * sigma);
            let dot = |a: [f64; 2], b: [f64; 2]| w * (a[0] * b[0] + a[1] * b[1]);
            let shared = &mut corners[corner];
            shared.poses += 1;
            shared.normal[0] += dot(by[0], by[0]);
            shared.normal[1] += dot(by[0], by[1]);
            shared.normal[2] += dot(by[1], by[1]);
            for (axis, by) in by.into_iter().enumerate() {
                shared.right[axis] += dot(by, residuals[k]);
                for (i, slopes) in &slopes {
                    shared.moves[*i][axis] += dot(slopes[k], by);
                }
            }
        }
        Some(())
    }

    /// σ_d², mm²; 0 where the residuals show no more than noise.
    fn variance_of_print(&self, corners: &[Shared]) -> f64 {
        if corners.len() < LEAST {
            return 0.0;
        }
        let (mut found, mut noise) = (0.0, 0.0);
        for corner in corners {
            let [xx, xy, yy] = corner.normal;
            let [x, y] = corner.right;
            let determinant = xx * yy - xy * xy;
            let d = [
                (yy * x - xy * y) / determinant,
                (xx * y - xy * x) / determinant,
            ];
            found += d[0] * d[0] + d[1] * d[1];
            noise += (xx + yy) / determinant;
        }
        let coordinates = 2.0 * corners.len() as f64;
        // Of the coordinates of all displacements, as many look like changes of the adjusted
        // numbers as all poses share, and one pose has, of these numbers.
        let shared = self.free.iter().filter(|&&at| at < SHARED + POSE).count() as f64;
        let left = 1.0 - (shared / coordinates).min(0.75);
        (found / left - noise) / coordinates
    }
}
