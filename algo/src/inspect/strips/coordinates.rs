//! Stage 3, align: the taught coordinates of a row's pixels, and how far they deviate from golden there.

use super::Production;
use super::displaced::{BlockNumbers, GoldenMap, OffsetRow, align_row, taught_coordinates};
use super::height::HeightRow;
use super::pose::PoseField;
use super::recent::RecentRows;
use super::{common, pose};
use crate::inspect::Weight;
use crate::inspect::gauge::{Grid, Sum};
use crate::pipeline::NO_OFFSET;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// For each pixel of a row the pixel of golden's frame that saw the same point of the part.
#[derive(Debug)]
pub(super) struct TaughtCoordinates {
    /// Displacements along the row.
    blocks: Vec<BlockNumbers>,
    column: Vec<i32>,
    row: Vec<i32>,
}

impl TaughtCoordinates {
    /// Of `width` pixels.
    pub fn new(width: usize) -> Self {
        Self {
            blocks: pose::blocks_of_row(width),
            column: vec![0; width],
            row: vec![0; width],
        }
    }

    /// Takes the part's motion back in row `v`, whose heights were found last: its deviations become those from golden at the
    /// taught coordinates. Those of a part that lies as taught stay. Coordinates are found for cells and weights only.
    pub fn align(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        v: usize,
        columns: Range<usize>,
        (heights, recent): (&HeightRow, &mut RecentRows),
    ) {
        if pose.placed.is_some() {
            let columns = common(&columns, &recent.extent(v));
            if !columns.is_empty() {
                self.displace(plan, pose, v, columns, (heights, recent));
            }
        } else if plan.needs_coordinates() {
            self.row[columns.clone()].fill(v as i32);
            for u in columns {
                self.column[u] = u as i32;
            }
        }
    }

    fn displace(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        v: usize,
        columns: Range<usize>,
        (heights, recent): (&HeightRow, &mut RecentRows),
    ) {
        let (width, height) = plan.size();
        let backend = plan.decoder.backend();
        pose.row(backend, (v, height), &columns, &mut self.blocks);
        let golden = GoldenMap {
            height: &plan.cubics.surface().height,
            taught: plan.taught.pixels(),
            width,
        };
        let row = OffsetRow {
            v,
            offset: &heights.offset,
            blocks: &self.blocks,
        };
        let mut overflow = false;
        let deviation = recent.row_mut(v).0;
        align_row(
            backend,
            golden,
            row,
            columns.clone(),
            deviation,
            &mut overflow,
        );
        if plan.needs_coordinates() {
            let taught = (&mut *self.column, &mut *self.row);
            taught_coordinates(backend, golden, row, columns, taught);
        }
        if overflow {
            recent.overflow = Some(v);
        }
    }

    /// Multiplies the deviations of row `v`, which was aligned last, by golden's weights at the taught coordinates.
    pub fn weigh(&self, plan: &Production, v: usize, recent: &mut RecentRows) {
        if let Some(weighted) = &plan.weighted {
            let span = recent.extent(v);
            let (columns, rows) = (&self.column[span.clone()], &self.row[span.clone()]);
            weighted.apply(&plan.taught, columns, rows, &mut recent.row_mut(v).0[span]);
        }
    }

    /// Golden's weight at the taught coordinates of pixel `u`.
    pub fn weight(&self, plan: &Production, u: usize) -> Weight {
        match plan.weighted {
            Some(_) => {
                let place = self.row[u] as usize * plan.size().0 + self.column[u] as usize;
                plan.taught.weight(place)
            }
            None => Weight::FULL,
        }
    }

    /// Adds the compared pixels of a span to the cells that hold their taught coordinates.
    pub fn add_to_cells(
        &self,
        grid: &Grid,
        deviation: &[i32],
        span: Range<usize>,
        cells: &mut [Sum],
    ) {
        for u in span {
            if deviation[u] == NO_OFFSET {
                continue;
            }
            let cell = &mut cells[grid.cell(self.column[u], self.row[u])];
            cell.count += 1;
            cell.deviation += i64::from(deviation[u]);
        }
    }
}

impl Production {
    /// Whether the cells of a gauge or weights are looked up by taught coordinates.
    fn needs_coordinates(&self) -> bool {
        !self.gauges.patches.is_empty() || self.weighted.is_some()
    }
}
