//! Stage 1, decode: a row of all frames → absolute phase, modulation and trust of its pixels.

use super::{Input, Production};
use crate::phase::PhaseRow;
use crate::pipeline::PhaseMap;
use crate::units::AbsolutePhase;
use core::ops::Range;

impl Production {
    /// Decodes columns of row `v` into a map of one row; the others keep what they had.
    pub(super) fn decode(
        &self,
        input: Input<'_>,
        v: usize,
        columns: Range<usize>,
        row: &mut PhaseMap,
    ) {
        let out = PhaseRow {
            phase: &mut row.phase,
            modulation: &mut row.modulation,
            trust: &mut row.trust,
        };
        let (decoder, map) = (&self.decoder, self.map_row(v));
        match input {
            Input::Frames(frames) => decoder.row(frames, v, map, columns, out),
            Input::Finest(arrived, frames) => {
                decoder.last_row(arrived, frames, v, map, columns, out);
            }
            Input::Phases(phases) => {
                let there = v * phases.width + columns.start..v * phases.width + columns.end;
                out.phase[columns.clone()].copy_from_slice(&phases.phase[there.clone()]);
                out.modulation[columns.clone()].copy_from_slice(&phases.modulation[there.clone()]);
                out.trust[columns].copy_from_slice(&phases.trust[there]);
            }
        }
    }

    /// The map that phases are unwrapped about, row-major.
    pub fn map(&self) -> &[AbsolutePhase] {
        self.map.as_ref().unwrap_or(&self.cubics.surface().phase)
    }

    /// The row of the map that phases are unwrapped about; empty if the sequence needs none.
    pub(super) fn map_row(&self, v: usize) -> &[AbsolutePhase] {
        let width = self.cubics.surface().width;
        if self.decoder.unwrapping().needs_map() {
            &self.map()[v * width..(v + 1) * width]
        } else {
            &[]
        }
    }
}
