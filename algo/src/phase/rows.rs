//! Decoding row by row: all levels at once, or each when it arrives.

use super::arrived::{Arrived, ArrivingRow, ClimbedRow, WrappedRow};
use super::kernel::{about, geometric, on_arrival};
use super::narrow::{FewClimbed, FewResults, FewWrapped, MAX_PIXELS, RowSample, padded};
use super::unwrap::Unwrapper;
use super::{Decoder, PhaseRow};
use crate::frame::FrameView;
use crate::pattern::{MAX_FRAMES, MAX_LEVELS, MAX_SHIFTS};
use crate::simd::Results;
use crate::units::AbsolutePhase;
use alloc::vec::Vec;
use core::ops::Range;

impl Decoder {
    /// Room for what the levels say that are decoded on arrival, of frames of this size.
    pub fn arrived(&self, width: usize, height: usize) -> Arrived {
        match &self.unwrapper {
            Unwrapper::Geometric(_) => Arrived::climbing(width, height),
            Unwrapper::About(_) => Arrived::wrapping(width, height, self.levels.len() - 1),
        }
    }

    /// Decodes `columns` of row `v` of frames that [`Self::check`] has passed, into the same columns of `out`.
    ///
    /// `map` is the row of the known map for dense and single-level sequences and is not looked at otherwise.
    pub fn row(
        &self,
        frames: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        if self.bit_depth == 8 {
            self.typed_row::<u8>(frames, v, map, columns, out);
        } else {
            self.typed_row::<u16>(frames, v, map, columns, out);
        }
    }

