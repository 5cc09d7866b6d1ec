//! What the calibrated head measures of the board itself: its flatness, and the distances of its
//! corners.

use super::adjust::{Adjusted, View};
use super::predict::Target;
use crate::geometry::Vector;
use crate::math::solve::Normal;
use alloc::vec::Vec;

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
    pub fn measured_board(&self, pose: usize, view: &View) -> Option<MeasuredBoard> {
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
            let (x, y) = self.rig.camera.undistorted(corner.u, corner.v)?;
            let along = world.turned(Vector::new(x, y, 1.0));
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
struct Plane {
    normal: Vector,
    distance: f64,
}

impl Plane {
    fn off(&self, point: Vector) -> f64 {
        self.normal.dot(point) - self.distance
    }
}

/// The plane z = a + bx + cy of least squares.
fn plane(points: &[Vector]) -> Option<Plane> {
    let [a, b, c] = Normal::of(points.iter().map(|p| ([1.0, p.x, p.y], p.z))).solve()?;
    let normal = Vector::new(-b, -c, 1.0);
    let length = normal.length();
    Some(Plane {
        normal: normal * (1.0 / length),
        distance: a / length,
    })
}
