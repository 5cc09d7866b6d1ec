//! What is adjusted: both lenses, the projector's pose to the camera, the board's pose in each
//! picture, and the board's bow.

use super::board::Board;
use super::pose::Pose;
use crate::geometry::{Lens, PinholeModel, Vector};
use alloc::vec::Vec;

/// Numbers of a lens: f_x, f_y, c_x, c_y, k₁, k₂, p₁, p₂, k₃.
pub(super) const LENS: usize = 9;
/// Numbers that all poses of the board share: two lenses, the relative pose, the bow.
pub(super) const SHARED: usize = 2 * LENS + 6 + 3;
/// Numbers of a pose.
pub(super) const POSE: usize = 6;
/// Rounds that find the point of a bowed board on a ray: each gains a factor of the board's slope,
/// 1e-3.
const ROUNDS: usize = 4;

/// The geometry of a head and of the poses of a board in front of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The board as it was made.
    pub board: Board,
    /// The camera's lens.
    pub camera: Lens,
    /// The projector's lens.
    pub projector: Lens,
    /// From the camera's coordinates to the projector's.
    pub relative: Pose,
    /// From the board's coordinates to the camera's, pose by pose.
    pub poses: Vec<Pose>,
    /// The board's bow in mm: its surface is z = b₀(X² − m) + b₁(Y² − m') + b₂XY with X and Y from
    /// −1 to 1 over the corners and m, m' the means of X² and Y² over them, so that the corners are
    /// in the plane z = 0 on average.
    pub bow: [f64; 3],
}

impl Rig {
    /// How many numbers are adjusted.
    pub(super) fn numbers(&self) -> usize {
        SHARED + POSE * self.poses.len()
    }

    /// The rig with `by` added to its numbers: camera, projector, relative pose, bow, then the
    /// poses.
    pub(super) fn moved(&self, by: &[f64]) -> Self {
        let (camera, by) = by.split_at(LENS);
        let (projector, by) = by.split_at(LENS);
        let (relative, by) = by.split_at(POSE);
        let (bow, by) = by.split_at(3);
        let [a, b, c] = self.bow;
        Self {
            board: self.board,
            camera: lens_moved(&self.camera, camera),
            projector: lens_moved(&self.projector, projector),
            relative: self.relative.moved(relative),
            poses: self
                .poses
                .iter()
                .zip(by.chunks(POSE))
                .map(|(pose, by)| pose.moved(by))
                .collect(),
            bow: [a + bow[0], b + bow[1], c + bow[2]],
        }
    }

    /// Height of the board above its plane at a place, mm.
    fn height(&self, x: f64, y: f64) -> f64 {
        let half = |corners: usize| (corners.max(2) - 1) as f64 * self.board.square / 2.0;
        let (x, y) = (x / half(self.board.columns), y / half(self.board.rows));
        // Mean of X² over n equal steps from −1 to 1: (n + 1) / 3(n − 1).
        let mean = |corners: usize| {
            let n = corners.max(2) as f64;
            (n + 1.0) / (3.0 * (n - 1.0))
        };
        let [a, b, c] = self.bow;
        a * (x * x - mean(self.board.columns)) + b * (y * y - mean(self.board.rows)) + c * x * y
    }

    /// Camera pixel of a corner in a pose.
    pub(super) fn corner(&self, pose: &Pose, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        seen(
            &self.camera,
            pose.apply(Vector::new(x, y, self.height(x, y))),
        )
    }

    /// Projector pixel that lights what the camera sees of the board at a pixel.
    pub(super) fn node(&self, pose: &Pose, (u, v): (f64, f64)) -> Option<(f64, f64)> {
        let (x, y) = self.camera.undistorted(u, v)?;
        let ray = Vector::new(x, y, 1.0);
        let on_board = self.on_board(pose, ray)?;
        seen(&self.projector, self.relative.apply(on_board))
    }

    /// The point of the board on a ray from the camera, in the camera's coordinates.
    fn on_board(&self, pose: &Pose, ray: Vector) -> Option<Vector> {
        let back = pose.inverse();
        let (from, along) = (back.shift, back.turned(ray));
        if !(libm::fabs(along.z) > 1e-6) {
            return None;
        }
        let mut z = 0.0;
        for _ in 0..ROUNDS {
            let far = (z - from.z) / along.z;
            z = self.height(from.x + along.x * far, from.y + along.y * far);
        }
        Some(ray * ((z - from.z) / along.z))
    }

    /// Models of camera and projector with the board's plane in a pose as the world's z = 0.
    pub fn models(&self, pose: usize) -> (PinholeModel, PinholeModel) {
        let world = self.poses[pose];
        (
            model(&self.camera, &world),
            model(&self.projector, &self.relative.after(&world)),
        )
    }
}

/// The pixel that sees a point in the device's coordinates.
pub(super) fn seen(lens: &Lens, point: Vector) -> Option<(f64, f64)> {
    let depth = point.z;
    (depth > 0.0).then(|| lens.pixel(point.x / depth, point.y / depth))
}

fn lens_moved(lens: &Lens, by: &[f64]) -> Lens {
    let mut distortion = lens.distortion;
    distortion
        .iter_mut()
        .zip(&by[4..])
        .for_each(|(k, by)| *k += by);
    Lens {
        fx: lens.fx + by[0],
        fy: lens.fy + by[1],
        cx: lens.cx + by[2],
        cy: lens.cy + by[3],
        distortion,
    }
}

fn model(lens: &Lens, world: &Pose) -> PinholeModel {
    let [a, b, c] = world.rows;
    PinholeModel {
        fx: lens.fx,
        fy: lens.fy,
        cx: lens.cx,
        cy: lens.cy,
        distortion: lens.distortion,
        rotation: [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z],
        translation: [world.shift.x, world.shift.y, world.shift.z],
    }
}
