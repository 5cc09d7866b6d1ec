//! The uncertainty of a calibration, σ of heights and lengths that are measured with it, and the
//! board as the calibrated head measures it.
//!
//! # Errors of the board's print
//!
//! A corner that is printed off its place is off in all poses, so more poses do not average it out.
//!
//! Let d be the displacement of a corner on the board. Its residuals in the poses that see it are B
//! d and noise, with B the derivative of the corner's pixel with its place; with the weights w,
//! d̂ = (Σ Bᵀ w B)⁻¹ Σ Bᵀ w r. The mean square of d̂ over the corners, less the mean of (Σ Bᵀ w
//! B)⁻¹, which noise alone would leave, is σ_d² (a component of variance, as in W. Förstner, 1979),
//! with the share restored that the adjusted numbers have taken out of the residuals. A
//! displacement moves the adjusted numbers by N⁻¹ G d, with G = Σ Jᵀ w B over the poses, so the
//! covariance N⁻¹, which takes residuals to be independent, grows by σ_d² N⁻¹ (Σ G Gᵀ) N⁻¹
//! (propagation of covariance). A smooth stretch or shear of the print looks like another lens or
//! pose and leaves no residuals: it is not seen here.
//!
//! Held by `the_predicted_errors_cover_the_true_ones_of_50_heads_with_a_bad_print`.
//!
//! # Measured points
//!
//! A measured point is where the camera's ray of a pixel meets what the projector's ξ gives; a
//! change of the rig's numbers p moves it. With the gradient g = ∂z/∂p of a height, or of a
//! distance between two points, σ² = gᵀ C g (propagation of covariance, as in photogrammetry: E.
//! Mikhail, F. Ackermann, "Observations and Least Squares", 1976). The scale of the board is not
//! seen by any residual: its own σ is added.

use super::adjust::{Adjusted, Adjustment, step_of, weight};
use super::look::BoardView;
use super::rig::{POSE, Rig, SHARED, ray, seen};
use crate::geometry::Vector;
use crate::math::solve::Normal;
use alloc::vec;
use alloc::vec::Vec;

/// Step of the numeric derivatives with a corner's place on the board, mm.
const PLACE_STEP: f64 = 1e-3;
/// With fewer corners that several poses see, σ_d is taken as 0.
const LEAST_CORNERS: usize = 12;
/// Newton steps to a measured point; ξ is nearly linear in z.
const NEWTON_STEPS: usize = 8;
/// Points of the measuring volume along each axis.
const GRID_POINTS: usize = 5;
/// The volume is this share of the box about all corners of all poses.
const INNER: f64 = 0.8;
/// Length whose σ is reported, mm.
pub const LENGTH: f64 = 100.0;

/// What the poses say of one corner, in board coordinates.
#[derive(Clone, Default)]
struct PrintedCorner {
    /// Poses that see it.
    poses: usize,
    /// Σ Bᵀ w B: xx, xy, yy.
    normal: [f64; 3],
    /// Σ Bᵀ w r.
    right: [f64; 2],
    /// Σ Jᵀ w B over the free numbers.
    moves: Vec<[f64; 2]>,
}

