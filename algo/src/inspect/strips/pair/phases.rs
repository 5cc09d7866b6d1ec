//! The phases of a pair of frames.

use super::expected::Expectation;
use super::sums::SIDE;
use super::window::{BAND_ROWS, Band, Windows};
use crate::frame::FrameView;
use crate::inspect::align::{Alignment, Spot};
use crate::inspect::strips::align::{BlockNumbers, blocks_of_row};
use crate::inspect::strips::measure::PhasePlan;
use crate::phase::PhaseRow;
use crate::pipeline::{PhaseMap, for_each};
use alloc::vec::Vec;

/// The buffers of a pair, allocated once.
#[derive(Debug)]
pub struct PairBuffers {
    windows: Windows,
    /// What was measured last.
    phases: PhaseMap,
    /// Of each band of rows: the buffers of its windows, and the displacements along a row.
    bands: Vec<(Band, Vec<BlockNumbers>)>,
}

impl PairBuffers {
    /// For frames of this size, decoded as planned.
    pub fn new((width, height): (usize, usize), phase: &PhasePlan) -> Self {
        let decoder = &phase.decoder;
        Self {
            windows: Windows::new(
                decoder.backend(),
                decoder.bit_depth(),
                phase.noise_counts,
                decoder.least_modulation(),
            ),
            phases: PhaseMap::new(width, height),
            bands: (0..height.div_ceil(BAND_ROWS))
                .map(|_| (Band::default(), blocks_of_row(width)))
                .collect(),
        }
    }

    /// What was measured last, for [`Input::Phases`](crate::inspect::Input::Phases).
    pub fn phases(&self) -> &PhaseMap {
        &self.phases
    }

    /// Measures the phases of a part that lies as in a field, as taught if none: in all rows, or
    /// only in those that its motion is found from.
    pub fn fit(
        &mut self,
        expectation: Expectation<'_>,
        frames: [FrameView<'_>; 2],
        only: Option<&Alignment>,
    ) {
        let Self {
            windows,
            phases,
            bands,
        } = self;
        let mut rows = phases.rows();
        let work: Vec<_> = rows.chunks_mut(BAND_ROWS).zip(bands).collect();
        for_each(work, |at, (rows, (band, blocks))| {
            let top = at * BAND_ROWS;
            let mut fit = |rows: &mut [PhaseRow<'_>], top: usize| {
                windows.fit(frames, top, rows, band, |v, out| {
                    expectation.row(v, blocks, out);
                });
            };
            let Some(alignment) = only else {
                return fit(rows, top);
            };
            let (_, spots) = alignment.spots(top..top + rows.len());
            for near in spots.chunk_by(share_rows) {
                let (first, last) = (near[0].v, near[near.len() - 1].v);
                fit(&mut rows[first - top..=last - top], first);
            }
        });
    }
}

/// Whether the windows of two spots share rows.
fn share_rows(a: &Spot, b: &Spot) -> bool {
    b.v - a.v < SIDE
}
