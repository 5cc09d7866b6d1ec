//! How a part lies against how it was taught: a small rigid motion, by least squares of measured
//! points to the golden surface.

mod directions;
mod equations;
mod fit;
mod motion;
mod surface;
mod weight;

pub use directions::form;
pub use fit::{FitBuffers, Fitting, Placed, Sample};
pub use motion::Motion;
pub use surface::{Facet, GoldenSurface};

use crate::geometry::Vector;
use crate::pipeline::Window;
use crate::simd::Backend;
use crate::units::Height;
use alloc::vec::Vec;
use core::ops::Range;

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
    /// RMS distance of the surface's points from the centre, mm.
    pub radius: f64,
    /// Components of the motion that the shape does not determine.
    pub left_out: [bool; 6],
    /// Corners of a box around the part.
    corners: Vec<Vector>,
    /// The spots, from the top row down.
    spots: Vec<Spot>,
    pixels_per_spot: f64,
}

/// About so many rows of the part are used.
const ROWS: usize = 48;
/// About so many points are used: the error of their mean is about 1/40 of a pixel's, and the fit
/// takes about 0.15 ms.
const POINTS: usize = 1800;
/// Where a wall is seen at a grazing angle, an error of the motion of a µm lifts it by tens of µm:
/// the number of points is doubled, up to this factor, until no spot is lifted by more than
/// [`MOST_LIFT_MM`].
const MORE_POINTS: usize = 8;
/// Largest error of a spot's height that the error of the motion causes, mm (1 σ).
const MOST_LIFT_MM: f64 = 0.01;

impl Alignment {
    /// Plans an alignment; `None` if the surface inside the window has too few points.
    pub fn new(golden: GoldenSurface<'_>, window: Window<'_>) -> Option<Self> {
        let mut points = POINTS;
        loop {
            let (alignment, placed) = Self::of_points(points, golden, window)?;
            let fitting = alignment.fitting(golden);
            let lift = |spot: &Spot| fitting.lift_variance(&placed, &spot.facet, spot.point);
            let most = alignment.spots.iter().map(lift).fold(0.0, f64::max);
            points *= 2;
            if most <= MOST_LIFT_MM * MOST_LIFT_MM || points > MORE_POINTS * POINTS {
                return Some(alignment);
            }
        }
    }

    /// Plans an alignment with about so many points. The second value is how a part that lies as
    /// taught is then found to lie.
    fn of_points(
        points: usize,
        golden: GoldenSurface<'_>,
        window: Window<'_>,
    ) -> Option<(Self, Placed)> {
        let width = golden.surface.width;
        let full = |v: usize| {
            let row = window[v].clone();
            row.filter(move |u| golden.taught.full(v * width + u))
        };
        let counts: Vec<usize> = (0..window.len()).map(|v| full(v).count()).collect();
        let filled = counts.iter().filter(|count| **count > 0).count();
        let rows = (filled / ROWS).max(1);
        let pixels = counts.iter().sum::<usize>() / rows;
        let columns = pixels.div_ceil(points).max(1);
        let mut spots = Vec::new();
        for v in (0..window.len()).step_by(rows) {
            for u in full(v).filter(|u| u % columns == 0) {
                let height = golden.surface.height[v * width + u];
                let seen = golden.triangulator.point(u, v, height).and_then(|point| {
                    let seen = golden.triangulator.camera().project(point)?;
                    let facet = golden.quiet_facet(point, seen)?;
                    Some(Spot { u, v, point, facet })
                });
                spots.extend(seen);
            }
        }
        let share = 1.0 / spots.len().max(1) as f64;
        let sum = |value: &dyn Fn(Vector) -> f64| spots.iter().map(|s| value(s.point)).sum::<f64>();
        let centre = Vector::new(sum(&|p| p.x), sum(&|p| p.y), sum(&|p| p.z)) * share;
        let radius = libm::sqrt(sum(&|p| (p - centre).dot(p - centre)) * share);
        let mut alignment = Self {
            centre,
            radius: radius.max(1e-3),
            left_out: [false; 6],
            corners: corners(spots.iter().map(|spot| spot.point)),
            pixels_per_spot: (rows * columns) as f64,
            spots,
        };
        let placed = alignment.still(golden)?;
        alignment.left_out = placed.left_out;
        Some((alignment, placed))
    }

    /// How a part that lies as taught is found to lie, with the noise of golden; `None` if the
    /// surface has too few points.
    pub fn still(&self, golden: GoldenSurface<'_>) -> Option<Placed> {
        let still = |(at, spot): (usize, &Spot)| Sample {
            point: spot.point,
            sigma: spot.facet.sigma,
            over: Some((at, 0.0)),
        };
        let samples: Vec<_> = self.spots.iter().enumerate().map(still).collect();
        self.fitting(golden)
            .fit(&samples, &mut FitBuffers::default())
    }

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

    /// The fit of points to the surface.
    pub fn fitting<'a>(&'a self, golden: GoldenSurface<'a>) -> Fitting<'a> {
        Fitting {
            golden,
            plan: self,
            from: None,
            backend: Backend::best(),
        }
    }
}

/// Corners of the box around points.
fn corners(points: impl Iterator<Item = Vector>) -> Vec<Vector> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for (i, x) in [point.x, point.y, point.z].into_iter().enumerate() {
            (low[i], high[i]) = (low[i].min(x), high[i].max(x));
        }
    }
    let ends = [low, high];
    (0..8)
        .map(|i: usize| Vector::new(ends[i & 1][0], ends[i >> 1 & 1][1], ends[i >> 2][2]))
        .collect()
}

/// The middle and half the span of the known heights inside a window, mm.
pub(super) fn levels(heights: &[Height], width: usize, window: Window<'_>) -> (f64, f64) {
    let (mut low, mut high) = (i32::MAX, i32::MIN);
    for (v, columns) in window.iter().enumerate() {
        for height in &heights[v * width + columns.start..v * width + columns.end] {
            if height.is_known() {
                (low, high) = (low.min(height.nm()), high.max(height.nm()));
            }
        }
    }
    if low > high {
        return (0.0, 1.0);
    }
    let (low, high) = (f64::from(low) * 1e-6, f64::from(high) * 1e-6);
    ((low + high) / 2.0, ((high - low) / 2.0).max(1.0))
}

#[cfg(test)]
mod tests;
