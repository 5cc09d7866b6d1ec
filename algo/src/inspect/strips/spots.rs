//! A row of rises → where its pixels lie on the part as taught, and how far they deviate from golden there.

use super::Production;
use super::squares::MAX_TAME;
use super::stance::{Node, SPACING};
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
    pub stance: &'a super::stance::Stance,
    /// The row.
    pub v: usize,
    /// Its columns.
    pub columns: Range<usize>,
    /// Rises above golden's surface on the pixels' own rays.
    pub rise: &'a [i32],
}

/// No displacement reaches so many pixels: others are none.
const MAX_AWAY: f32 = 4096.0;

impl Spots {
    /// Room for a row of `width` pixels.
    pub fn new(width: usize) -> Self {
        let room = || vec![0; width];
        Self {
            nodes: super::stance::room(width),
            column: room(),
            row: room(),
        }
    }

    /// Works out the spots, and turns deviations into those from golden where the part had the spot; the answer is whether
    /// one of them is too large for the sums of [`MAX_TAME`].
    pub fn find(&mut self, seen: &Seen<'_>, deviation: &mut [i32]) -> bool {
        let (plan, v) = (seen.plan, seen.v);
        let (width, height) = plan.size();
        seen.stance.row(v, height, &mut self.nodes);
        let bases = &plan.rises.surface().height[v * width..(v + 1) * width];
        let middle = plan.levels.0 as f32;
        let mut wild = false;
        let mut start = seen.columns.start;
        while start < seen.columns.end {
            let block = start / SPACING;
            let end = ((block + 1) * SPACING).min(seen.columns.end);
            let left = block * SPACING;
            let right = ((block + 1) * SPACING).min(width - 1);
            let (a, b) = (
                &self.nodes[block],
                &self.nodes[(block + 1).min(self.nodes.len() - 1)],
            );
            let unit = 1.0 / (right - left).max(1) as f32;
            for u in start..end {
                if seen.rise[u] == NO_RISE {
                    continue;
                }
                let base = if bases[u].is_known() {
                    bases[u].nm()
                } else {
                    0
                };
                let z = base.saturating_add(seen.rise[u]);
                let node = a.between(b, (u - left) as f32 * unit);
                let above = z as f32 * 1e-6 - middle;
                let at = |i: usize| node.value[i] + node.slope[i] * above;
                let (du, dv) = (at(0), at(1));
                let near = du > -MAX_AWAY && du < MAX_AWAY && dv > -MAX_AWAY && dv < MAX_AWAY;
                if !near {
                    deviation[u] = NO_RISE;
                    continue;
                }
                let back = z.saturating_add(rounded(at(2) * 1e6));
                self.column[u] = u as i32 + floor(du + 0.5);
                self.row[u] = v as i32 + floor(dv + 0.5);
                deviation[u] = match plan.golden_nm((u, v), (du, dv)) {
                    // One above the value for "unknown".
                    Some(golden) => back.saturating_sub(golden).max(NO_RISE + 1),
                    None => NO_RISE,
                };
                wild |= deviation[u] != NO_RISE && deviation[u].unsigned_abs() > MAX_TAME;
            }
            start = end;
        }
        wild
    }

    /// The spots of row `v` of a part that lies as taught.
    pub fn stay(&mut self, v: usize, columns: Range<usize>) {
        self.row[columns.clone()].fill(v as i32);
        for u in columns {
            self.column[u] = u as i32;
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

impl Production {
    /// Golden's height in nm at a displacement from pixel (u, v), between four pixels that are all compared.
    #[inline(always)]
    fn golden_nm(&self, (u, v): (usize, usize), (du, dv): (f32, f32)) -> Option<i32> {
        let (width, rows) = self.size();
        let (cu, cv) = (floor(du), floor(dv));
        let (column, row) = (u as i32 + cu, v as i32 + cv);
        let inside = column >= 0 && row >= 0 && column + 1 < width as i32 && row + 1 < rows as i32;
        if !inside {
            return None;
        }
        let place = row as usize * width + column as usize;
        let below = place + width;
        let compared = self.taught.compared(place)
            & self.taught.compared(place + 1)
            & self.taught.compared(below)
            & self.taught.compared(below + 1);
        if !compared {
            return None;
        }
        let heights = &self.rises.surface().height;
        let first = heights[place].nm();
        let over = |at: usize| heights[at].nm().wrapping_sub(first) as f32;
        let (right, under, both) = (over(place + 1), over(below), over(below + 1));
        let (fu, fv) = (du - cu as f32, dv - cv as f32);
        let rise = fu * right + fv * (under + fu * (both - under - right));
        Some(first.saturating_add(rounded(rise)))
    }
}

/// The nearest whole number, halves away from 0.
#[inline(always)]
fn rounded(x: f32) -> i32 {
    (x + if x < 0.0 { -0.5 } else { 0.5 }) as i32
}

/// The next whole number below.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut - i32::from((cut as f32) > x)
}