impl Adjustment<'_> {
    /// σ_d² N⁻¹ (Σ G Gᵀ) N⁻¹ over the free numbers; `inverse` is N⁻¹.
    pub(super) fn covariance_of_print(&self, rig: &Rig, inverse: &[f64]) -> Option<Vec<f64>> {
        let n = self.free.len();
        let unseen = PrintedCorner {
            moves: vec![[0.0; 2]; n],
            ..PrintedCorner::default()
        };
        let mut corners = vec![unseen; rig.board.corners()];
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
    fn gather(&self, rig: &Rig, at: usize, corners: &mut [PrintedCorner]) -> Option<()> {
        let (view, pose) = (&self.views[at], &rig.poses[at]);
        let residuals = self.view(rig, at)?;
        let slopes = self.slopes(rig, at)?;
        let seen = view.found.corners.iter().enumerate();
        let seen = seen.filter(|(_, corner)| corner.is_some());
        for (k, (corner, _)) in seen.enumerate() {
            let (x, y) = rig.board.place(corner);
            let slope = |dx: f64, dy: f64| {
                let (a, b) = (
                    rig.corner(pose, (x + dx, y + dy))?,
                    rig.corner(pose, (x - dx, y - dy))?,
                );
                Some([
                    (a.0 - b.0) / (2.0 * PLACE_STEP),
                    (a.1 - b.1) / (2.0 * PLACE_STEP),
                ])
            };
            let by = [slope(PLACE_STEP, 0.0)?, slope(0.0, PLACE_STEP)?];
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
    fn variance_of_print(&self, corners: &[PrintedCorner]) -> f64 {
        if corners.len() < LEAST_CORNERS {
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

/// A point that is measured: camera pixel and ξ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    pub at: Vector,
    pub pixel: (f64, f64),
    pub xi: f64,
}

/// Predicted errors of measurements with a calibration, without the noise of the measurement
/// itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// RMS of σ_z over the measuring volume, mm.
    pub height: f64,
    /// Largest σ_z in it, mm.
    pub worst_height: f64,
    /// σ of a length of 100 mm, RMS over lengths along x, y and z, mm.
    pub length: f64,
    /// Corners of the measuring volume, mm.
    pub volume: [Vector; 2],
}

impl Adjusted {
    /// σ of heights above the board's plane in the last pose, and of lengths. `scale` is σ of the
    /// board's own scale, relative.
    pub fn prediction(
        &self,
        frame: (usize, usize),
        raster: (usize, usize),
        scale: f64,
    ) -> Option<Prediction> {
        let volume = self.rig.volume()?;
        let targets = self.rig.targets(volume, frame, raster);
        let (mut squares, mut worst) = (0.0, 0.0_f64);
        for target in &targets {
            let height = |rig: &Rig| Some(rig.measured(target)?.z);
            let by_scale = scale * target.at.z;
            let variance = self.variance(&height)? + by_scale * by_scale;
            squares += variance;
            worst = worst.max(variance);
        }
        let mut lengths = (0.0, 0.0);
        for (from, to) in self.rig.lengths(&targets, volume) {
            let distance = |rig: &Rig| Some((rig.measured(&to)? - rig.measured(&from)?).length());
            let far = (to.at - from.at).length();
            let to_reported = LENGTH / far;
            let variance = self.variance(&distance)? * to_reported * to_reported;
            lengths = (
                lengths.0 + variance + scale * scale * LENGTH * LENGTH,
                lengths.1 + 1.0,
            );
        }
        Some(Prediction {
            height: libm::sqrt(squares / targets.len() as f64),
            worst_height: libm::sqrt(worst),
            length: libm::sqrt(lengths.0 / f64::max(lengths.1, 1.0)),
            volume,
        })
    }

    /// gᵀ C g of a quantity.
    fn variance(&self, quantity: &dyn Fn(&Rig) -> Option<f64>) -> Option<f64> {
        let n = self.rig.numbers();
        let mut gradient = vec![0.0; n];
        for (at, slope) in gradient.iter_mut().enumerate() {
            if self.covariance[at * n + at] > 0.0 {
                let step = step_of(at);
                let mut by = vec![0.0; n];
                by[at] = step;
                let after = quantity(&self.rig.moved(&by))?;
                by[at] = -step;
                *slope = (after - quantity(&self.rig.moved(&by))?) / (2.0 * step);
            }
        }
        let mut sum = 0.0;
        for (i, a) in gradient.iter().enumerate() {
            for (j, b) in gradient.iter().enumerate() {
                sum += a * self.covariance[i * n + j] * b;
            }
        }
        Some(sum)
    }
}

impl Rig {
    /// The box of [`INNER`] about all corners of all poses, in the world of the last pose.
    pub(super) fn volume(&self) -> Option<[Vector; 2]> {
        let world = self.poses.last()?.inverse();
        let mut low = Vector::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let mut high = low * -1.0;
        for pose in &self.poses {
            for corner in 0..self.board.corners() {
                let (x, y) = self.board.place(corner);
                let p = world.apply(pose.apply(Vector::new(x, y, 0.0)));
                low = Vector::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z));
                high = Vector::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z));
            }
        }
        let (middle, half) = ((low + high) * 0.5, (high - low) * (0.5 * INNER));
        Some([middle - half, middle + half])
    }

    /// Camera pixel and ξ of a point of the world; `None` if it is outside the frame or the raster.
    fn target(&self, at: Vector, frame: (usize, usize), raster: (usize, usize)) -> Option<Target> {
        let point = self.poses.last()?.apply(at);
        let pixel = seen(&self.camera, point)?;
        let (xi, eta) = seen(&self.projector, self.relative.apply(point))?;
        let inside = |(u, v): (f64, f64), (width, height): (usize, usize)| {
            u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0
        };
        (inside(pixel, frame) && inside((xi, eta), raster)).then_some(Target { at, pixel, xi })
    }

    /// A grid of points in the volume that camera and projector see.
    pub(super) fn targets(
        &self,
        [low, high]: [Vector; 2],
        frame: (usize, usize),
        raster: (usize, usize),
    ) -> Vec<Target> {
        let share = |at: usize| at as f64 / (GRID_POINTS - 1) as f64;
        let between = |low: f64, high: f64, at: usize| low + (high - low) * share(at);
        let all = 0..GRID_POINTS * GRID_POINTS * GRID_POINTS;
        all.filter_map(|at| {
            let place = Vector::new(
                between(low.x, high.x, at % GRID_POINTS),
                between(low.y, high.y, at / GRID_POINTS % GRID_POINTS),
                between(low.z, high.z, at / (GRID_POINTS * GRID_POINTS)),
            );
            self.target(place, frame, raster)
        })
        .collect()
    }

    /// Pairs of targets along each axis, at least half the volume apart.
    pub(super) fn lengths(
        &self,
        targets: &[Target],
        [low, high]: [Vector; 2],
    ) -> Vec<(Target, Target)> {
        let near = |a: f64, b: f64, size: f64| libm::fabs(a - b) < 1e-6 * size;
        let (size, mut pairs) = (high - low, Vec::new());
        for (i, a) in targets.iter().enumerate() {
            for b in &targets[i + 1..] {
                let along = [
                    (near(a.at.x, b.at.x, size.x), (b.at.x - a.at.x) / size.x),
                    (near(a.at.y, b.at.y, size.y), (b.at.y - a.at.y) / size.y),
                    (near(a.at.z, b.at.z, size.z), (b.at.z - a.at.z) / size.z),
                ];
                let same = along.iter().filter(|axis| axis.0).count();
                let far = along.iter().any(|axis| !axis.0 && libm::fabs(axis.1) > 0.7);
                if same == 2 && far {
                    pairs.push((*a, *b));
                }
            }
        }
        // About 48 pairs are enough for the sums.
        let every = (pairs.len() / 48).max(1);
        pairs.into_iter().step_by(every).collect()
    }

    /// Where this rig measures a target: the point of the pixel's ray whose ξ is the target's, in
    /// the world of the last pose.
    pub(super) fn measured(&self, target: &Target) -> Option<Vector> {
        let world = self.poses.last()?.inverse();
        let ray = ray(&self.camera, target.pixel)?;
        let (from, along) = (world.shift, world.turned(ray));
        let xi = |z: f64| {
            let point = ray * ((z - from.z) / along.z);
            seen(&self.projector, self.relative.apply(point)).map(|pixel| pixel.0)
        };
        let mut z = target.at.z;
        for _ in 0..NEWTON_STEPS {
            let slope = (xi(z + 1e-3)? - xi(z - 1e-3)?) / 2e-3;
            let off = (xi(z)? - target.xi) / slope;
            z -= off;
            if libm::fabs(off) < 1e-10 {
                break;
            }
        }
        Some(from + along * ((z - from.z) / along.z))
    }
}

