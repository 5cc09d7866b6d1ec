//! What the calibration's uncertainty makes of measurements: σ of heights and of lengths, from the
//! covariance of all numbers.
//!
//! A measured point is where the camera's ray of a pixel meets what the projector's ξ gives; a
//! change of the rig's numbers p moves it. With the gradient g = ∂z/∂p of a height, or of a
//! distance between two points, σ² = gᵀ C g (propagation of covariance, as in photogrammetry: E.
//! Mikhail, F. Ackermann, "Observations and Least Squares", 1976). The scale of the board is not
//! seen by any residual: its own σ is added.

use super::adjust::{Adjusted, step_of};
use super::rig::{Rig, seen};
use crate::geometry::Vector;
use alloc::vec;
use alloc::vec::Vec;

/// Newton steps to a measured point; ξ is nearly linear in z.
const STEPS: usize = 8;
/// Points of the measuring volume along each axis.
const GRID: usize = 5;
/// The volume is this share of the box about all corners of all poses.
const INNER: f64 = 0.8;
/// Length whose σ is reported, mm.
pub const LENGTH: f64 = 100.0;

/// A point that is measured: camera pixel and ξ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    pub at: Vector,
    pub pixel: (f64, f64),
    pub xi: f64,
}

/// Predicted errors of measurements with a calibration, without the noise of the measurement
/// itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// RMS of σ_z over the measuring volume, mm.
    pub height: f64,
    /// Largest σ_z in it, mm.
    pub worst_height: f64,
    /// σ of a length of 100 mm, RMS over lengths along x, y and z, mm.
    pub length: f64,
    /// Corners of the measuring volume, mm.
    pub volume: [Vector; 2],
}

impl Adjusted {
    /// σ of heights above the board's plane in the last pose, and of lengths. `scale` is σ of the
    /// board's own scale, relative.
    pub fn prediction(
        &self,
        frame: (usize, usize),
        raster: (usize, usize),
        scale: f64,
    ) -> Option<Prediction> {
        let volume = self.rig.volume()?;
        let targets = self.rig.targets(volume, frame, raster);
        let (mut squares, mut worst) = (0.0, 0.0_f64);
        for target in &targets {
            let height = |rig: &Rig| Some(rig.measured(target)?.z);
            let of_scale = scale * target.at.z;
            let variance = self.variance(&height)? + of_scale * of_scale;
            squares += variance;
            worst = worst.max(variance);
        }
        let mut lengths = (0.0, 0.0);
        for (from, to) in self.rig.lengths(&targets, volume) {
            let distance = |rig: &Rig| Some((rig.measured(&to)? - rig.measured(&from)?).length());
            let far = (to.at - from.at).length();
            let to_reported = LENGTH / far;
            let variance = self.variance(&distance)? * to_reported * to_reported;
            lengths = (
                lengths.0 + variance + scale * scale * LENGTH * LENGTH,
                lengths.1 + 1.0,
            );
        }
        Some(Prediction {
            height: libm::sqrt(squares / targets.len() as f64),
            worst_height: libm::sqrt(worst),
            length: libm::sqrt(lengths.0 / f64::max(lengths.1, 1.0)),
            volume,
        })
    }

    /// gᵀ C g of a quantity.
    fn variance(&self, of: &dyn Fn(&Rig) -> Option<f64>) -> Option<f64> {
        let n = self.rig.numbers();
        let mut gradient = vec![0.0; n];
        for (at, slope) in gradient.iter_mut().enumerate() {
            if self.covariance[at * n + at] > 0.0 {
                let step = step_of(at);
                let mut by = vec![0.0; n];
                by[at] = step;
                let after = of(&self.rig.moved(&by))?;
                by[at] = -step;
                *slope = (after - of(&self.rig.moved(&by))?) / (2.0 * step);
            }
        }
        let mut sum = 0.0;
        for (i, a) in gradient.iter().enumerate() {
            for (j, b) in gradient.iter().enumerate() {
                sum += a * self.covariance[i * n + j] * b;
            }
        }
        Some(sum)
    }
}

