//! Stage 4, accumulate: the square of largest mean weighted deviation about the pixels of each row.
//!
//! Sums down the columns slide from row to row: the row that enters the squares is added, the one
//! that leaves them is taken out. Sums over squares follow from these along the row ([`extreme`]). What
//! deviates elsewhere is kept, too ([`rivals`]).

pub mod extreme;
pub mod rivals;

use crate::inspect::strips::accumulate::gauges::Gauges;
use crate::inspect::strips::align::Comparison;
use crate::inspect::strips::measure::RecentRows;
use crate::math::{common, hull};
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use extreme::{COUNT_BIT, SquareRow};
use rivals::Extremes;

/// The squares of a strip.
#[derive(Debug)]
pub struct Squares {
    /// For each side the packed sums down the columns, with half a side of padding at both ends.
    columns: Vec<Vec<i64>>,
    /// The deviations of a row about whose pixels squares have the side that is looked at; of plans
    /// with several sides.
    centres: Vec<i32>,
    /// The largest of the plan's squares.
    pub extremes: Vec<Extremes>,
}

impl Squares {
    /// Of a strip's own rows of `width` pixels.
    pub fn new(gauges: &Gauges, width: usize, rows: &Range<usize>) -> Self {
        let sides = gauges.sides.iter();
        let padded = sides.map(|of| vec![0; width + of.side / 2 * 2]);
        let squares = gauges.squares.iter();
        let partly = squares.clone().any(|squares| squares.partly);
        let extremes = squares.map(|squares| Extremes::new(squares.side, rows, width));
        Self {
            columns: padded.collect(),
            centres: vec![NO_OFFSET; if partly { width } else { 0 }],
            extremes: extremes.collect(),
        }
    }

    /// Bytes of its tiles.
    pub fn bytes(&self) -> usize {
        self.extremes.iter().map(Extremes::bytes).sum()
    }

    pub fn clear(&mut self) {
        for sums in &mut self.columns {
            sums.fill(0);
        }
        self.extremes.iter_mut().for_each(Extremes::clear);
    }

    /// Slides the sums of each side down to row `v`, and looks at the squares that are complete
    /// with it and whose middle is one of the strip's `own` rows. `written` are the rows that there
    /// are deviations of.
    pub fn slide(
        &mut self,
        with: Comparison<'_>,
        gauges: &Gauges,
        v: usize,
        recent: &RecentRows,
        (own, written): (&Range<usize>, &Range<usize>),
    ) {
        let Comparison {
            backend,
            golden,
            pose,
        } = with;
        let Self {
            columns,
            centres,
            extremes,
        } = self;
        for (of, sums) in gauges.sides.iter().zip(columns) {
            let (side, half) = (of.side, of.side / 2);
            let written = common(written, &of.reached(&of.rows));
            let row_of = |v: usize| {
                let (row, extent) = recent.row_of(v, &written);
                (row, common(&extent, &of.reached(&of.columns)))
            };
            let (new, entering) = row_of(v);
            // Above the frame this is no written row.
            let (old, leaving) = row_of(v.wrapping_sub(2 * half + 1));
            let changed = hull(entering, leaving);
            let inside = &mut sums[half + changed.start..half + changed.end];
            slide_columns(backend, inside, &new[changed.clone()], &old[changed]);
            let seen = (v.saturating_sub(2 * half)..=v)
                .map(|v| row_of(v).1)
                .fold(0..0, hull);
            let seen = common(&seen, &of.columns);
            let middle = v.checked_sub(half).filter(|v| own.contains(v));
            let Some(middle) = middle.filter(|_| !seen.is_empty()) else {
                continue;
            };
            let squares = gauges.squares.iter().zip(&mut *extremes);
            for (squares, extremes) in squares.filter(|(squares, _)| squares.side == side) {
                let mut row = SquareRow {
                    sums,
                    centres: recent.row(middle),
                    side,
                    row: middle,
                };
                if squares.partly {
                    let least = golden.taught.least_sides(middle, golden.size().0);
                    let places = row.centres.iter().zip(least);
                    for (centre, (&nm, &least)) in centres.iter_mut().zip(places) {
                        let own = squares.smallest.max(usize::from(least)) == side;
                        *centre = if own { nm } else { NO_OFFSET };
                    }
                    row.centres = centres;
                }
                let region = gauges.region(pose, squares.gauge);
                for (_, span) in region.map_or(&[][..], |region| region.row(middle)) {
                    let span = common(span, &seen);
                    extremes.update(middle, &span, |found, span| row.search(found, span));
                }
            }
        }
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
