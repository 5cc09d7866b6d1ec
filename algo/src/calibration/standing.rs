//! How the board stands in a pose to camera and projector: whether it can be the plane that both
//! look down at.

use super::rig::Rig;
use crate::geometry::Vector;

/// A normal that is inclined by more than this to the plane of both lines of sight, or lies within
/// that plane but by more than this outside the angle between the lines, is hardly that of the
/// plane z = 0 of a head, rad.
const MOST_ASIDE: f64 = 10.0 / 180.0 * core::f64::consts::PI;

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
