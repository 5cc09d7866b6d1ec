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
    /// The point at height 0 that pixel (u, v) sees, and how far its line of sight takes a point
    /// that rises by 1 mm; `None` if it does not meet every height once.
    pub fn line(&self, u: f64, v: f64) -> Option<(Vector, Vector)> {
        let ray = self.falling_ray(u, v)?;
        Some((self.on_ray(ray, 0.0), ray * (1.0 / ray.z)))
    }

    /// The line of sight of pixel (u, v), or `None` if it does not meet every height once.
    pub fn sight(&self, u: f64, v: f64) -> Option<Sight<'_>> {
        self.line(u, v).map(|line| self.sight_along(line))
    }

    /// The same along a [`Self::line`].
    pub fn sight_along(&self, (on_plane, rise): (Vector, Vector)) -> Sight<'_> {
        let (start, rise) = match &self.reference {
            Reference::Models => {
                let lamp = &self.projector;
                let start = lamp.turned(on_plane - lamp.centre());
                (start, lamp.turned(rise))
            }
            Reference::Measured { .. } => (on_plane, rise),
        };
        Sight {
            triangulator: self,
            start,
            rise,
        }
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
