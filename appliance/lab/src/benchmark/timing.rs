//! Times kernels in turn, on frames that are in no cache, and as multiples of a floor.
//!
//! The floor is a loop that only reads twelve frames of 8 bits and writes one map of 32 bits. A
//! decoder of twelve frames reads and writes at least this, so none can be faster, and multiples of
//! it compare machines. It is limited by memory: each block of pixels is the exclusive or of twelve
//! streams, and four copies of that, each combined with another constant, are the bytes of the
//! block's 32-bit values.

use crate::Failed;
use algo::frame::FrameView;
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use algo::units::{AbsolutePhase, Modulation};
use appliance::head::seam::view;
use appliance::system::computing::timed;
use hal::frame::{Frame, Pixels, Samples};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Columns and rows of the frames.
    pub size: (usize, usize),
    /// Bytes that are read before the first frame set comes again: more than caches hold.
    pub bytes: usize,
    /// Rounds; figures are medians over them.
    pub rounds: usize,
    /// A time is measured over all copies of a frame set, or over fewer if these take this long
    /// already.
    pub patience: Duration,
}

impl Effort {
    /// For figures that are quoted.
    pub const FULL: Self = Self {
        size: (1456, 1088),
        bytes: 210_000_000,
        rounds: 9,
        patience: Duration::from_millis(60),
    };
    /// For checking that everything works; the times mean nothing.
    pub const QUICK: Self = Self {
        size: (64, 48),
        bytes: 1,
        rounds: 1,
        patience: Duration::ZERO,
    };
}

/// The frames of one sequence, each in an allocation of its own as a camera's driver maps them, the
/// phase map that they are unwrapped about if the sequence needs one, and memory for the result.
pub struct FrameSet {
    pub frames: Vec<Frame>,
    pub map: Option<Vec<AbsolutePhase>>,
    /// The result of a kernel.
    pub out: PhaseMap,
}

impl FrameSet {
    /// Frames of equal format.
    pub fn new(frames: Vec<Frame>, map: Option<Vec<AbsolutePhase>>) -> Self {
        let format = frames.first().map(Frame::format);
        let size = format.map_or((0, 0), |format| (format.width, format.height));
        let mut out = PhaseMap::new(size.0 as usize, size.1 as usize);
        // Written, so that the system maps the memory before the first run.
        out.modulation.fill(Modulation::from_bits(1));
        out.trust.fill(Trust::Dark);
        Self { frames, map, out }
    }

    /// Number of pixels of a frame.
    pub fn pixels(&self) -> usize {
        self.out.phase.len()
    }

    /// Φ in turns of the result, NaN where it is rejected.
    pub fn turns(&self) -> Vec<f64> {
        let turns = |phase: &AbsolutePhase| match phase.is_known() {
            true => phase.turns(),
            false => f64::NAN,
        };
        self.out.phase.iter().map(turns).collect()
    }

    /// A set with the same samples in other memory.
    fn copy(&self) -> Self {
        let copy = |frame: &Frame| {
            let pixels = match frame.samples() {
                Samples::Eight(samples) => Pixels::Eight(samples.to_vec()),
                Samples::Sixteen(samples) => Pixels::Sixteen(samples.to_vec()),
            };
            // The format fits: it is that of these samples.
            Frame::new(frame.format(), Arc::new(pixels), frame.timestamp(), 0).ok()
        };
        Self::new(
            self.frames.iter().filter_map(copy).collect(),
            self.map.clone(),
        )
    }

    /// Bytes that a kernel reads.
    fn bytes(&self) -> usize {
        let bytes = |frame: &Frame| match frame.samples() {
            Samples::Eight(samples) => samples.len(),
            Samples::Sixteen(samples) => 2 * samples.len(),
        };
        let map = self.map.as_ref().map_or(0, Vec::len);
        self.frames.iter().map(bytes).sum::<usize>() + size_of::<AbsolutePhase>() * map
    }
}

/// The frames of a set as `algo` takes them.
pub fn views(frames: &[Frame]) -> Vec<FrameView<'_>> {
    // The samples of a frame make up its format.
    frames.iter().filter_map(|frame| view(frame).ok()).collect()
}

/// Copies of one set, used in turn: with [`Effort::FULL`] more than fit into any cache.
pub struct FrameSets {
    sets: Vec<FrameSet>,
    next: usize,
}

impl FrameSets {
    /// As many copies as a kernel must decode to read at least `bytes` bytes of frames and maps; at
    /// least one.
    pub fn of(set: FrameSet, bytes: usize) -> Self {
        let copies = bytes.div_ceil(set.bytes().max(1)).max(1);
        let copied: Vec<_> = (1..copies).map(|_| set.copy()).collect();
        Self {
            sets: [set].into_iter().chain(copied).collect(),
            next: 0,
        }
    }

    /// Number of copies.
    pub fn copies(&self) -> usize {
        self.sets.len()
    }

    /// The set that was used least recently.
    pub fn next(&mut self) -> &mut FrameSet {
        self.next = (self.next + 1) % self.sets.len();
        &mut self.sets[self.next]
    }
}

/// What is timed on sets of frames.
pub trait Kernel: Send {
    /// Processes a set; returns the processor time of the part that is of interest.
    fn run(&mut self, set: &mut FrameSet) -> Duration;
}

