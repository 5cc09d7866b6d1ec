//! The phase along one pixel's line of sight.

use super::{Triangulator, Vector};

/// The ray of one pixel, worked out once for any number of heights.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    triangulator: &'a Triangulator,
    ray: Vector,
}

impl Triangulator {
    /// The line of sight of pixel (u, v), if it meets every height once.
    pub fn sight(&self, u: f64, v: f64) -> Option<Sight<'_>> {
        let ray = self.falling_ray(u, v)?;
        Some(Sight {
            triangulator: self,
            ray,
        })
    }
}

impl Sight<'_> {
    /// Φ in turns of a surface at height `z` mm, where it has one.
    #[inline]
    pub fn phase(&self, z: f64) -> Option<f64> {
        let point = self.triangulator.on_ray(self.ray, z);
        self.triangulator.phase_at(point)
    }
}
