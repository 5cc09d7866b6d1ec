//! From absolute phase to height: models of camera and projector, the reference phase map,
//! triangulation; and points and directions in space.

mod lens;
mod pinhole;
mod reference;
mod triangulate;

pub use lens::Lens;
pub use pinhole::{ModelError, Pinhole, PinholeModel};
pub use reference::{FittedMap, Reference, ReferenceError, TERMS, fit_map};
pub use triangulate::{Expansion, HeightRange, RigError, Sight, Solution, Triangulator};

use core::ops::{Add, Mul, Sub};

/// A point or direction (x, y, z), in mm where it is a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vector {
    /// x.
    pub x: f64,
    /// y.
    pub y: f64,
    /// z.
    pub z: f64,
}

impl Vector {
    /// From its three components.
    #[inline]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// The scalar product.
    #[inline]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The vector product.
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// The Euclidean length.
    #[inline]
    pub fn length(self) -> f64 {
        libm::sqrt(self.dot(self))
    }
}

impl Add for Vector {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Vector {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Mul<f64> for Vector {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}
