//! Stage 5, gauge: the planes of features, fitted to the sums of their cells.
//!
//! Each plane is fitted by one thread, over its cells in their order, so the bits do not depend on
//! the number of threads.
//!
//! # What the interpolation of the pose field adds to deviations on a plane
//! Between its nodes the pose field ([`PoseField`](crate::inspect::strips::align::pose::PoseField)) is linear along columns
//! and rows, and the displacement F = (du, dv, dz) that it stands for is bent. At column u between
//! the nodes u₀ and u₁ the field is too large by
//!
//! ```text
//! e(u) = ½ (u − u₀)(u₁ − u) ∂²F/∂u²
//! ```
//!
//! and likewise along v. Deviations from golden's heights G are too large by e_z − ∇G · (e_u, e_v):
//! with 0.4 mm per pixel and a part that is tilted by 1°, up to 5 µm on a face of 45°, and tenths of
//! µm on one that faces the camera. A plane is known better than that, and so its cells are
//! corrected; for gauges of cells it is small against what their squares are noisy by.
//!
//! # Accuracy
//! The second derivatives are those at the middle of the plane. `tests/suite/planes.rs`.

use crate::geometry::Vector;
use crate::inspect::align::Motion;
use crate::inspect::feature::{Cell, FittedPlane, Geometry, Middle, Sum, cells};
use crate::inspect::gauge::SensitivePlane;
use crate::inspect::strips::accumulate::Patch;
use crate::inspect::strips::align::{SPACING, displacement};
use crate::inspect::strips::golden::Golden;
use alloc::vec::Vec;

/// The fit of a plane, with its buffers.
#[derive(Clone, Debug)]
pub struct PlaneFit {
    /// Which patch has its cells.
    pub patch: usize,
    /// Which feature it is.
    pub feature: usize,
    /// Thickness of its sheet, mm; `None` where it is not known.
    pub thickness: Option<f64>,
    middle: Middle,
    /// As taught; `None` if it has no plane.
    seen: Option<SeenPlane>,
    /// What was measured of each cell.
    pub sums: Vec<Sum>,
    cells: Vec<Cell>,
    rows: Vec<[f64; 3]>,
    /// `None` where there is none.
    plane: Option<FittedPlane>,
}

impl PlaneFit {
    /// To the cells of this patch.
    pub fn new(at: usize, patch: &Patch, golden: &Golden, thickness: Option<f64>) -> Self {
        let as_taught = patch.taught.iter().map(|cell| Sum {
            count: i64::from(cell.pixels),
            deviation: 0,
        });
        let mut fit = Self {
            patch: at,
            feature: patch.feature,
            thickness,
            middle: Middle::of(&patch.taught),
            seen: None,
            sums: as_taught.collect(),
            cells: Vec::new(),
            rows: Vec::new(),
            plane: None,
        };
        fit.find(patch, 0.0, None);
        let plane = fit.plane.as_ref();
        fit.seen = plane.and_then(|plane| SeenPlane::new(golden, plane));
        fit
    }

    /// The error of its cells' deviations where the part has moved so.
    pub fn bend(&self, golden: &Golden, motion: &Motion) -> Option<Bend> {
        self.seen.as_ref()?.bend(golden, motion)
    }

    /// Fits the plane to the measured ones of its cells, of whose pixels each has this variance,
    /// mm², and takes the error of their deviations back.
    pub fn find(&mut self, patch: &Patch, variance: f64, bend: Option<Bend>) {
        self.cells.clear();
        cells(&self.sums, &patch.taught, Some(1), &mut self.cells);
        if let Some(bend) = bend {
            for cell in &mut self.cells {
                let error = bend.at(patch.grid.middle(cell.at));
                cell.deviation -= error;
                cell.height -= error;
            }
        }
        self.plane = FittedPlane::of(&self.cells, self.middle, variance, &mut self.rows);
    }

    /// Its geometry; `None` where there is no plane.
    pub fn geometry(&self) -> Option<Geometry> {
        let plane = self.plane.as_ref()?;
        Some(plane.geometry(plane.parameters))
    }