/// Frames that the floor reads.
const FLOOR_FRAMES: usize = 12;
/// Pixels of a block: one line of a cache.
const BLOCK: usize = 64;

/// The memory that the floor reads and writes.
pub struct Floor {
    sets: Vec<(Vec<u8>, Vec<[u8; 4]>)>,
    pixels: usize,
}

impl Floor {
    /// As many copies as the effort asks for.
    pub fn new(effort: &Effort) -> Self {
        let pixels = effort.size.0 * effort.size.1;
        let bytes = FLOOR_FRAMES * pixels;
        let frames: Vec<u8> = (0..bytes).map(|at| (at * 7 + at / 251) as u8 | 1).collect();
        let copies = effort.bytes.div_ceil(bytes).max(1);
        Self {
            sets: vec![(frames, vec![[1; 4]; pixels]); copies],
            pixels,
        }
    }

    /// Processor time over all copies, ns per pixel.
    fn time(&mut self) -> f64 {
        let pixels = self.pixels;
        let taken = timed(|| {
            for (frames, map) in &mut self.sets {
                let mut frames = frames.chunks(pixels);
                let frames = [(); FLOOR_FRAMES].map(|()| frames.next().unwrap_or_default());
                read_and_write(&frames, map);
                black_box(map);
            }
        });
        taken.as_secs_f64() * 1e9 / (self.sets.len() * pixels).max(1) as f64
    }
}

/// The loop of the floor: reads `frames` (of equal length) and writes `map`, a value for each pixel.
/// Pixels after the last whole block are left out.
fn read_and_write(frames: &[&[u8]; FLOOR_FRAMES], map: &mut [[u8; 4]]) {
    let mut blocks = frames.map(|frame| frame.as_chunks::<BLOCK>().0.iter());
    let (out, _) = map.as_chunks_mut::<BLOCK>();
    for out in out {
        let mut mixed = [0_u8; BLOCK];
        for stream in &mut blocks {
            let Some(block) = stream.next() else { return };
            for (mixed, sample) in mixed.iter_mut().zip(block) {
                *mixed ^= sample;
            }
        }
        let out = out.as_flattened_mut();
        for (quarter, constant) in out.chunks_exact_mut(BLOCK).zip([0, 0x55, 0xAA, 0xFF]) {
            for (out, mixed) in quarter.iter_mut().zip(&mixed) {
                *out = mixed ^ constant;
            }
        }
    }
}

/// Processor time of a pixel in one round, ns.
pub struct Round {
    pub kernel: f64,
    pub floor: f64,
}

impl Round {
    /// The kernel's time in floors.
    pub fn x_floor(&self) -> f64 {
        self.kernel / self.floor
    }
}

/// One thread, on which kernels are timed.
///
/// # Errors
/// If the system has no more threads.
pub fn alone() -> Result<ThreadPool, Failed> {
    Ok(ThreadPoolBuilder::new().num_threads(1).build()?)
}

/// The rounds of each kernel, on one thread. In every round the floor is timed first and then each
/// kernel in turn, so that other work on the machine affects all of them alike.
///
/// # Errors
/// As [`alone`].
pub fn interleaved<K: Kernel>(
    kernels: &mut [K],
    sets: &mut FrameSets,
    floor: &mut Floor,
    effort: &Effort,
) -> Result<Vec<Vec<Round>>, Failed> {
    Ok(alone()?.install(|| {
        let mut rounds: Vec<Vec<Round>> = kernels.iter().map(|_| Vec::new()).collect();
        floor.time();
        for _ in 0..effort.rounds {
            let floor = floor.time();
            for (kernel, rounds) in kernels.iter_mut().zip(&mut rounds) {
                let kernel = ns_per_px(kernel, sets, effort.patience);
                rounds.push(Round { kernel, floor });
            }
        }
        rounds
    }))
}

/// Processor time of a kernel per pixel, ns, over all copies of a set, or over fewer once these have
/// taken `patience`.
pub fn ns_per_px(kernel: &mut dyn Kernel, sets: &mut FrameSets, patience: Duration) -> f64 {
    let (mut taken, mut pixels) = (Duration::ZERO, 0);
    for _ in 0..sets.copies() {
        let set = sets.next();
        taken += kernel.run(set);
        pixels += set.pixels();
        black_box(&set.out);
        if taken >= patience {
            break;
        }
    }
    taken.as_secs_f64() * 1e9 / pixels.max(1) as f64
}

/// The median, which a single disturbed measurement does not change; for an even number of values
/// the upper of the two middle ones, for no values NaN.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert!(median(Vec::new()).is_nan());
    }

    #[test]
    fn every_sample_reaches_the_map_of_the_floor() {
        let mut samples = [[0_u8; 2 * BLOCK]; FLOOR_FRAMES];
        let map_of = |samples: &[[u8; 2 * BLOCK]; FLOOR_FRAMES]| {
            let mut map = [[1; 4]; 2 * BLOCK];
            read_and_write(&samples.each_ref().map(|frame| &frame[..]), &mut map);
            map
        };
        let before = map_of(&samples);
        for frame in 0..FLOOR_FRAMES {
            for pixel in [0, 63, 64, 127] {
                samples[frame][pixel] = 7;
                assert_ne!(map_of(&samples), before, "{frame} {pixel}");
                samples[frame][pixel] = 0;
            }
        }
    }
}
