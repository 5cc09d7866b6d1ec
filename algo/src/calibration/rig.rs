//! What is adjusted: both lenses, the projector's pose to the camera, the board's pose in each
//! picture, and the board's bow; and how the board stands to camera and projector.

use super::board::Board;
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
/// A normal that is inclined by more than this to the plane of both lines of sight, or lies within
/// that plane but by more than this outside the angle between the lines, is hardly that of the
/// plane z = 0 of a head, rad.
const MOST_ASIDE: f64 = 10.0 / 180.0 * core::f64::consts::PI;

/// A rigid motion from one frame of coordinates to another: X' = R·X + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rows of R.
    pub rows: [Vector; 3],
    /// t, mm.
    pub shift: Vector,
}

impl Pose {
    /// The point in the other frame.
    #[inline]
    pub fn apply(&self, point: Vector) -> Vector {
        self.turned(point) + self.shift
    }

    /// The direction in the other frame.
    #[inline]
    pub fn turned(&self, direction: Vector) -> Vector {
        let [x, y, z] = self.rows.map(|row| row.dot(direction));
        Vector::new(x, y, z)
    }

    /// Back from the other frame.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let [a, b, c] = self.rows;
        let rows = [
            Vector::new(a.x, b.x, c.x),
            Vector::new(a.y, b.y, c.y),
            Vector::new(a.z, b.z, c.z),
        ];
        let back = Self {
            rows,
            shift: Vector::default(),
        };
        Self {
            shift: back.turned(self.shift) * -1.0,
            ..back
        }
    }

    /// The motion that consists of `first` and then of this one.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        // Row i of R·F is Fᵀ applied to row i of R.
        let transposed = first.inverse();
        Self {
            rows: self.rows.map(|row| transposed.turned(row)),
            shift: self.apply(first.shift),
        }
    }

    /// This pose with a small turn (rotation vector, rad) after R and a shift added to t, given as
    /// one list: turn, then shift.
    #[must_use]
    pub fn moved(&self, by: &[f64]) -> Self {
        let turn = Vector::new(by[0], by[1], by[2]);
        let shift = Vector::new(by[3], by[4], by[5]);
        let angle = turn.length();
        if angle == 0.0 {
            return Self {
                shift: self.shift + shift,
                ..*self
            };
        }
        // Rodrigues' formula, applied to the columns of R.
        let axis = turn * (1.0 / angle);
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let columns = self.inverse().rows.map(|column| {
            column * cos + axis.cross(column) * sin + axis * (axis.dot(column) * (1.0 - cos))
        });
        let turned = Self {
            rows: columns,
            shift: Vector::default(),
        };
        Self {
            rows: turned.inverse().rows,
            shift: self.shift + shift,
        }
    }

    /// The pose whose x and y axes are nearly `x` and `y`: made orthogonal, of length 1 and
    /// right-handed.
    pub(super) fn from_axes(x: Vector, y: Vector, shift: Vector) -> Self {
        let x = x * (1.0 / x.length());
        let y = y * (1.0 / y.length());
        // Both axes are turned by the same angle until they are at right angles.
        let (sum, difference) = (x + y, x - y);
        let sum = sum * (core::f64::consts::FRAC_1_SQRT_2 / sum.length());
        let difference = difference * (core::f64::consts::FRAC_1_SQRT_2 / difference.length());
        let (x, y) = (sum + difference, sum - difference);
        let columns = Self {
            rows: [x, y, x.cross(y)],
            shift: Vector::default(),
        };
        Self {
            rows: columns.inverse().rows,
            shift,
        }
    }
}

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
    pub(super) fn node(&self, pose: &Pose, pixel: (f64, f64)) -> Option<(f64, f64)> {
        let on_board = self.on_board(pose, ray(&self.camera, pixel)?)?;
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

/// The direction, in the device's coordinates, in which a pixel sees.
pub(super) fn ray(lens: &Lens, (u, v): (f64, f64)) -> Option<Vector> {
    let (x, y) = lens.undistorted(u, v)?;
    Some(Vector::new(x, y, 1.0))
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

/// Angles of the board's normal to the lines from its centre to the devices, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// To the camera.
    pub camera: f64,
    /// To the projector.
    pub projector: f64,
    /// Out of the plane of both lines.
    pub aside: f64,
    /// Between both lines.
    pub between: f64,
}

impl Standing {
    /// The angles of a board with this normal, from whose centre the lines to camera and projector
    /// begin.
    pub fn new(normal: Vector, camera: Vector, projector: Vector) -> Self {
        let angle = |a: Vector, b: Vector| libm::atan2(a.cross(b).length(), a.dot(b));
        let across = camera.cross(projector);
        Self {
            camera: angle(normal, camera),
            projector: angle(normal, projector),
            aside: libm::fabs(core::f64::consts::FRAC_PI_2 - angle(normal, across)),
            between: angle(camera, projector),
        }
    }

    /// Whether the board hardly lies in the plane z = 0 of a head, whose normal passes between
    /// camera and projector.
    pub fn is_doubtful(&self) -> bool {
        self.aside > MOST_ASIDE || self.camera + self.projector > self.between + 2.0 * MOST_ASIDE
    }
}

impl Rig {
    /// How the board stands in a pose.
    pub fn standing(&self, pose: usize) -> Standing {
        let pose = &self.poses[pose];
        let normal = pose.turned(Vector::new(0.0, 0.0, 1.0));
        let projector = self.relative.inverse().shift - pose.shift;
        Standing::new(normal, pose.shift * -1.0, projector)
    }

    /// Angle between the board's normal and the camera's axis in a pose, rad.
    pub fn tilt(&self, pose: usize) -> f64 {
        let normal = self.poses[pose].turned(Vector::new(0.0, 0.0, -1.0));
        libm::atan2(libm::hypot(normal.x, normal.y), normal.z)
    }
}
