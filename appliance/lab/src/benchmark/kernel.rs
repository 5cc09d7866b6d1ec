//! The kernels that are timed: the decoder, and all of production from frames to readings; and the
//! kernel table: what a pixel costs every decoder on every workload, in ns and in multiples of the
//! floor.

use super::timing::{
    Effort, Floor, FrameSet, FrameSets, Kernel, Round, interleaved, median, views,
};
use super::workload::{RANGE, Workload};
use crate::Failed;
use algo::inspect::{Input, Maps, Production, Signal, Strips};
use algo::pattern::{PhaseRange, Sequence};
use algo::phase::{Arrived, DecodeError, Decoder, LeastModulation, PhaseRow};
use algo::pipeline::{PhaseMap, arrive_rest};
use algo::simd::Backend;
use appliance::recipe::plan::STRIPS;
use appliance::system::computing::timed;
use serde::{Serialize, Serializer};
use std::collections::VecDeque;
use std::hint::black_box;
use std::ops::Range;
use std::time::Duration;

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
        let input = (input, Signal::Frames(&frames, 0.0));
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

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Implementation and workload, `avx2_geometric_12`.
    #[serde(skip)]
    pub name: String,
    /// Frames of a set.
    pub frames: usize,
    /// Processor time per pixel of one frame, median.
    pub ns_per_px: f64,
    /// Processor time per pixel of one frame, least.
    pub least_ns_per_px: f64,
    /// Median of the ratios to the floor of the same round.
    pub x_floor: f64,
    /// The least and the most of these ratios.
    pub x_floor_range: [f64; 2],
    /// Share of the pixels with the right result: the phase within 0.05 turn, or rejected where it
    /// is dark.
    pub right: f64,
}

/// The whole table; in JSON each variant is a key.
#[derive(Clone, Debug, Serialize)]
pub struct KernelTable {
    /// Processor time of the floor per pixel, median over all rounds.
    pub floor_ns_per_px: f64,
    /// Least and most processor time of the floor per pixel.
    pub floor_range: [f64; 2],
    /// A row for each variant.
    #[serde(flatten, serialize_with = "by_name")]
    pub rows: Vec<Timing>,
}

fn by_name<S: Serializer>(rows: &[Timing], out: S) -> Result<S::Ok, S::Error> {
    out.collect_map(rows.iter().map(|row| (&row.name, row)))
}

/// A phase is right within this many turns: seven σ of the noise that the frames have.
const RIGHT: f64 = 0.05;
/// The least modulation that a quiet head trusts, counts of 8 bits: 4.3 σ of a noise of 1.2 counts.
const QUIET_COUNTS: f64 = 5.0;

/// Times every variant on every workload. Frames of one workload at a time are in memory, beside
/// those of the floor.
///
/// # Errors
/// If a sequence cannot be decoded.
pub fn kernel_table(effort: &Effort, progress: &dyn Fn(f64, &str)) -> Result<KernelTable, Failed> {
    let workloads = Workload::all();
    let mut floor = Floor::new(effort);
    let (mut floors, mut rows) = (Vec::new(), Vec::new());
    for (done, workload) in workloads.iter().enumerate() {
        progress(done as f64 / workloads.len() as f64, &workload.name);
        let mut sets = FrameSets::of(workload.render(effort.size)?, effort.bytes);
        let variants = variants(workload, sets.copies())?;
        let (names, mut kernels): (Vec<_>, Vec<_>) = variants.into_iter().unzip();
        let rounds = interleaved(&mut kernels, &mut sets, &mut floor, effort)?;
        floors.extend(rounds.iter().take(1).flatten().map(|round| round.floor));
        for ((name, kernel), rounds) in names.into_iter().zip(&mut kernels).zip(&rounds) {
            let set = sets.next();
            kernel.run(set);
            let right = share_right(&set.turns(), workload, effort.size);
            rows.push(row(name, workload, right, rounds));
        }
    }
    Ok(KernelTable {
        floor_range: ends(&floors),
        floor_ns_per_px: median(floors),
        rows,
    })
}

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

/// The decoders of a workload, by implementation and workload: `avx2_geometric_12`, and where a
/// quiet head is timed as well the fastest with its least modulation, `avx2_geometric_12_quiet`.
/// Where the clock starts after the coarser levels were decoded, these are kept for `copies` frame
/// sets in turn.
fn variants(workload: &Workload, copies: usize) -> Result<Vec<(String, Decoding)>, Failed> {
    let sequence = Sequence::from_frames(&workload.frames)?;
    let mut decoders: Vec<_> = decoders(&sequence, RANGE, workload.bit_depth)?
        .into_iter()
        .map(|(name, decoder)| (name, decoder, ""))
        .collect();
    if workload.has_quiet {
        let decoder = Decoder::new(&sequence, RANGE, workload.bit_depth)?;
        let least =
            LeastModulation::new(QUIET_COUNTS).ok_or("no least modulation of a quiet head")?;
        let decoder = decoder.with_least_modulation(least);
        decoders.push((decoder.backend().name(), decoder, "_quiet"));
    }
    let mut variants = Vec::new();
    for (name, decoder, suffix) in decoders {
        let sequence = format!("{}{suffix}", workload.name);
        if workload.has_last {
            let last = Decoding::after_the_last(decoder.clone(), copies);
            variants.push((format!("{name}_last_frames_of_{sequence}"), last));
        }
        variants.push((format!("{name}_{sequence}"), Decoding::new(decoder, None)));
    }
    Ok(variants)
}

/// The medians of the rounds of a variant.
fn row(name: String, workload: &Workload, right: f64, rounds: &[Round]) -> Timing {
    let times: Vec<f64> = rounds.iter().map(|round| round.kernel).collect();
    let ratios: Vec<f64> = rounds.iter().map(Round::x_floor).collect();
    Timing {
        name,
        frames: workload.frames.len(),
        least_ns_per_px: ends(&times)[0],
        ns_per_px: median(times),
        x_floor_range: ends(&ratios),
        x_floor: median(ratios),
        right,
    }
}

/// The least and the most; NaN of none.
fn ends(values: &[f64]) -> [f64; 2] {
    let values = values.iter().copied();
    [
        values.clone().fold(f64::NAN, f64::min),
        values.fold(f64::NAN, f64::max),
    ]
}

/// Share of the pixels whose phase in turns is right.
fn share_right(found: &[f64], workload: &Workload, size: (usize, usize)) -> f64 {
    let right = found.iter().enumerate().filter(|&(pixel, found)| {
        let phase = workload.phase(pixel, size);
        (phase.is_nan() && found.is_nan()) || (found - phase).abs() <= RIGHT
    });
    right.count() as f64 / found.len().max(1) as f64
}