impl Rig {
    /// The box of [`INNER`] about all corners of all poses, in the world of the last pose.
    pub(super) fn volume(&self) -> Option<[Vector; 2]> {
        let world = self.poses.last()?.inverse();
        let mut low = Vector::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let mut high = low * -1.0;
        for pose in &self.poses {
            for corner in 0..self.board.corners() {
                let (x, y) = self.board.place(corner);
                let p = world.apply(pose.apply(Vector::new(x, y, 0.0)));
                low = Vector::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z));
                high = Vector::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z));
            }
        }
        let (middle, half) = ((low + high) * 0.5, (high - low) * (0.5 * INNER));
        Some([middle - half, middle + half])
    }

    /// Camera pixel and ξ of a point of the world; `None` if it is outside the frame or the raster.
    fn target(&self, at: Vector, frame: (usize, usize), raster: (usize, usize)) -> Option<Target> {
        let point = self.poses.last()?.apply(at);
        let pixel = seen(&self.camera, point)?;
        let (xi, eta) = seen(&self.projector, self.relative.apply(point))?;
        let inside = |(u, v): (f64, f64), (width, height): (usize, usize)| {
            u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0
        };
        (inside(pixel, frame) && inside((xi, eta), raster)).then_some(Target { at, pixel, xi })
    }

    /// A grid of points in the volume that camera and projector see.
    pub(super) fn targets(
        &self,
        [low, high]: [Vector; 2],
        frame: (usize, usize),
        raster: (usize, usize),
    ) -> Vec<Target> {
        let share = |at: usize| at as f64 / (GRID - 1) as f64;
        let between = |low: f64, high: f64, at: usize| low + (high - low) * share(at);
        let all = 0..GRID * GRID * GRID;
        all.filter_map(|at| {
            let place = Vector::new(
                between(low.x, high.x, at % GRID),
                between(low.y, high.y, at / GRID % GRID),
                between(low.z, high.z, at / (GRID * GRID)),
            );
            self.target(place, frame, raster)
        })
        .collect()
    }

    /// Pairs of targets along each axis, at least half the volume apart.
    pub(super) fn lengths(
        &self,
        targets: &[Target],
        [low, high]: [Vector; 2],
    ) -> Vec<(Target, Target)> {
        let near = |a: f64, b: f64, size: f64| libm::fabs(a - b) < 1e-6 * size;
        let (size, mut pairs) = (high - low, Vec::new());
        for (i, a) in targets.iter().enumerate() {
            for b in &targets[i + 1..] {
                let along = [
                    (near(a.at.x, b.at.x, size.x), (b.at.x - a.at.x) / size.x),
                    (near(a.at.y, b.at.y, size.y), (b.at.y - a.at.y) / size.y),
                    (near(a.at.z, b.at.z, size.z), (b.at.z - a.at.z) / size.z),
                ];
                let same = along.iter().filter(|axis| axis.0).count();
                let far = along.iter().any(|axis| !axis.0 && libm::fabs(axis.1) > 0.7);
                if same == 2 && far {
                    pairs.push((*a, *b));
                }
            }
        }
        // About 48 pairs are enough for the sums.
        let every = (pairs.len() / 48).max(1);
        pairs.into_iter().step_by(every).collect()
    }

    /// Where this rig measures a target: the point of the pixel's ray whose ξ is the target's, in
    /// the world of the last pose.
    pub(super) fn measured(&self, target: &Target) -> Option<Vector> {
        let world = self.poses.last()?.inverse();
        let (x, y) = self.camera.undistorted(target.pixel.0, target.pixel.1)?;
        let ray = Vector::new(x, y, 1.0);
        let (from, along) = (world.shift, world.turned(ray));
        let xi = |z: f64| {
            let point = ray * ((z - from.z) / along.z);
            seen(&self.projector, self.relative.apply(point)).map(|pixel| pixel.0)
        };
        let mut z = target.at.z;
        for _ in 0..STEPS {
            let slope = (xi(z + 1e-3)? - xi(z - 1e-3)?) / 2e-3;
            let off = (xi(z)? - target.xi) / slope;
            z -= off;
            if libm::fabs(off) < 1e-10 {
                break;
            }
        }
        Some(from + along * ((z - from.z) / along.z))
    }
}
