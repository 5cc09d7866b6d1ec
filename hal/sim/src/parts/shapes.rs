//! The study's parts: cone, sawtooth, sphere, tube, flowerpot, a free-form spline, and a flat plane.

use std::ops::RangeInclusive;

use super::Defect;
use crate::optics::Vector;
use crate::trace::Surface;
use hal::bounded;

/// Bounds of a length that is not 0, mm.
const MEASURE: RangeInclusive<f64> = 1e-3..=1000.0;
/// Bounds of a coordinate, mm.
const COORDINATE: RangeInclusive<f64> = -1000.0..=1000.0;
/// Largest slope of the tube: a lying cylinder is vertical at its sides, so its steeper parts are
/// cut off.
const TUBE_SLOPE: f64 = 6.0;
/// Control values of the spline along each side, for 8 cubic patches.
const CONTROL: usize = 11;
/// Cubic patches along each side.
const PATCHES: f64 = (CONTROL - 3) as f64;

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
    /// A uniform bicubic B-spline, z = Σ N_i(u_y) N_j(u_x) c_ij with u = (x / half_size + 1) · 4.
    pub struct Spline: Default {
        /// Half the side of the square.
        pub half_size: f64 = 1.0..=1000.0 => 100.0,
        /// Control values in mm, row = y, column = x.
        pub control: [[f64; CONTROL]; CONTROL] = -1000.0..=1000.0 => STUDY,
        /// Dents; a good part has none.
        pub defects: Vec<Defect>,
    }
}

impl Spline {
    /// The index of the first of the four control values that contribute at `x`, and the four
    /// weights.
    fn weights(&self, x: f64) -> (usize, [f64; 4]) {
        let u = ((x / self.half_size + 1.0) * PATCHES / 2.0).clamp(0.0, PATCHES);
        let first = u.floor().min(PATCHES - 1.0);
        let t = u - first;
        let (s, t2) = (1.0 - t, t * t);
        let t3 = t2 * t;
        let sixth = 1.0 / 6.0;
        let weights = [
            s * s * s * sixth,
            (3.0 * t3 - 6.0 * t2 + 4.0) * sixth,
            (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) * sixth,
            t3 * sixth,
        ];
        (first as usize, weights)
    }
}

impl Surface for Spline {
    fn height(&self, x: f64, y: f64) -> f64 {
        let (column, along_x) = self.weights(x);
        let (row, along_y) = self.weights(y);
        let mut z = 0.0;
        for (values, weight) in self.control.iter().skip(row).zip(along_y) {
            let across: f64 = values
                .iter()
                .skip(column)
                .zip(along_x)
                .map(|(value, weight)| value * weight)
                .sum();
            z += weight * across;
        }
        z
    }

    fn present(&self, x: f64, y: f64) -> bool {
        in_square(self.half_size, x, y)
    }

    /// The derivative of a uniform B-spline is a weighted mean of the differences of neighbouring
    /// control values, so their largest difference bounds it.
    fn slope_bound(&self) -> f64 {
        let spacing = 2.0 * self.half_size / PATCHES;
        let along_x = self
            .control
            .iter()
            .flat_map(|row| row.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
        let along_y = self
            .control
            .windows(2)
            .flat_map(|rows| rows[0].iter().zip(&rows[1]))
            .map(|(before, after)| (after - before).abs());
        let (x, y) = (along_x.fold(0.0, f64::max), along_y.fold(0.0, f64::max));
        x.hypot(y) / spacing
    }

    fn bounds(&self) -> [Vector; 2] {
        let values = self.control.as_flattened();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        square(self.half_size, low, high)
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

fn in_square(half_size: f64, x: f64, y: f64) -> bool {
    x.abs() <= half_size && y.abs() <= half_size
}

fn square(half_size: f64, low: f64, high: f64) -> [Vector; 2] {
    [[-half_size, -half_size, low], [half_size, half_size, high]]
}

/// The control values of the study's spline, mm.
#[rustfmt::skip]
const STUDY: [[f64; CONTROL]; CONTROL] = [
    [-37.214206, -24.134321, 24.708350, 5.748705, -36.480483, -7.147198, -3.173395, -30.803272, 18.937078, -34.789408, -10.772667],
    [0.087798, -7.363427, 6.149901, 19.219219, 38.119768, -20.033641, 11.492967, 15.617714, -19.296447, -44.496433, 39.607468],
    [-18.804920, -17.456380, 32.533766, 6.008371, -3.843273, 22.285750, -41.999550, 16.547826, -12.242312, -36.763947, 12.527240],
    [35.973547, -26.697262, 9.895895, -18.825525, 19.558318, 17.863047, -25.700076, 27.184162, 12.280817, 14.456743, 26.335212],
    [-7.541255, 21.024884, 31.388907, -35.771697, 28.904491, -10.539112, -3.118654, -31.963141, 15.808974, -19.360663, 30.753692],
    [-20.797417, 3.987633, -10.043396, 8.409261, -27.610313, -29.025214, 19.999938, 20.463997, 4.434830, 35.075011, -26.819798],
    [29.002510, -30.003015, 38.819830, 9.342327, 7.887861, 39.356402, 23.476021, 23.725638, -39.944674, -12.671283, -37.279483],
    [-27.879563, -26.119608, 29.672317, -33.657349, -18.947127, -1.979664, 28.877846, 38.895431, 16.649903, -26.135163, 2.531601],
    [16.460773, -40.136010, 14.204533, -12.758199, 6.400984, 13.308878, 13.273765, 0.633762, 3.375673, -27.479613, -1.777150],
    [-33.773775, -3.026667, 1.775529, 22.357379, -10.561830, -42.929358, 1.040464, -26.866745, 19.515126, -10.991669, -11.703292],
    [34.069100, -10.621911, -14.439486, -14.511465, -3.025060, -36.552868, 2.684302, 35.105105, 4.083884, 19.744661, 37.330050],
];
