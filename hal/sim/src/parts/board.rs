//! A printed checkerboard, and the poses in which it is shown to a head that is calibrated.

use crate::optics::Vector;
use crate::placement::Placement;
use crate::trace::Surface;
use hal::bounded;

/// What black squares reflect of the light that white ones do.
const BLACK: f64 = 0.08;
/// Width over which the print changes from black to white, mm. It is wider than the distance of two
/// sub-rays, so that edges along the camera's rows do not jump from one sub-ray to the next.
const EDGE_MM: f64 = 0.2;
/// Width of the white margin, in squares.
const MARGIN: f64 = 1.0;

bounded! {
    /// A checkerboard whose middle lies in the origin, its columns along x.
    pub struct Board: Default {
        /// Inner corners along x.
        pub columns: usize = 2..=100 => 9,
        /// Inner corners along y.
        pub rows: usize = 2..=100 => 13,
        /// Side of a square according to its label, mm.
        pub square_mm: f64 = 0.5..=1000.0 => 10.0,
        /// By how much the middle is higher than the outermost inner corners, µm.
        pub bow_um: f64 = -10_000.0..=10_000.0,
        /// By how much the squares are larger than their label says, parts per million.
        pub scale_ppm: f64 = -100_000.0..=100_000.0,
    }
}

impl Board {
    /// Poses of the default board which calibrate the default head: tilted to all sides, near and
    /// far, all over the picture. In the last one the board lies in z = 0.
    pub const POSES: [Placement; 10] = [
        pose([28.0, 6.0], 0.0, [-42.0, 10.0, 10.0]),
        pose([-28.0, 6.0], 0.0, [50.0, -10.0, 10.0]),
        pose([5.0, 28.0], 90.0, [0.0, 40.0, 0.0]),
        pose([5.0, -28.0], 90.0, [0.0, -42.0, -10.0]),
        pose([-10.0, 36.0], 0.0, [42.0, 22.0, 20.0]),
        pose([10.0, -24.0], 0.0, [-42.0, -24.0, 0.0]),
        pose([22.0, 22.0], 40.0, [5.0, 5.0, 45.0]),
        pose([-22.0, -22.0], -40.0, [5.0, 5.0, -45.0]),
        pose([-12.0, 14.0], 60.0, [0.0, 0.0, -70.0]),
        pose([0.0, 0.0], 0.0, [0.0, 0.0, 0.0]),
    ];

    /// Side of a square, mm.
    fn side(&self) -> f64 {
        self.square_mm * (1.0 + self.scale_ppm * 1e-6)
    }

    /// Half the extent of the squares that `corners` inner corners separate, mm.
    fn half(&self, corners: usize) -> f64 {
        (corners as f64 + 1.0) / 2.0 * self.side()
    }

    /// Half the extents of the sheet along x and y, mm.
    fn sheet(&self) -> [f64; 2] {
        [self.columns, self.rows].map(|corners| self.half(corners) + MARGIN * self.side())
    }

    /// Distance from the middle to the outermost inner corners, mm.
    fn reach(&self) -> f64 {
        let inner = |corners: usize| (corners as f64 - 1.0) / 2.0 * self.side();
        inner(self.columns).hypot(inner(self.rows))
    }

    /// −1 … 1 across an edge between two squares, with alternating sign from square to square; `at`
    /// is a coordinate, mm.
    fn across(&self, at: f64, corners: usize) -> f64 {
        let squares = (at + self.half(corners)) / self.side();
        // The distance to the nearest edge in squares, positive in odd squares.
        let inside = 0.5 - ((squares - 0.5).rem_euclid(2.0) - 1.0).abs();
        (inside * self.side() / (EDGE_MM / 2.0)).clamp(-1.0, 1.0)
    }
}

const fn pose(tilt_deg: [f64; 2], rotation_deg: f64, shift_mm: [f64; 3]) -> Placement {
    Placement {
        shift_mm,
        tilt_deg,
        rotation_deg,
    }
}

impl Surface for Board {
    /// A paraboloid whose middle and whose outermost corners are equally far from z = 0.
    fn height(&self, x: f64, y: f64) -> f64 {
        let reach = self.reach();
        let [half_x, half_y] = self.sheet();
        // Outside the sheet it goes on horizontally.
        let share = (x.hypot(y).min(half_x.hypot(half_y)) / reach).powi(2);
        self.bow_um * 1e-3 * (0.5 - share)
    }

    fn present(&self, x: f64, y: f64) -> bool {
        let [half_x, half_y] = self.sheet();
        x.abs() <= half_x && y.abs() <= half_y
    }

    fn albedo(&self, x: f64, y: f64) -> f64 {
        if x.abs() > self.half(self.columns) || y.abs() > self.half(self.rows) {
            return 1.0;
        }
        let white = (1.0 + self.across(x, self.columns) * self.across(y, self.rows)) / 2.0;
        BLACK + (1.0 - BLACK) * white
    }

    fn slope_bound(&self) -> f64 {
        let [half_x, half_y] = self.sheet();
        2.0 * self.bow_um.abs() * 1e-3 * half_x.hypot(half_y) / self.reach().powi(2)
    }

    fn bounds(&self) -> [Vector; 2] {
        let [x, y] = self.sheet();
        let (middle, end) = (self.height(0.0, 0.0), self.height(x, y));
        [[-x, -y, middle.min(end)], [x, y, middle.max(end)]]
    }
}
