//! The study's analytic parts: cone, sawtooth, sphere, tube, flowerpot, and a flat plane.

use std::ops::RangeInclusive;

use super::{Defect, Surface};
use crate::optics::Vector;
use hal::bounded;

/// Bounds of a length that is not 0, mm.
const MEASURE: RangeInclusive<f64> = 1e-3..=1000.0;
/// Bounds of a coordinate, mm.
const COORDINATE: RangeInclusive<f64> = -1000.0..=1000.0;
/// Largest slope of the tube: a lying cylinder is vertical at its sides, so its steeper parts are
/// cut off.
const TUBE_SLOPE: f64 = 6.0;

bounded! {
    /// A square block with a cone-shaped hole: z = top, and within the radius z = top − depth · (1
    /// − r / radius).
    pub struct Cone: Default {
        /// Half the side of the block.
        pub half_size: f64 = MEASURE => 100.0,
        /// Radius of the hole at the top.
        pub radius: f64 = MEASURE => 66.0,
        /// Depth of the hole.
        pub depth: f64 = COORDINATE => 160.0,
        /// z of the top.
        pub top: f64 = COORDINATE => 80.0,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Surface for Cone {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.top - self.depth * (1.0 - x.hypot(y) / self.radius).max(0.0)
    }

    fn present(&self, x: f64, y: f64) -> bool {
        in_square(self.half_size, x, y)
    }

    fn slope_bound(&self) -> f64 {
        (self.depth / self.radius).abs()
    }

    fn bounds(&self) -> [Vector; 2] {
        square(
            self.half_size,
            self.top - self.depth.max(0.0),
            self.top - self.depth.min(0.0),
        )
    }
}

bounded! {
    /// Ridges along y: with f = frac((x − x0) / period), z rises from lo to hi over f < rise and
    /// falls after.
    pub struct Sawtooth: Default {
        /// Half the side of the square.
        pub half_size: f64 = MEASURE => 100.0,
        /// Distance of the ridges.
        pub period: f64 = MEASURE => 40.0,
        /// Share of the period that rises, 0.01…0.99.
        pub rise: f64 = 0.01..=0.99 => 0.45,
        /// x of a valley.
        pub x0: f64 = COORDINATE => -100.0,
        /// z of the valleys.
        pub lo: f64 = COORDINATE => -13.5,
        /// z of the ridges.
        pub hi: f64 = COORDINATE => 13.5,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Surface for Sawtooth {
    fn height(&self, x: f64, _: f64) -> f64 {
        let f = ((x - self.x0) / self.period).rem_euclid(1.0);
        let share = if f < self.rise {
            f / self.rise
        } else {
            (1.0 - f) / (1.0 - self.rise)
        };
        self.lo + (self.hi - self.lo) * share
    }

    fn present(&self, x: f64, y: f64) -> bool {
        in_square(self.half_size, x, y)
    }

    fn slope_bound(&self) -> f64 {
        (self.hi - self.lo).abs() / (self.period * self.rise.min(1.0 - self.rise))
    }

    fn bounds(&self) -> [Vector; 2] {
        square(self.half_size, self.lo.min(self.hi), self.lo.max(self.hi))
    }
}

bounded! {
    /// The part of a sphere above z = cut.
    pub struct Sphere: Default {
        /// Radius.
        pub radius: f64 = MEASURE => 125.0,
        /// z of the centre.
        pub centre_z: f64 = COORDINATE => -75.0,
        /// z below which the sphere is cut off.
        pub cut: f64 => -10.4,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Sphere {
    fn rim(&self) -> f64 {
        let up = self.cut - self.centre_z;
        (self.radius * self.radius - up * up).max(0.0).sqrt()
    }
}

impl Surface for Sphere {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.centre_z + capped_circle(self.radius, self.rim(), x.hypot(y))
    }

    fn present(&self, x: f64, y: f64) -> bool {
        x.hypot(y) <= self.rim()
    }

    fn slope_bound(&self) -> f64 {
        self.rim() / (self.cut - self.centre_z)
    }

    fn bounds(&self) -> [Vector; 2] {
        square(self.rim(), self.cut, self.centre_z + self.radius)
    }
}

bounded! {
    /// The upper side of a cylinder whose axis lies along y.
    pub struct Tube: Default {
        /// Diameter.
        pub diameter: f64 = MEASURE => 127.34,
        /// Half the length.
        pub half_length: f64 = MEASURE => 47.5,
        /// z of the axis.
        pub centre_z: f64 = COORDINATE => -20.0,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Tube {
    /// Distance from the axis at which the slope reaches [`TUBE_SLOPE`].
    fn side(&self) -> f64 {
        self.diameter / 2.0 * TUBE_SLOPE / TUBE_SLOPE.hypot(1.0)
    }
}

impl Surface for Tube {
    fn height(&self, x: f64, _: f64) -> f64 {
        self.centre_z + capped_circle(self.diameter / 2.0, self.side(), x.abs())
    }

    fn present(&self, x: f64, y: f64) -> bool {
        x.abs() <= self.side() && y.abs() <= self.half_length
    }

    fn slope_bound(&self) -> f64 {
        TUBE_SLOPE
    }

    fn bounds(&self) -> [Vector; 2] {
        let (x, y) = (self.side(), self.half_length);
        [
            [-x, -y, self.centre_z],
            [x, y, self.centre_z + self.diameter / 2.0],
        ]
    }
}

bounded! {
    /// The wall of an open truncated cone, wider at the rim; its axis is along z, and half its
    /// depth lies above z = 0.
    pub struct Flowerpot: Default {
        /// Diameter at the top.
        pub rim_diameter: f64 => 198.0,
        /// Diameter at the bottom.
        pub bottom_diameter: f64 = MEASURE => 120.0,
        /// Height of the wall.
        pub depth: f64 = MEASURE => 149.0,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Surface for Flowerpot {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.depth / 2.0 - self.slope_bound() * (self.rim_diameter / 2.0 - x.hypot(y))
    }

    fn present(&self, x: f64, y: f64) -> bool {
        (self.bottom_diameter..=self.rim_diameter).contains(&(2.0 * x.hypot(y)))
    }

    fn slope_bound(&self) -> f64 {
        2.0 * self.depth / (self.rim_diameter - self.bottom_diameter)
    }

    fn bounds(&self) -> [Vector; 2] {
        square(self.rim_diameter / 2.0, -self.depth / 2.0, self.depth / 2.0)
    }
}

bounded! {
    /// The reference plane z = 0, as a square that covers the study's field of view.
    pub struct Plane: Default {
        /// Half the side of the square.
        pub half_size: f64 = MEASURE => 250.0,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Surface for Plane {
    fn height(&self, _: f64, _: f64) -> f64 {
        0.0
    }

    fn present(&self, x: f64, y: f64) -> bool {
        in_square(self.half_size, x, y)
    }

    fn slope_bound(&self) -> f64 {
        0.0
    }

    fn bounds(&self) -> [Vector; 2] {
        square(self.half_size, 0.0, 0.0)
    }
}

/// √(radius² − r²), continued beyond `rim` along its tangent.
fn capped_circle(radius: f64, rim: f64, r: f64) -> f64 {
    let inside = r.min(rim);
    let height = (radius * radius - inside * inside).max(0.0).sqrt();
    height - (r - inside) * rim / height.max(f64::MIN_POSITIVE)
}

pub(super) fn in_square(half_size: f64, x: f64, y: f64) -> bool {
    x.abs() <= half_size && y.abs() <= half_size
}

pub(super) fn square(half_size: f64, low: f64, high: f64) -> [Vector; 2] {
    [[-half_size, -half_size, low], [half_size, half_size, high]]
}
