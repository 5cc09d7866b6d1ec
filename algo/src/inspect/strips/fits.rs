//! Stage 5, gauge: the planes of features, fitted to the sums of their cells.
//!
//! Each plane is fitted by one thread, over its cells in their order, so the bits do not depend on
//! the number of threads.

use super::bend::{Bend, SeenPlane};
use super::gauges::Patch;
use super::golden::Golden;
use crate::inspect::align::Motion;
use crate::inspect::feature::{Cell, FittedPlane, Geometry, Middle, Sum, cells};
use crate::inspect::gauge::SensitivePlane;
use alloc::vec::Vec;

/// The fit of a plane, with its buffers.
#[derive(Clone, Debug)]
pub struct Fit {
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

impl Fit {
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
        let had: u32 = patch.taught.iter().map(|cell| cell.pixels).sum();
        let pairs = self.sums.iter().zip(&patch.taught);
        let has = pairs.filter(|(_, taught)| taught.pixels > 0);
        let has: i64 = has.map(|(sum, _)| sum.count).sum();
        has as f64 / f64::from(had.max(1))
    }
}
