//! The plan of an alignment: as many points as the shape needs, and what they determine.

use super::equations::Equations;
use super::fit::{Fitting, HeightSample, Placed};
use super::surface::{Alignment, GoldenSurface, Spot};
use crate::geometry::Vector;
use crate::pipeline::Window;
use alloc::vec::Vec;

/// About so many rows of the part are used.
const ROWS: usize = 48;
/// About so many points are used: the error of their mean is about 1/40 of a pixel's, and the fit
/// takes about 0.15 ms.
pub(super) const POINTS: usize = 1800;
/// Where a wall is seen at a grazing angle, an error of the motion of a µm lifts it by tens of µm:
/// the number of points is doubled, up to this factor, until no spot is lifted by more than
/// [`MOST_LIFT_MM`].
const MORE_POINTS: usize = 8;
/// Largest error of a spot's height by that of the motion, mm (1 σ).
pub(super) const MOST_LIFT_MM: f64 = 0.01;

impl Alignment {
    /// Plans it; none if the surface inside the window has too few points.
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

    /// Plans it with about so many points. The second value is how a part that lies as taught is
    /// then found to lie.
    pub(super) fn of_points(
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

    /// How a part that lies as taught is found to lie, with the noise of golden; none if the
    /// surface has too few points.
    pub fn still(&self, golden: GoldenSurface<'_>) -> Option<Placed> {
        let still = |(at, spot): (usize, &Spot)| HeightSample {
            point: spot.point,
            sigma: spot.facet.sigma,
            over: Some((at, 0.0)),
        };
        let samples: Vec<_> = self.spots.iter().enumerate().map(still).collect();
        self.fitting(golden)
            .fit(None, &samples, &mut Equations::default())
    }

    /// The fit of points to the surface.
    pub fn fitting<'a>(&'a self, golden: GoldenSurface<'a>) -> Fitting<'a> {
        Fitting { golden, plan: self }
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
