//! Kernels of the product: its decoder, and all of production from frames to readings.

use super::frames::FrameSet;
use super::timing::Kernel;
use algo::inspect::{Production, Strips};
use algo::phase::{Arrived, Decoder, PhaseRow};
use algo::pipeline::{PhaseMap, arrive};
use appliance::recipe::plan::STRIPS;
use std::collections::VecDeque;
use std::hint::black_box;
use std::ops::Range;

/// A decoder on one thread that writes into memory allocated before.
pub struct Decoding {
    decoder: Decoder,
    /// The columns of each row that are decoded; `None` for all.
    window: Option<Vec<Range<usize>>>,
    /// What is decoded on arrival, before the clock starts; `None` for nothing.
    on_arrival: Option<OnArrival>,
}

/// The coarser levels of frame sets that are decoded in turn. All sets of a rotation have the same
/// samples, but every set needs its own decoded levels: they were last used as long ago as the
/// frames, so that they come from no cache either.
struct OnArrival {
    /// How many sets' levels are kept.
    copies: usize,
    /// The levels of each set, with those of the current one in front.
    levels: VecDeque<Arrived>,
}

impl Decoding {
    /// Decoding by a decoder; rows without a column in `window` are left out.
    pub fn new(decoder: Decoder, window: Option<Vec<Range<usize>>>) -> Self {
        Self {
            decoder,
            window,
            on_arrival: None,
        }
    }

    /// Decoding by a decoder that is timed on the last level only, for `copies` frame sets with the
    /// same samples.
    pub fn after_the_last(decoder: Decoder, copies: usize) -> Self {
        Self {
            decoder,
            window: None,
            on_arrival: Some(OnArrival {
                copies,
                levels: VecDeque::new(),
            }),
        }
    }

    /// Demodulates all levels but the last.
    fn before(&self, set: &mut FrameSet) -> Arrived {
        let (width, height) = (set.width(), set.out.phase.len() / set.width().max(1));
        let (frames, _, _) = set.parts();
        let mut arrived = self.decoder.arrived(width, height);
        let coarser = self.decoder.levels().len().saturating_sub(1);
        for places in self.decoder.levels().take(coarser) {
            let frames: Vec<_> = places.iter().map(|&at| frames[at]).collect();
            // The frames are those that the decoder was made for.
            let _ = arrive(&self.decoder, &frames, &mut arrived);
        }
        arrived
    }
}

/// Production from frames to the readings of gauges, on all threads of the current pool.
pub struct Inspecting<'a> {
    production: &'a Production,
    strips: Strips,
}

impl<'a> Inspecting<'a> {
    /// Production with strips as high as those of a plan.
    pub fn new(production: &'a Production) -> Self {
        let rows = production.window().len();
        Self {
            strips: production.strips(rows.div_ceil(STRIPS)),
            production,
        }
    }
}

impl Kernel for Inspecting<'_> {
    fn run(&mut self, set: &mut FrameSet) {
        let (frames, _, _) = set.parts();
        // The frames are those that it was made for.
        let inspected = self.production.inspect(&frames, &mut self.strips, None);
        drop(black_box(inspected));
    }

    /// Empty: production keeps no phase map.
    fn turns(&self, _: &FrameSet) -> Vec<f64> {
        Vec::new()
    }
}

impl Kernel for Decoding {
    /// Takes the decoded levels that were used least recently; the first time, decodes those of all
    /// sets.
    fn prepare(&mut self, set: &mut FrameSet) {
        let Some(mut on_arrival) = self.on_arrival.take() else {
            return;
        };
        let OnArrival { copies, levels } = &mut on_arrival;
        if levels.is_empty() {
            levels.extend((0..*copies).map(|_| self.before(set)));
        } else {
            levels.rotate_left(1);
        }
        self.on_arrival = Some(on_arrival);
    }

    fn run(&mut self, set: &mut FrameSet) {
        let width = set.width().max(1);
        let (frames, map, out) = set.parts();
        let arrived = self.on_arrival.as_ref().and_then(|on| on.levels.front());
        let last: Vec<_> = match self.decoder.levels().last() {
            Some(places) => places.iter().map(|&at| frames[at]).collect(),
            None => Vec::new(),
        };
        let PhaseMap {
            phase,
            modulation,
            trust,
            ..
        } = out;
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
            let map = map.map_or(&[][..], |map| &map[v * width..(v + 1) * width]);
            match arrived {
                Some(arrived) => self.decoder.last_row(arrived, &last, v, map, columns, row),
                None => self.decoder.row(&frames, v, map, columns, row),
            }
        }
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
