//! Stage 5, gauge: the planes of features, fitted to the sums of their cells.
//!
//! Each plane is fitted by one thread, over its cells in their order, so the bits do not depend on
//! the number of threads.

use crate::inspect::align::Placed;
use crate::inspect::feature::{Cell, FittedPlane, Middle, Sum, TaughtCell, cells};
use crate::inspect::gauge::{Found, Kind, MAX_PLACES, Sensitive, propagate};
use alloc::vec::Vec;

/// The fit of a plane, with its buffers.
#[derive(Debug)]
pub struct Fit {
    /// Which patch has its cells.
    pub patch: usize,
    middle: Middle,
    /// What was measured of each cell.
    pub sums: Vec<Sum>,
    cells: Vec<Cell>,
    rows: Vec<[f64; 3]>,
    /// `None` where there is none.
    plane: Option<FittedPlane>,
}

impl Fit {
    /// To the cells of this patch.
    pub fn new(patch: usize, taught: &[TaughtCell]) -> Self {
        Self {
            patch,
            middle: Middle::of(taught),
            sums: Vec::new(),
            cells: Vec::new(),
            rows: Vec::new(),
            plane: None,
        }
    }

    /// Fits the plane to the measured ones of its cells, of whose pixels each has this variance,
    /// mm².
    pub fn find(&mut self, taught: &[TaughtCell], variance: f64) {
        self.cells.clear();
        cells(&self.sums, taught, Some(1), &mut self.cells);
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
