//! Stage 5, gauge: the planes of features, fitted to the sums of their cells.
//!
//! Each plane is fitted by one thread, over its cells in their order, so the bits do not depend on
//! the number of threads.

use super::bend::{Bend, SeenPlane};
use super::gauges::Patch;
use super::golden::Golden;
use crate::inspect::align::{Motion, Placed};
use crate::inspect::feature::{Cell, FittedPlane, Middle, Sum, cells};
use crate::inspect::gauge::{Found, Kind, MAX_PLACES, Sensitive, propagate};
use alloc::vec::Vec;

/// The fit of a plane, with its buffers.
#[derive(Debug)]
pub struct Fit {
    /// Which patch has its cells.
    pub patch: usize,
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
    pub fn new(at: usize, patch: &Patch, golden: &Golden) -> Self {
        let as_taught = patch.taught.iter().map(|cell| Sum {
            count: i64::from(cell.pixels),
            deviation: 0,
        });
        let mut fit = Self {
            patch: at,
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
}

/// The value of the planes of these patches, with its errors; `None` where one was not found.
pub fn value_of(
    kind: &dyn Kind,
    patches: &[usize],
    fits: &[Fit],
    placed: Option<&Placed>,
) -> Option<Found> {
    let mut of = heapless::Vec::<Sensitive<'_>, MAX_PLACES>::new();
    for patch in patches {
        let fit = fits.iter().find(|fit| fit.patch == *patch)?;
        let plane = fit.plane.as_ref()?;
        let rows = &fit.rows[..];
        of.push(Sensitive { plane, rows }).ok()?;
    }
    propagate(kind, &of, placed)
}
