//! What the part lies on: a plane, and the heights of phases near its own.
//!
//! Most pixels beside a part see that. Between nodes 8 px apart its height and its phase are interpolated, and
//! about its phase a height is a quadratic: within [`REACH`] it is off by some micrometres, and costs a few products
//! in place of five evaluations of the phase.
//!
//! Phases are unwrapped about golden's. The ground may lie so far behind it that another order is nearer, and would
//! seem to lie in front of the part: phases that are its own but for whole periods are its own.

use super::near::{Near, NodeRow};
use crate::geometry::{Triangulator, Vector};
use crate::units::AbsolutePhase;

/// Largest difference of phases for which the quadratic is used, turns.
const REACH: f64 = 0.25;
/// The same where whole periods were taken off: of heights that are only known not to be the part's.
const MOVED: f64 = 1.0;

/// A plane below a part.
#[derive(Debug)]
pub struct Ground {
    /// z at x = y = 0, mm, and its rise along x and y.
    plane: [f64; 3],
    /// Its height in mm, its phase in turns, and the first two derivatives of heights by phases there; not numbers
    /// where it is not seen.
    near: Near<4>,
    /// Phases that differ by so many turns look the same.
    period: f64,
}

impl Ground {
    /// Of frames of this size, whose phases look the same every so many turns.
    pub fn new(
        triangulator: &Triangulator,
        plane: [f64; 3],
        (width, rows): (usize, usize),
        period: f64,
    ) -> Self {
        let mut ground = Self {
            plane,
            near: Near::default(),
            period,
        };
        let exact = |u: f64, v: f64| {
            let seen = ground.seen(triangulator, u, v)?;
            let phase = triangulator.phase_at(seen)?;
            let expansion = triangulator.expand(u, v, phase, seen.z)?;
            Some([seen.z, phase, expansion.first, expansion.second])
        };
        let node = |u, v| Some(exact(u, v).unwrap_or([f64::NAN; 4]));
        ground.near = Near::new((0.0, 0.0), (width as f64, rows as f64), node);
        ground
    }

    /// Its point above or below another one.
    pub fn at(&self, point: Vector) -> Vector {
        let [z, along_x, along_y] = self.plane;
        let z = z + along_x * point.x + along_y * point.y;
        Vector { z, ..point }
    }

    /// Where the line of sight through a place meets it.
    pub fn seen(&self, triangulator: &Triangulator, u: f64, v: f64) -> Option<Vector> {
        let [z, along_x, along_y] = self.plane;
        let camera = triangulator.camera();
        let (eye, ray) = (camera.centre(), camera.ray(u, v)?);
        let above = eye.z - z - along_x * eye.x - along_y * eye.y;
        let way = above / (along_x * ray.x + along_y * ray.y - ray.z);
        way.is_finite().then(|| eye + ray * way)
    }

    /// What its heights in row `v` are worked out from, for [`Self::height`].
    pub fn take_row(&self, v: usize, out: &mut NodeRow<4>) {
        self.near.take_row(v as f64, out);
    }

    /// The height of a phase near its own at column `u` of a row that was taken, mm.
    pub fn height(&self, row: &NodeRow<4>, u: usize, phase: AbsolutePhase) -> Option<f64> {
        let [z, own, first, second] = self.near.in_row(row, u as f64)?;
        let off = phase.turns() - own;
        let periods = libm::rint(off / self.period);
        let (off, reach) = match periods == 0.0 {
            true => (off, REACH),
            false => (off - periods * self.period, MOVED),
        };
        (libm::fabs(off) <= reach).then(|| z + off * (first + off * second / 2.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pinhole, PinholeModel, Reference};
    use crate::pattern::PhaseFunction;

    const SIZE: (usize, usize) = (256, 192);
    /// Largest error of a height, mm.
    const EXACT_MM: f64 = 0.004;

    fn device(angle: f64, (width, rows): (usize, usize)) -> Pinhole {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let model = PinholeModel {
            fx: 2.8 * width as f64,
            fy: 2.8 * width as f64,
            cx: width as f64 / 2.0,
            cy: rows as f64 / 2.0,
            distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
            rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
            translation: [0.0, 0.0, 600.0],
        };
        Pinhole::new(model, width, rows).unwrap()
    }

    #[test]
    fn heights_near_the_ground_are_those_that_are_triangulated_and_others_are_left() {
        let function = PhaseFunction::vertical(1024, 768, 64.0).unwrap();
        let devices = (device(0.35, SIZE), device(-0.12, (1024, 768)));
        let models = Reference::Models;
        let rig = Triangulator::new(devices.0, devices.1, models, function, None).unwrap();
        let ground = Ground::new(&rig, [-12.0, 0.02, -0.01], SIZE, 16.0);
        let mut row = NodeRow::new();
        for (u, v) in [(0, 0), (53, 21), (127, 96), (255, 191)] {
            ground.take_row(v, &mut row);
            let seen = ground.seen(&rig, u as f64, v as f64).unwrap();
            assert!((ground.at(seen) - seen).length() < 1e-9);
            let own = rig.phase_at(seen).unwrap();
            for off in [-0.24, -0.1, 0.0, 0.2, 0.24] {
                let phase = AbsolutePhase::from_turns(own + off);
                let solved = rig.solve(u as f64, v as f64, phase.turns()).unwrap();
                let height = ground.height(&row, u, phase).unwrap();
                let miss = (height - solved.point.z).abs();
                assert!(miss < EXACT_MM, "{u} {v} {off}: {miss}");
            }
            let height = |off: f64| ground.height(&row, u, AbsolutePhase::from_turns(own + off));
            assert_eq!(height(0.3), None);
            let [around, far] = [height(15.5), height(14.5)];
            assert!((around.unwrap() - seen.z).abs() < 8.0 && far.is_none());
        }
    }
}