/// A pose of the board as the calibrated head measures it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredBoard {
    /// Mean distance of neighbouring corners along x and along y, mm.
    pub pitch: (f64, f64),
    /// RMS distance of the measured points inside the squares from their plane, mm.
    pub flatness: f64,
}

impl Adjusted {
    /// Measures the board in one of its poses: nodes by triangulation, corners by the camera's rays
    /// on the nodes' plane. `None` if the pose has too few nodes.
    pub fn measured_board(&self, pose: usize, view: &BoardView) -> Option<MeasuredBoard> {
        let world = self.rig.poses.last()?.inverse();
        let board = self.rig.poses.get(pose)?;
        let centre = world.apply(board.shift);
        let points: Vec<Vector> = view
            .nodes
            .iter()
            .filter_map(|node| {
                self.rig.measured(&Target {
                    at: centre,
                    pixel: node.at,
                    xi: node.lit_by.0,
                })
            })
            .collect();
        let plane = plane(&points)?;
        let squares: f64 = points.iter().map(|&p| plane.off(p) * plane.off(p)).sum();
        let corner = |at: usize| {
            let corner = (*view.found.corners.get(at)?)?;
            let along = world.turned(ray(&self.rig.camera, (corner.u, corner.v))?);
            let far = -plane.off(world.shift) / plane.normal.dot(along);
            Some(world.shift + along * far)
        };
        let columns = self.rig.board.columns;
        let mean = |step: usize, inside: &dyn Fn(usize) -> bool| {
            let pairs = (0..self.rig.board.corners()).filter(|&at| inside(at));
            let lengths = pairs.filter_map(|at| Some((corner(at + step)? - corner(at)?).length()));
            let (sum, n) = lengths.fold((0.0, 0.0), |(sum, n), length| (sum + length, n + 1.0));
            sum / f64::max(n, 1.0)
        };
        Some(MeasuredBoard {
            pitch: (
                mean(1, &|at| (at + 1) % columns != 0),
                mean(columns, &|_| true),
            ),
            flatness: libm::sqrt(squares / points.len() as f64),
        })
    }
}

/// A plane n·p = d.
struct BoardPlane {
    normal: Vector,
    distance: f64,
}

impl BoardPlane {
    fn off(&self, point: Vector) -> f64 {
        self.normal.dot(point) - self.distance
    }
}

/// The plane z = a + bx + cy of least squares.
fn plane(points: &[Vector]) -> Option<BoardPlane> {
    let [a, b, c] = Normal::of(points.iter().map(|p| ([1.0, p.x, p.y], p.z))).solve()?;
    let normal = Vector::new(-b, -c, 1.0);
    let length = normal.length();
    Some(BoardPlane {
        normal: normal * (1.0 / length),
        distance: a / length,
    })
}
