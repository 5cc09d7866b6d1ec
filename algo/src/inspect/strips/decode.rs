//! Stage 1, decode: a row of all frames → absolute phase, modulation and trust of its pixels.

use super::{Input, Production};
use crate::phase::{PhaseRow, Trust};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// The phases of the row that a strip works on.
#[derive(Debug)]
pub(super) struct DecodedRow {
    pub phase: Vec<AbsolutePhase>,
    pub modulation: Vec<Modulation>,
    pub trust: Vec<Trust>,
}

impl DecodedRow {
    /// Of `width` pixels.
    pub fn new(width: usize) -> Self {
        Self {
            phase: vec![AbsolutePhase::UNKNOWN; width],
            modulation: vec![Modulation::default(); width],
            trust: vec![Trust::default(); width],
        }
    }

    /// Decodes columns of row `v`; the others keep what they had.
    pub fn decode(&mut self, plan: &Production, input: Input<'_>, v: usize, columns: Range<usize>) {
        let out = PhaseRow {
            phase: &mut self.phase,
            modulation: &mut self.modulation,
            trust: &mut self.trust,
        };
        let (decoder, map) = (&plan.decoder, plan.map_row(v));
        match input {
            Input::Frames(frames) => decoder.row(frames, v, map, columns, out),
            Input::Finest(arrived, frames) => {
                decoder.last_row(arrived, frames, v, map, columns, out);
            }
        }
    }
}

impl Production {
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
