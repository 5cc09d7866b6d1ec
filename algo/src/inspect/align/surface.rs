//! The golden surface between pixels: heights, the planes through them, and the spots where every
//! part is measured to find its motion.

use crate::geometry::{Triangulator, Vector};
use crate::inspect::taught::Taught;
use crate::pipeline::KnownSurface;
use alloc::vec::Vec;
use core::ops::Range;

/// The part as taught, where it is compared.
#[derive(Clone, Copy, Debug)]
pub struct GoldenSurface<'a> {
    /// The camera's geometry.
    pub triangulator: &'a Triangulator,
    /// The taught heights.
    pub surface: &'a KnownSurface,
    /// Where the heights are compared.
    pub taught: &'a Taught,
}

/// A place of the surface and the plane through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// m: a point that moves by δ rises by m·δ above the surface, both heights taken on the point's
    /// own ray. It is the scaled normal n / (n·d), d the ray with d_z = 1.
    pub lift: Vector,
    /// The area in x and y that a pixel sees, mm².
    pub area: f64,
    /// Variance of the error of m's x and y. One part follows from the noise of the heights of one
    /// measurement: golden may be the mean of several, but errors of slopes that pattern, blur and
    /// lenses cause are not lowered by a mean. The other is how far slopes change unevenly over the
    /// facet's square, so that its plane is off the slope in its middle. Without either, a body that
    /// can turn about its axis would have a shape that determines this turn.
    pub lift_variance: f64,
    /// Error of a height that follows from the noise of one measurement, mm (1 σ).
    pub sigma: f64,
}

impl Facet {
    /// −∂r/∂x at a point, r its height above the surface: what a shift in mm and a turn about
    /// `centre`, as the way in mm of a point at `radius`, take off r when they are taken back.
    pub fn jacobian(&self, point: Vector, (centre, radius): (Vector, f64)) -> [f64; 6] {
        let turning = (point - centre).cross(self.lift) * (1.0 / radius);
        let lift = self.lift;
        [lift.x, lift.y, lift.z, turning.x, turning.y, turning.z]
    }

    /// The share of a height difference that lies along the normal: n·d, as |m| = 1 / n·d.
    pub fn normal_share(&self) -> f64 {
        1.0 / self.lift.length()
    }
}

/// A place of the taught part at which every part is measured to find its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The pixel that sees it.
    pub u: usize,
    /// Its row.
    pub v: usize,
    /// Its place, mm.
    pub point: Vector,
    /// The plane through it.
    pub facet: Facet,
}

/// The plan of an alignment: which pixels are used, and which components of a motion the part's
/// shape determines.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// The point that is turned about: the mean of the surface's points, mm.
    pub centre: Vector,
    /// RMS distance of the points from it, mm.
    pub radius: f64,
    /// Components of the motion that the shape does not determine.
    pub left_out: [bool; 6],
    /// Corners of a box around the part.
    pub(super) corners: Vec<Vector>,
    /// From the top row down.
    pub(super) spots: Vec<Spot>,
    pub(super) pixels_per_spot: f64,
}

impl Alignment {
    /// Corners of a box around the part.
    pub fn corners(&self) -> &[Vector] {
        &self.corners
    }

    /// About how many pixels there are to each spot.
    pub fn pixels_per_spot(&self) -> f64 {
        self.pixels_per_spot
    }

    /// The index of the first spot in some rows, and the spots in them.
    pub fn spots(&self, rows: Range<usize>) -> (usize, &[Spot]) {
        let first = self.spots.partition_point(|spot| spot.v < rows.start);
        let end = self.spots.partition_point(|spot| spot.v < rows.end);
        (first, &self.spots[first..end])
    }
}

/// The plane is fitted to the heights of a square of this many pixels to each side.
const REACH: usize = 2;
/// Distance over which the camera's derivatives are taken, mm: small against the working distance,
/// large against rounding.
const DELTA_MM: f64 = 0.01;
/// Σ i² over the square of a facet.
const SQUARES: f64 = 50.0;
/// Weights of five heights whose sum, over [`CUBIC_SHARE`], is f‴/2: the slope over the outer two
/// less that over the inner two.
const CUBIC: [i64; 2 * REACH + 1] = [-1, 2, 0, -2, 1];
const CUBIC_SHARE: f64 = 4.0;
/// The slope of the line through all five is off by Σi⁴/(6 Σi²) f‴: this many times that sum,
/// squared.
const UNEVEN: f64 = (3.4 / 3.0) * (3.4 / 3.0);
/// Variance that noise alone gives that sum, as a mean over five rows, along and down together,
/// where golden is the mean of two measurements, over the variance of one. Golden of one measurement
/// passes for less even than it is.
const OF_NOISE: f64 = 0.125;