    /// The plane as values depend on it; `None` where there is none.
    pub fn sensitive(&self) -> Option<SensitivePlane<'_>> {
        Some(SensitivePlane {
            id: self.feature,
            plane: self.plane.as_ref()?,
            rows: &self.rows,
        })
    }

    /// The share of its cells' pixels as taught that was measured.
    pub fn share(&self, patch: &Patch) -> f64 {
        let had = patch.pixels();
        let pairs = self.sums.iter().zip(&patch.taught);
        let has = pairs.filter(|(_, taught)| taught.pixels > 0);
        let has: i64 = has.map(|(sum, _)| sum.count).sum();
        has as f64 / f64::from(had.max(1))
    }
}

/// Distance in pixels over which second derivatives are taken: near enough, and far above rounding.
const STEP: usize = 16;

/// A plane as taught, as far as the camera's picture of it matters.
#[derive(Clone, Copy, Debug)]
pub struct SeenPlane {
    /// Its middle.
    middle: Vector,
    /// The place in the frame that sees it.
    seen: (f64, f64),
    /// By how much golden's height rises from one column, and from one row, to the next, mm.
    rise: [f64; 2],
}

/// The error of deviations on a plane that lies so.
#[derive(Clone, Copy, Debug)]
pub struct Bend {
    /// Its second derivatives along columns and rows, mm per pixel².
    curvature: [f64; 2],
    /// From the taught pixels to those that see the plane now.
    shift: [f64; 2],
    /// Columns and rows of the frame.
    size: [usize; 2],
}

impl SeenPlane {
    /// `None` where the camera does not see it.
    pub fn new(golden: &Golden, plane: &FittedPlane) -> Option<Self> {
        let geometry = plane.geometry(plane.parameters);
        let (middle, normal) = (geometry.point, geometry.normal);
        let seen = golden.triangulator.camera().project(middle)?;
        let (u, v) = (seen.0 as usize, seen.1 as usize);
        // How far the plane lies above the middle's height on the ray of a pixel.
        let height = |u: usize, v: usize| {
            let point = golden.seen(u, v, middle.z)?;
            let ray = golden.triangulator.higher(point, 1.0) - point;
            Some(-normal.dot(point - middle) / normal.dot(ray))
        };
        let here = height(u, v)?;
        Some(Self {
            middle,
            seen,
            rise: [height(u + 1, v)? - here, height(u, v + 1)? - here],
        })
    }

    /// The error of its deviations where the part has moved so; `None` where it is not seen.
    pub fn bend(&self, golden: &Golden, motion: &Motion) -> Option<Bend> {
        let now = motion.apply(self.middle);
        let seen = golden.triangulator.camera().project(now)?;
        let (width, rows) = golden.size();
        let inside = |at: f64, end: usize| {
            let last = end.checked_sub(STEP + 1)?;
            Some((at as usize).min(last).max(STEP))
        };
        let (u, v) = (inside(seen.0, width)?, inside(seen.1, rows)?);
        let at = |u: usize, v: usize| {
            let [along, down, rise] =
                displacement(golden, motion, (u, v), golden.seen(u, v, now.z)?);
            Some(rise - self.rise[0] * along - self.rise[1] * down)
        };
        let here = at(u, v)?;
        let square = (STEP * STEP) as f64;
        let bent =
            |one: Option<f64>, other: Option<f64>| Some((one? - 2.0 * here + other?) / square);
        let curvature = [
            bent(at(u - STEP, v), at(u + STEP, v))?,
            bent(at(u, v - STEP), at(u, v + STEP))?,
        ];
        curvature.iter().all(|of| of.is_finite()).then_some(Bend {
            curvature,
            shift: [seen.0 - self.seen.0, seen.1 - self.seen.1],
            size: [width, rows],
        })
    }
}

impl Bend {
    /// By how much deviations are too large where the taught pixel (u, v) is seen now, mm.
    pub fn at(&self, taught: [f64; 2]) -> f64 {
        let error = |axis: usize| {
            let last = self.size[axis].saturating_sub(1);
            let at = (taught[axis] + self.shift[axis]).clamp(0.0, last as f64);
            let before = at as usize / SPACING * SPACING;
            let after = (before + SPACING).min(last);
            0.5 * (at - before as f64) * (after as f64 - at) * self.curvature[axis]
        };
        error(0) + error(1)
    }
}
