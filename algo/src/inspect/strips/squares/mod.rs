//! Stage 4, accumulate: the square of largest mean weighted deviation about the pixels of each row.
//!
//! Sums down the columns slide from row to row: the row that enters the squares is added, the one that leaves them is taken out.
//! Sums over squares follow from these along the row: in 32 bits where all deviations are small ([`narrow`]), to find the few
//! places where the largest may be, and exactly there ([`extreme`]). What deviates elsewhere is kept, too ([`rivals`]).

pub(super) mod extreme;
pub(super) mod narrow;
pub(super) mod rivals;

use super::pose::PoseField;
use super::recent::RecentRows;
use super::{Measure, Production, common};
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use extreme::SquareRow;
use narrow::NarrowSums;
use rivals::Extremes;

/// A packed sum holds the number of its terms above this bit, and their sum below it.
const COUNT_BIT: u32 = 44;

/// The squares of a strip.
#[derive(Debug)]
pub(super) struct Squares {
    /// For each side the packed sums down the columns, with half a side of padding at both ends.
    columns: Vec<Vec<i64>>,
    narrow: NarrowSums,
    /// Per gauge: the squares of largest deviation.
    pub extremes: Vec<Extremes>,
}

impl Squares {
    /// Of a strip's own rows.
    pub fn new(plan: &Production, rows: &Range<usize>) -> Self {
        let (width, sides) = (plan.size().0, &plan.gauges.sides);
        let padding = sides.iter().max().map_or(0, |side| side / 2 * 2);
        let padded = sides.iter().map(|side| vec![0; width + side / 2 * 2]);
        let extremes = plan.gauges.list.iter().map(|gauge| match gauge.measure {
            Measure::Deviation { side } => Extremes::new(side, rows, width),
            _ => Extremes::default(),
        });
        Self {
            columns: padded.collect(),
            narrow: NarrowSums::new(width + padding),
            extremes: extremes.collect(),
        }
    }

    pub fn clear(&mut self) {
        for sums in &mut self.columns {
            sums.fill(0);
        }
        self.extremes.iter_mut().for_each(Extremes::clear);
    }

    /// Slides the sums of each side down to row `v`, and looks at the squares that are complete with it and whose middle is one
    /// of the strip's `own` rows. `written` are the rows that there are deviations of.
    pub fn slide(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        v: usize,
        recent: &RecentRows,
        (own, written): (&Range<usize>, &Range<usize>),
    ) {
        let backend = plan.decoder.backend();
        for (&side, sums) in plan.gauges.sides.iter().zip(&mut self.columns) {
            let half = side / 2;
            let (new, entering) = recent.row_of(v, written);
            // Above the frame this is no written row.
            let (old, leaving) = recent.row_of(v.wrapping_sub(2 * half + 1), written);
            let changed = hull(entering, leaving);
            let inside = &mut sums[half + changed.start..half + changed.end];
            slide_columns(backend, inside, &new[changed.clone()], &old[changed]);
            let seen = (v.saturating_sub(2 * half)..=v)
                .map(|v| recent.row_of(v, written).1)
                .fold(0..0, hull);
            let Some(middle) = v.checked_sub(half).filter(|v| own.contains(v)) else {
                continue;
            };
            let overflows = recent.overflow.is_some_and(|row| row + 2 * half >= v);
            let narrow = !overflows && NarrowSums::hold(side);
            if narrow {
                self.narrow.add(backend, sums, side, seen.clone());
            }
            let row = SquareRow {
                sums,
                centres: recent.row(middle),
                side,
                row: middle,
            };
            let gauges = plan.gauges.list.iter().zip(&mut self.extremes);
            for (at, (gauge, extremes)) in gauges.enumerate() {
                if gauge.measure == (Measure::Deviation { side }) {
                    for (_, span) in pose.region(plan, at).row(middle) {
                        let span = common(span, &seen);
                        extremes.update(middle, &span, |found, span| match narrow {
                            true => self.narrow.search(backend, &row, span, found),
                            false => row.search_both(found, span),
                        });
                    }
                }
            }
        }
    }
}

/// The columns from the first to the last of either.
fn hull(a: Range<usize>, b: Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b,
        (_, true) => a,
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

back_end_entry! {
    /// Adds a row to packed sums down the columns, and takes one out of them.
    fn slide_columns [] = slide(sums: &mut [i64], new: &[i32], old: &[i32])
}

#[inline(always)]
fn slide<V: Lanes>(_: V, sums: &mut [i64], new: &[i32], old: &[i32]) {
    let length = sums.len();
    let (new, old) = (&new[..length], &old[..length]);
    for i in 0..length {
        let (enters, leaves) = (new[i] != NO_OFFSET, old[i] != NO_OFFSET);
        let nm =
            i64::from(if enters { new[i] } else { 0 }) - i64::from(if leaves { old[i] } else { 0 });
        let count = i64::from(i32::from(enters) - i32::from(leaves));
        sums[i] = sums[i].wrapping_add(nm).wrapping_add(count << COUNT_BIT);
    }
}