impl GoldenSurface<'_> {
    fn rows(&self) -> usize {
        self.surface.height.len() / self.surface.width.max(1)
    }

    /// The height between four pixels that all count in full, mm, by bilinear interpolation.
    pub fn height_at(&self, u: f64, v: f64) -> Option<f64> {
        let width = self.surface.width;
        let inside = u >= 0.0 && v >= 0.0 && u < (width - 1) as f64 && v < (self.rows() - 1) as f64;
        if !inside {
            return None;
        }
        let place = v as usize * width + u as usize;
        let corners = [place, place + 1, place + width, place + width + 1];
        if !corners.iter().all(|&at| self.taught.full(at)) {
            return None;
        }
        let (fu, fv) = (u - libm::floor(u), v - libm::floor(v));
        let [a, b, c, d] = corners.map(|at| self.surface.height[at].mm());
        let (upper, lower) = (a + (b - a) * fu, c + (d - c) * fu);
        Some(upper + (lower - upper) * fv)
    }

    /// The facet about the pixel next to where `point` is `seen`: where the camera projects it.
    /// `None` unless all pixels of its square are compared.
    pub fn facet(&self, point: Vector, seen: (f64, f64)) -> Option<Facet> {
        self.facet_of(point, seen, Taught::all_compared)
    }

    /// As [`Self::facet`]; `None` unless all pixels of its square count in full.
    pub(super) fn quiet_facet(&self, point: Vector, seen: (f64, f64)) -> Option<Facet> {
        self.facet_of(point, seen, Taught::all_full)
    }

    fn facet_of(
        &self,
        point: Vector,
        seen: (f64, f64),
        count: impl Fn(&Taught, Range<usize>) -> bool,
    ) -> Option<Facet> {
        let width = self.surface.width;
        let inside = |x: f64, end: usize| x >= REACH as f64 && x + REACH as f64 + 1.0 < end as f64;
        let (u, v) = (libm::rint(seen.0), libm::rint(seen.1));
        if !(inside(u, width) && inside(v, self.rows())) {
            return None;
        }
        let place = v as usize * width + u as usize;
        // Of the slopes, and of their unevenness.
        let (mut along, mut down) = ([0; 2], [0; 2]);
        for (i, row_cubic) in CUBIC.into_iter().enumerate() {
            let start = place + i * width - REACH * width - REACH;
            let row = start..start + CUBIC.len();
            if !count(self.taught, row.clone()) {
                return None;
            }
            let mut sum = 0;
            for (j, (height, cubic)) in self.surface.height[row].iter().zip(CUBIC).enumerate() {
                let z = i64::from(height.nm());
                along[0] += z * (j as i64 - REACH as i64);
                along[1] += z * cubic;
                sum += z;
            }
            down[0] += sum * (i as i64 - REACH as i64);
            down[1] += sum * row_cubic;
        }
        let cubics = CUBIC_SHARE * CUBIC.len() as f64;
        let uneven = [along[1], down[1]].map(|sum| sum as f64 / cubics * 1e-6);
        let [along, down] = [along[0], down[0]].map(|sum| sum as f64 / SQUARES * 1e-6);
        let camera = self.triangulator.camera();
        let beside = |x, y, z| {
            let (u, v) = camera.project(point + Vector::new(x, y, z) * DELTA_MM)?;
            Some(((u - seen.0) / DELTA_MM, (v - seen.1) / DELTA_MM))
        };
        let (x, y, z) = (
            beside(1.0, 0.0, 0.0)?,
            beside(0.0, 1.0, 0.0)?,
            beside(0.0, 0.0, 1.0)?,
        );
        // m = ẑ − ∇G ∂π/∂p.
        let slide = |(du, dv): (f64, f64)| along * du + down * dv;
        let lift = Vector::new(-slide(x), -slide(y), 1.0 - slide(z));
        let (rise_x, rise_y) = (-lift.x / lift.z, -lift.y / lift.z);
        let (xu, xv) = (x.0 + z.0 * rise_x, x.1 + z.1 * rise_x);
        let (yu, yv) = (y.0 + z.0 * rise_y, y.1 + z.1 * rise_y);
        let area = 1.0 / libm::fabs(xu * yv - xv * yu);
        let sigma = self.taught.sigma_mm(place);
        let (scale, noise) = (x.0 * x.0 + x.1 * x.1, sigma * sigma);
        let uneven = uneven[0] * uneven[0] + uneven[1] * uneven[1];
        let uneven = UNEVEN * (uneven - OF_NOISE * noise).max(0.0);
        area.is_finite().then_some(Facet {
            lift,
            area,
            lift_variance: (noise / SQUARES + uneven) * scale,
            sigma,
        })
    }
}
