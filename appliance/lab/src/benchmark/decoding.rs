//! What of the product is timed: its decoder, and all of production from frames to readings.

use super::timing::{FrameSet, Kernel, views};
use crate::Failed;
use algo::inspect::{Input, Maps, Production, Signal, Strips};
use algo::pattern::{PhaseRange, Sequence};
use algo::phase::{Arrived, DecodeError, Decoder, PhaseRow};
use algo::pipeline::{PhaseMap, arrive_rest};
use algo::simd::Backend;
use appliance::production::stopwatch::timed;
use appliance::recipe::plan::STRIPS;
use std::collections::VecDeque;
use std::hint::black_box;
use std::ops::Range;
use std::time::Duration;

/// The decoder on each back-end of this machine, with the back-end's name.
///
/// # Errors
/// If the sequence cannot be decoded.
pub fn decoders(
    sequence: &Sequence,
    range: PhaseRange,
    bit_depth: u8,
) -> Result<Vec<(&'static str, Decoder)>, Failed> {
    let decoder = Decoder::new(sequence, range, bit_depth)?;
    Ok(Backend::available()
        .map(|backend| (backend.name(), decoder.clone().with_backend(backend)))
        .collect())
}

/// A decoder that writes into memory allocated before.
pub struct Decoding {
    decoder: Decoder,
    /// The columns of each row whose finest level is decoded; `None` for all.
    window: Option<Vec<Range<usize>>>,
    /// Whether only the last level is timed.
    only_last: bool,
    /// How many frame sets are decoded in turn with coarser levels of their own.
    copies: usize,
    /// The coarser levels, with those of the current set in front.
    levels: VecDeque<Arrived>,
}

impl Decoding {
    /// Decoding of all levels, one after the other; of the finest, rows without a column in
    /// `window` are left out.
    pub fn new(decoder: Decoder, window: Option<Vec<Range<usize>>>) -> Self {
        Self {
            decoder,
            window,
            only_last: false,
            copies: 1,
            levels: VecDeque::new(),
        }
    }

    /// Decoding that is timed on the last level only, for `copies` frame sets with the same samples.
    /// Every set has its own decoded levels: they were last used as long ago as the frames, so that
    /// they come from no cache either.
    pub fn after_the_last(decoder: Decoder, copies: usize) -> Self {
        Self {
            only_last: true,
            copies,
            ..Self::new(decoder, None)
        }
    }

    /// Memory for the levels of a set, decoded if only the last is timed.
    fn arrived(&self, set: &FrameSet) -> Arrived {
        let width = set.out.width;
        let mut arrived = self.decoder.arrived(width, set.pixels() / width.max(1));
        if self.only_last {
            // The frames are those that the decoder was made for.
            let _ = arrive_rest(&self.decoder, &views(&set.frames), &mut arrived);
        }
        arrived
    }

    fn decode(&mut self, set: &mut FrameSet) -> Result<(), DecodeError> {
        let Some(arrived) = self.levels.front_mut() else {
            return Ok(());
        };
        if !self.only_last {
            arrived.restart();
        }
        let last = arrive_rest(&self.decoder, &views(&set.frames), arrived)?;
        let PhaseMap {
            width,
            phase,
            modulation,
            trust,
        } = &mut set.out;
        let width = (*width).max(1);
        let rows = phase
            .chunks_mut(width)
            .zip(modulation.chunks_mut(width))
            .zip(trust.chunks_mut(width));
        for (v, ((phase, modulation), trust)) in rows.enumerate() {
            let columns = match &self.window {
                Some(window) => window[v].clone(),
                None => 0..width,
            };
            let row = PhaseRow {
                phase,
                modulation,
                trust,
            };
            let map = set.map.as_deref();
            let map = map.map_or(&[][..], |map| &map[v * width..(v + 1) * width]);
            self.decoder.row(arrived, &last, v, map, columns, row);
        }
        Ok(())
    }
}

impl Kernel for Decoding {
    /// Takes the levels that were used least recently; the first time, makes those of all sets.
    fn run(&mut self, set: &mut FrameSet) -> Duration {
        if self.levels.is_empty() {
            self.levels = (0..self.copies).map(|_| self.arrived(set)).collect();
        } else {
            self.levels.rotate_left(1);
        }
        timed(|| {
            // The frames are those that the decoder was made for.
            let _ = self.decode(set);
        })
    }
}

/// Production from frames to the readings of gauges, on all threads of the current pool.
pub struct Inspecting<'a> {
    production: &'a Production,
    arrived: Arrived,
    strips: Strips,
}

impl<'a> Inspecting<'a> {
    /// Production with strips as high as those of a plan.
    pub fn new(production: &'a Production) -> Self {
        let rows = production.window().len();
        let width = production.cubics().surface().width;
        Self {
            arrived: production.decoder().arrived(width, rows),
            strips: production.strips(rows.div_ceil(STRIPS)),
            production,
        }
    }

    fn inspect(&mut self, set: &FrameSet) -> Result<(), DecodeError> {
        let frames = views(&set.frames);
        self.arrived.restart();
        let last = arrive_rest(self.production.decoder(), &frames, &mut self.arrived)?;
        let input = Input::Finest(&self.arrived, &last);
        let placed = self.production.place(input, &mut self.strips)?;
        let input = (input, Signal::Frames(&frames));
        let maps = Maps::default();
        let found = self
            .production
            .inspect_placed(input, &mut self.strips, placed, maps)?;
        black_box(found);
        Ok(())
    }
}

impl Kernel for Inspecting<'_> {
    fn run(&mut self, set: &mut FrameSet) -> Duration {
        timed(|| {
            // The frames are those that production was made for.
            let _ = self.inspect(set);
        })
    }
}
