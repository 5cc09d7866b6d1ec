//! Stage 3, align: the taught coordinates of a row's pixels, and how far they deviate from golden
//! there: in height, for cells, and along the normal, for squares.

use super::displaced::{
    BlockNumbers, Deviations, GoldenMap, OffsetRow, align_row, mask, pick, scaled,
    taught_coordinates,
};
use super::pose::{PoseField, blocks_of_row};
use crate::inspect::feature::{Grid, Sum};
use crate::inspect::strips::golden::Golden;
use crate::inspect::strips::measure::{HeightRow, RecentRows};
use crate::inspect::weight::Factor;
use crate::math::common;
use crate::math::nearest::whole;
use crate::pipeline::NO_OFFSET;
use crate::simd::{Backend, Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// What parts are compared with, and how this one lies.
#[derive(Clone, Copy)]
pub struct Comparison<'a> {
    pub backend: Backend,
    pub golden: &'a Golden,
    pub pose: &'a PoseField,
}

impl<'a> Comparison<'a> {
    fn map(self) -> GoldenMap<'a> {
        GoldenMap {
            height: &self.golden.cubics.surface().height,
            taught: self.golden.taught.pixels(),
            factor: self.golden.taught.factors(),
            width: self.golden.size().0,
        }
    }
}

/// For each pixel of a row the pixel of golden's frame that saw the same point of the part.
#[derive(Debug)]
pub struct TaughtCoordinates {
    /// Displacements along the row.
    blocks: Vec<BlockNumbers>,
    column: Vec<i32>,
    row: Vec<i32>,
    /// Deviations in height, nm; [`NO_OFFSET`] where the part is not compared.
    deviation: Vec<i32>,
    /// Whether coordinates are found of every row.
    cells: bool,
}

impl TaughtCoordinates {
    /// Of `width` pixels; with coordinates of every row if there are cells that ask for them.
    pub fn new(width: usize, cells: bool) -> Self {
        Self {
            cells,
            blocks: blocks_of_row(width),
            column: vec![0; width],
            row: vec![0; width],
            deviation: vec![NO_OFFSET; width],
        }
    }

    /// Takes the part's motion back in row `v`, whose heights were found last: its deviations
    /// become those from golden at the taught coordinates, along the normal.
    pub fn align(
        &mut self,
        with: Comparison<'_>,
        v: usize,
        columns: Range<usize>,
        heights: &HeightRow,
        recent: &mut RecentRows,
    ) {
        let Comparison {
            backend,
            golden,
            pose,
        } = with;
        let (width, rows) = golden.size();
        match pose.placed {
            Some(_) => {
                let columns = common(&columns, &recent.extent(v));
                if columns.is_empty() {
                    return;
                }
                pose.row(backend, (v, rows), &columns, &mut self.blocks);
                let (map, row) = (with.map(), offset_row(v, heights, &self.blocks));
                let out = Deviations {
                    height: &mut self.deviation,
                    normal: recent.row_mut(v).0,
                };
                align_row(backend, map, row, columns.clone(), out);
            }
            None => {
                let normal = &mut recent.row_mut(v).0[columns.clone()];
                let factors = &golden.taught.factors()[v * width..][columns.clone()];
                self.deviation[columns.clone()].copy_from_slice(normal);
                turn_to_normal(backend, factors, normal);
            }
        }
        if self.cells {
            self.find(with, v, columns, heights);
        }
    }

    /// Finds the taught coordinates of columns of row `v`, which was aligned last.
    pub fn find(
        &mut self,
        with: Comparison<'_>,
        v: usize,
        columns: Range<usize>,
        heights: &HeightRow,
    ) {
        let taught = (&mut *self.column, &mut *self.row);
        if with.pose.placed.is_some() {
            let row = offset_row(v, heights, &self.blocks);
            taught_coordinates(with.backend, with.map(), row, columns, taught);
        } else {
            taught.1[columns.clone()].fill(v as i32);
            for u in columns {
                taught.0[u] = u as i32;
            }
        }
    }

    /// What the height difference at pixel `u`, whose coordinates were found last, was multiplied
    /// by.
    pub fn factor(&self, golden: &Golden, u: usize) -> f64 {
        let place = self.row[u] as usize * golden.size().0 + self.column[u] as usize;
        golden.taught.factor(place)
    }

    /// Adds the compared pixels of a span to the cells that hold their taught coordinates.
    pub fn add_to_cells(&self, grid: &Grid, span: Range<usize>, cells: &mut [Sum]) {
        for u in span {
            let deviation = self.deviation[u];
            if deviation == NO_OFFSET {
                continue;
            }
            let cell = &mut cells[grid.cell(self.column[u], self.row[u])];
            cell.count += 1;
            cell.deviation += i64::from(deviation);
        }
    }
}

fn offset_row<'a>(v: usize, heights: &'a HeightRow, blocks: &'a [BlockNumbers]) -> OffsetRow<'a> {
    OffsetRow {
        v,
        offset: &heights.offset,
        blocks,
    }
}

back_end_entry! {
    /// Multiplies deviations in height by these factors.
    fn turn_to_normal [] = along_normal(factors: &[Factor], deviations: &mut [i32])
}

#[inline(always)]
fn along_normal<V: Lanes>(_: V, factors: &[Factor], deviations: &mut [i32]) {
    let factors = &factors[..deviations.len()];
    for i in 0..deviations.len() {
        let nm = deviations[i];
        let known = mask(nm != NO_OFFSET);
        deviations[i] = pick(
            known,
            whole(scaled(nm as f32, factors[i].units())),
            NO_OFFSET,
        );
    }
}