    /// Decodes row `v` of level `level`, whose frames [`Self::check_level`] has passed; not where the levels before found a
    /// whole block dark.
    pub(crate) fn arrive_row(
        &self,
        level: usize,
        frames: &[FrameView<'_>],
        v: usize,
        row: ArrivingRow<'_>,
    ) {
        if self.bit_depth == 8 {
            self.typed_arrival::<u8>(level, frames, v, row);
        } else {
            self.typed_arrival::<u16>(level, frames, v, row);
        }
    }

    /// As [`Self::row`], from all levels but the finest, which have arrived, and the frames of the finest.
    pub fn last_row(
        &self,
        arrived: &Arrived,
        last: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        if self.bit_depth == 8 {
            self.typed_last::<u8>(arrived, last, v, map, columns, out);
        } else {
            self.typed_last::<u16>(arrived, last, v, map, columns, out);
        }
    }

    fn typed_row<T: RowSample>(
        &self,
        frames: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let places = self.levels.iter().flat_map(|level| &level.frames);
        // A sequence has no more frames than fit. Filled in place: `collect` moves all 8 KiB of it, for every row.
        let mut rows: heapless::Vec<&[T], MAX_FRAMES> = heapless::Vec::new();
        rows.extend(places.map(|&at| T::row(frames[at], v)));
        if columns.len() >= MAX_PIXELS {
            return self.columns(&rows, map, columns, out);
        }
        let near = near(&columns, width(&rows));
        let padded = padded_rows(&rows, &near);
        let mut around: heapless::Vec<&[T], MAX_FRAMES> = heapless::Vec::new();
        around.extend(near_rows(&rows, &padded, &near));
        let mut few = FewResults::new();
        let map = few_known(map, &near);
        self.columns(&around, &map, 0..MAX_PIXELS, few.row());
        few.copy_to(out, columns, near.start);
    }

    /// From the rows of all frames, level by level.
    fn columns<T: RowSample>(
        &self,
        mut rows: &[&[T]],
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let mut levels: heapless::Vec<&[&[T]], MAX_LEVELS> = heapless::Vec::new();
        for level in &self.levels {
            let (here, rest) = rows.split_at(level.frames.len());
            levels.extend([here]);
            rows = rest;
        }
        let out = results(out, &columns);
        match &self.unwrapper {
            Unwrapper::Geometric(plan) => {
                geometric::climb_row(self.backend, plan, &self.levels, &levels, columns, out);
            }
            Unwrapper::About(plan) => {
                about::around_row(self.backend, plan, &self.levels, &levels, map, columns, out);
            }
        }
    }

    fn typed_arrival<T: RowSample>(
        &self,
        level: usize,
        frames: &[FrameView<'_>],
        v: usize,
        row: ArrivingRow<'_>,
    ) {
        let mut rows = LevelRows::new();
        rows.extend(frames.iter().map(|&frame| T::row(frame, v)));
        let width = width(&rows);
        if width >= MAX_PIXELS {
            return self.arrive(level, &rows, width, row);
        }
        let columns = 0..width;
        let padded = padded_rows(&rows, &columns);
        let mut around = LevelRows::new();
        around.extend(near_rows(&rows, &padded, &columns));
        let rows = around;
        match row {
            ArrivingRow::Climbing(out) => {
                let mut few = FewClimbed::padded(out.as_row(), &columns);
                self.arrive(
                    level,
                    &rows,
                    MAX_PIXELS,
                    ArrivingRow::Climbing(few.row_mut()),
                );
                out.fraction.copy_from_slice(&few.fraction[..width]);
                out.turns.copy_from_slice(&few.turns[..width]);
                out.doubt.copy_from_slice(&few.doubt[..width]);
            }
            ArrivingRow::Wrapping { row: out, .. } => {
                let mut few = FewWrapped::<MAX_PIXELS>::new();
                let row = ArrivingRow::Wrapping {
                    coarsest: None,
                    row: few.row_mut(),
                };
                self.arrive(level, &rows, MAX_PIXELS, row);
                out.phase.copy_from_slice(&few.phase[..width]);
                out.doubts.copy_from_slice(&few.doubts[..width]);
            }
        }
    }

    fn arrive<T: RowSample>(&self, at: usize, rows: &[&[T]], width: usize, row: ArrivingRow<'_>) {
        let level = &self.levels[at];
        match (&self.unwrapper, row) {
            (Unwrapper::Geometric(plan), ArrivingRow::Climbing(row)) => {
                on_arrival::arrive_row(self.backend, plan, at, level, rows, 0..width, row);
            }
            (_, ArrivingRow::Wrapping { coarsest, row }) => {
                about::wrap_row(self.backend, level, rows, coarsest, 0..width, row);
            }
            // `Decoder::arrived` gives geometric levels the one, and others the other.
            (Unwrapper::About(_), ArrivingRow::Climbing(_)) => {}
        }
    }

    fn typed_last<T: RowSample>(
        &self,
        arrived: &Arrived,
        last: &[FrameView<'_>],
        v: usize,
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let mut rows = LevelRows::new();
        rows.extend(last.iter().map(|&frame| T::row(frame, v)));
        let (climbed, wrapped) = (arrived.climbed_row(v), arrived.wrapped_rows(v));
        if columns.len() >= MAX_PIXELS {
            return self.last(&rows, climbed, &wrapped, map, columns, out);
        }
        let near = near(&columns, width(&rows));
        let padded = padded_rows(&rows, &near);
        let mut around = LevelRows::new();
        around.extend(near_rows(&rows, &padded, &near));
        let rows = around;
        let climbed = climbed.map(|row| FewClimbed::padded(row, &near));
        let wrapped = wrapped.iter().map(|row| FewWrapped::padded(*row, &near));
        let wrapped: heapless::Vec<_, MAX_LEVELS> = wrapped.collect();
        let wrapped: heapless::Vec<_, MAX_LEVELS> = wrapped.iter().map(FewWrapped::row).collect();
        let climbed = climbed.as_ref().map(FewClimbed::row);
        let mut few = FewResults::new();
        let map = few_known(map, &near);
        self.last(&rows, climbed, &wrapped, &map, 0..MAX_PIXELS, few.row());
        few.copy_to(out, columns, near.start);
    }

    fn last<T: RowSample>(
        &self,
        rows: &[&[T]],
        climbed: Option<ClimbedRow<'_>>,
        wrapped: &[WrappedRow<'_>],
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    ) {
        let out = results(out, &columns);
        let backend = self.backend;
        match (&self.unwrapper, climbed, &self.levels[..]) {
            (Unwrapper::Geometric(plan), _, [_]) => {
                geometric::climb_row(backend, plan, &self.levels, &[rows], columns, out);
            }
            (Unwrapper::Geometric(plan), Some(before), [.., level]) => {
                on_arrival::last_row(backend, plan, level, rows, before, columns, out);
            }
            (Unwrapper::About(plan), _, levels) => {
                about::last_row(backend, plan, levels, wrapped, rows, map, columns, out);
            }
            // A decoder has levels, and gives geometric ones such room.
            (Unwrapper::Geometric(_), ..) => {}
        }
    }
}

/// Where the kernels write.
fn results<'a>(out: PhaseRow<'a>, columns: &Range<usize>) -> Results<'a> {
    Results::new(out.phase, out.modulation, out.trust, columns.end)
}

/// The rows of a level's frames, filled in place as those of all frames are.
type LevelRows<'a, T> = heapless::Vec<&'a [T], MAX_SHIFTS>;

/// Pixels of a row.
fn width<T>(rows: &[&[T]]) -> usize {
    rows.first().map_or(0, |row| row.len())
}

/// A block of columns around a few; the whole row if it is narrower.
fn near(columns: &Range<usize>, width: usize) -> Range<usize> {
    let start = columns.start.min(width.saturating_sub(MAX_PIXELS));
    start..(start + MAX_PIXELS).min(width)
}

/// Copies of rows that are narrower than a block, none of others.
fn padded_rows<T: RowSample>(rows: &[&[T]], near: &Range<usize>) -> Vec<[T; MAX_PIXELS]> {
    let narrow = rows.iter().filter(|_| near.len() < MAX_PIXELS);
    narrow.map(|row| padded(row, near)).collect()
}

/// The rows' columns, or the copies that are wide enough.
fn near_rows<'a, T>(
    rows: &[&'a [T]],
    padded: &'a [[T; MAX_PIXELS]],
    near: &Range<usize>,
) -> impl Iterator<Item = &'a [T]> {
    rows.iter()
        .enumerate()
        .map(|(at, row)| match padded.get(at) {
            Some(padded) => &padded[..],
            None => &row[near.clone()],
        })
}

fn few_known(map: &[AbsolutePhase], columns: &Range<usize>) -> [AbsolutePhase; MAX_PIXELS] {
    let mut known = [AbsolutePhase::UNKNOWN; MAX_PIXELS];
    if let Some(map) = map.get(columns.clone()) {
        known[..map.len()].copy_from_slice(map);
    }
    known
}
