//! A row of rises → where its pixels lie on the part as taught, and how far they deviate from golden there.

use super::Production;
use super::displaced::{Found, Golden, Row, find_row};
use super::pose::{Node, Stance};
use crate::inspect::Weight;
use crate::inspect::gauge::{Grid, Sum};
use crate::pipeline::NO_RISE;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// A row of pixels with the part's motion taken back: the pixel that saw each when the part was taught.
#[derive(Debug)]
pub(super) struct Spots {
    nodes: Vec<Node>,
    column: Vec<i32>,
    row: Vec<i32>,
}

/// What a row of spots is worked out from.
pub(super) struct Seen<'a> {
    pub plan: &'a Production,
    pub stance: &'a Stance,
    /// The row.
    pub v: usize,
    /// Its columns.
    pub columns: Range<usize>,
    /// Rises above golden's surface on the pixels' own rays.
    pub rise: &'a [i32],
}

impl Spots {
    /// Room for a row of `width` pixels.
    pub fn new(width: usize) -> Self {
        let room = || vec![0; width];
        Self {
            nodes: super::pose::room(width),
            column: room(),
            row: room(),
        }
    }

    /// Works out the spots, and turns deviations into those from golden where the part had the spot; the answer is whether
    /// one of them is too large for the sums of [`super::squares::narrow::MAX_TAME`].
    pub fn find(&mut self, seen: &Seen<'_>, deviation: &mut [i32]) -> bool {
        let plan = seen.plan;
        let (width, height) = plan.size();
        seen.stance.row(seen.v, height, &mut self.nodes);
        let golden = Golden {
            height: &plan.rises.surface().height,
            taught: &plan.taught.pixels,
            width,
        };
        let row = Row {
            v: seen.v,
            rise: seen.rise,
            nodes: &self.nodes,
            middle: plan.levels.0 as f32,
        };
        let mut wild = false;
        let found = Found {
            deviation,
            column: &mut self.column,
            row: &mut self.row,
            wild: &mut wild,
        };
        find_row(
            plan.decoder.backend(),
            golden,
            row,
            seen.columns.clone(),
            found,
        );
        wild
    }

    /// The spots of row `v` of a part that lies as taught.
    pub fn stay(&mut self, v: usize, columns: Range<usize>) {
        self.row[columns.clone()].fill(v as i32);
        for u in columns {
            self.column[u] = u as i32;
        }
    }

    /// Multiplies the deviations of a span by the weights of golden where the part had them.
    pub fn weigh(&self, plan: &Production, deviation: &mut [i32], span: Range<usize>) {
        if let Some(weighted) = &plan.weighted {
            let (columns, rows) = (&self.column[span.clone()], &self.row[span.clone()]);
            weighted.apply(&plan.taught, columns, rows, &mut deviation[span]);
        }
    }

    /// The weight of golden where the part had what pixel `u` sees.
    pub fn weight(&self, plan: &Production, u: usize) -> Weight {
        match plan.weighted {
            Some(_) => {
                let place = self.row[u] as usize * plan.size().0 + self.column[u] as usize;
                plan.taught.weight(place)
            }
            None => Weight::FULL,
        }
    }

    /// Adds the compared pixels of a span to the cells in which the part had them.
    pub fn gather(&self, grid: &Grid, deviation: &[i32], span: Range<usize>, sums: &mut [Sum]) {
        for u in span {
            if deviation[u] == NO_RISE {
                continue;
            }
            let sum = &mut sums[grid.cell(self.column[u], self.row[u])];
            sum.count += 1;
            sum.deviation += i64::from(deviation[u]);
        }
    }
}
