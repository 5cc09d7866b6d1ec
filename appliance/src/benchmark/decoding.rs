//! The product's decoder as something to time.

use super::frames::{FrameSet, Output};
use super::kernel::Kernel;
use super::stopwatch::timed;
use algo::phase::{Decoder, PhaseRow, Scratch};
use std::ops::Range;
use std::time::Duration;

/// A decoder on one thread, into memory that is there already.
pub struct Decoding {
    decoder: Decoder,
    scratch: Scratch,
    /// The columns of each row that somebody looks at; none = all.
    window: Option<Vec<Range<usize>>>,
}

impl Decoding {
    /// With a decoder; rows without a column in `window` are left out.
    pub fn new(decoder: Decoder, window: Option<Vec<Range<usize>>>) -> Self {
        Self {
            decoder,
            scratch: Scratch::default(),
            window,
        }
    }
}

impl Kernel for Decoding {
    fn run(&mut self, set: &mut FrameSet) -> Duration {
        let width = set.width().max(1);
        timed(|| {
            let (frames, map, out) = set.parts();
            let Output {
                phase,
                modulation,
                trust,
            } = out;
            let rows = phase
                .chunks_mut(width)
                .zip(modulation.chunks_mut(width))
                .zip(trust.chunks_mut(width));
            for (v, ((phase, modulation), trust)) in rows.enumerate() {
                let looked_at = self.window.as_ref().map(|window| &window[v]);
                if looked_at.is_some_and(Range::is_empty) {
                    continue;
                }
                let row = PhaseRow {
                    phase,
                    modulation,
                    trust,
                };
                let map = map.map(|map| &map[v * width..(v + 1) * width]);
                self.decoder.row(&frames, v, map, &mut self.scratch, row);
            }
        })
    }

    fn turns(&self, set: &FrameSet) -> Vec<f64> {
        let found = set.out.phase.iter();
        let turns = |phase: &algo::units::AbsolutePhase| {
            if phase.is_known() {
                phase.turns()
            } else {
                f64::NAN
            }
        };
        found.map(turns).collect()
    }
}
