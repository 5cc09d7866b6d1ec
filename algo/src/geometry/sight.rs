//! The line of sight of one camera pixel, and the phase that a surface has along it.

use super::{Reference, Triangulator, Vector};

/// The line of sight of one pixel, prepared once for any number of heights: its point at height z
/// is start + z · rise.
///
/// With a reference from the device models, start and rise are in the projector's coordinates, from
/// its centre: a point's projector pixel then needs the lens model only. Else they are in the
/// world's coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    triangulator: &'a Triangulator,
    start: Vector,
    rise: Vector,
}

impl Triangulator {
    /// The line of sight of pixel (u, v), or `None` if it does not meet every height once.
    pub fn sight(&self, u: f64, v: f64) -> Option<Sight<'_>> {
        let ray = self.falling_ray(u, v)?;
        let (rise, on_plane) = (ray * (1.0 / ray.z), self.on_ray(ray, 0.0));
        let (start, rise) = match &self.reference {
            Reference::Models => {
                let lamp = &self.projector;
                let start = lamp.turned(on_plane - lamp.centre());
                (start, lamp.turned(rise))
            }
            Reference::Measured { .. } => (on_plane, rise),
        };
        Some(Sight {
            triangulator: self,
            start,
            rise,
        })
    }
}

impl Sight<'_> {
    /// Φ in turns of a surface at height `z` mm; `None` if the projector does not light it.
    #[inline]
    pub fn phase(&self, z: f64) -> Option<f64> {
        let point = self.start + self.rise * z;
        let triangulator = self.triangulator;
        let (xi, eta) = match triangulator.reference {
            Reference::Models => triangulator.projector.pixel(point),
            Reference::Measured { .. } => triangulator.projector_point(point),
        }?;
        Some(triangulator.function.at(xi, eta))
    }
}
