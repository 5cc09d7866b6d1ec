//! Kernels of the product: its decoder, and all of production from frames to readings.

use super::frames::FrameSet;
use super::kernel::Kernel;
use algo::inspect::{Production, Strips};
use algo::phase::{Arrived, Decoder, PhaseRow};
use algo::pipeline::{PhaseMap, arrive};
use appliance::production::stopwatch::timed;
use appliance::recipe::plan::STRIPS;
use std::hint::black_box;
use std::ops::Range;
use std::time::Duration;

/// A decoder on one thread that writes into memory allocated before.
pub struct Decoding {
    decoder: Decoder,
    /// The columns of each row that are decoded; `None` for all.
    window: Option<Vec<Range<usize>>>,
    /// Whether the coarser levels are demodulated before the clock starts, as they are when each is decoded while the next
    /// is being exposed.
    on_arrival: bool,
}

impl Decoding {
    /// With a decoder; rows without a column in `window` are left out.
    pub fn new(decoder: Decoder, window: Option<Vec<Range<usize>>>) -> Self {
        Self {
            decoder,
            window,
            on_arrival: false,
        }
    }

    /// With a decoder that times the last level only: the others are demodulated before.
    pub fn after_the_last(decoder: Decoder) -> Self {
        Self {
            decoder,
            window: None,
            on_arrival: true,
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
    /// With strips as high as those of a plan.
    pub fn new(production: &'a Production) -> Self {
        let rows = production.window().len();
        Self {
            strips: production.strips(rows.div_ceil(STRIPS)),
            production,
        }
    }
}

impl Kernel for Inspecting<'_> {
    fn run(&mut self, set: &mut FrameSet) -> Duration {
        let (frames, _, _) = set.parts();
        let (production, strips) = (self.production, &mut self.strips);
        // The frames are those that it was made for.
        timed(|| drop(black_box(production.inspect(&frames, strips, None))))
    }

    /// Empty: production keeps no phase map.
    fn turns(&self, _: &FrameSet) -> Vec<f64> {
        Vec::new()
    }
}

impl Kernel for Decoding {
    fn run(&mut self, set: &mut FrameSet) -> Duration {
        let width = set.width().max(1);
        let arrived = self.on_arrival.then(|| self.before(set));
        let last: Vec<usize> = self
            .decoder
            .levels()
            .last()
            .map_or(Vec::new(), <[_]>::to_vec);
        timed(|| {
            let (frames, map, out) = set.parts();
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
                match &arrived {
                    Some(arrived) => {
                        let last: Vec<_> = last.iter().map(|&at| frames[at]).collect();
                        self.decoder.last_row(arrived, &last, v, map, columns, row);
                    }
                    None => self.decoder.row(&frames, v, map, columns, row),
                }
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
