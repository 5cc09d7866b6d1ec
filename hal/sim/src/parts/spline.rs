//! The study's free-form part: a uniform bicubic B-spline over a square.

use super::shapes::{in_square, square};
use super::{Defect, Surface};
use crate::optics::Vector;
use hal::bounded;

/// Control values along each side, for 8 cubic patches.
const CONTROL: usize = 11;
const PATCHES: f64 = (CONTROL - 3) as f64;

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

/// The study's control values, mm.
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
