//! The phase along one pixel's line of sight.

use super::{Reference, Triangulator, Vector};

/// The line of sight of one pixel, worked out once for any number of heights: its point at height z is start + z · rise.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    triangulator: &'a Triangulator,
    start: Vector,
    rise: Vector,
    frame: Frame,
}

/// Whose directions a line of sight is given in.
#[derive(Clone, Copy, Debug)]
enum Frame {
    /// The projector's, from its centre: light needs no more than the lens.
    Projector,
    /// The world's.
    World,
}

impl Triangulator {
    /// The line of sight of pixel (u, v), if it meets every height once.
    pub fn sight(&self, u: f64, v: f64) -> Option<Sight<'_>> {
        let ray = self.falling_ray(u, v)?;
        let (rise, on_plane) = (ray * (1.0 / ray.z), self.on_ray(ray, 0.0));
        let (start, rise, frame) = match &self.reference {
            Reference::Models => {
                let lamp = &self.projector;
                let start = lamp.turned(on_plane - lamp.centre());
                (start, lamp.turned(rise), Frame::Projector)
            }
            Reference::Measured { .. } => (on_plane, rise, Frame::World),
        };
        Some(Sight {
            triangulator: self,
            start,
            rise,
            frame,
        })
    }
}

impl Sight<'_> {
    /// Φ in turns of a surface at height `z` mm, where it has one.
    #[inline]
    pub fn phase(&self, z: f64) -> Option<f64> {
        let point = self.start + self.rise * z;
        let triangulator = self.triangulator;
        let (xi, eta) = match self.frame {
            Frame::Projector => triangulator.projector.pixel(point),
            Frame::World => triangulator.projector_point(point),
        }?;
        Some(triangulator.function.at(xi, eta))
    }
}
