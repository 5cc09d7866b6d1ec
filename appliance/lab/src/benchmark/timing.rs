//! Times kernels in turn: cold over more frame sets than caches hold, hot over the same few rows.

use super::counter::Counter;
use super::effort::Effort;
use super::floor::FloorSets;
use super::frames::{FrameSet, Rotation};
use super::words;
use appliance::system::computing::timed;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::hint::black_box;
use std::time::Duration;

/// An implementation that computes the phases of a set of frames.
pub trait Kernel: Send {
    /// What precedes the timed part for this set: nothing, or the levels that are decoded on
    /// arrival.
    fn prepare(&mut self, _: &mut FrameSet) {}
    /// Decodes a set; this is timed.
    fn run(&mut self, set: &mut FrameSet);
    /// Φ in turns that the last run found in `set`, NaN where rejected.
    fn turns(&self, set: &FrameSet) -> Vec<f64>;
}

/// Hot rows are decoded until this share of a frame's pixels has been decoded.
const HOT_SHARE: usize = 4;

/// A kernel and what it is timed on.
pub struct Contender {
    /// The kernel.
    pub kernel: Box<dyn Kernel>,
    /// The rotation that it takes its frames from.
    pub rotation: usize,
    /// The kernel on frames of the sizes of [`Effort::hot_sizes`].
    pub hot: Option<[(Box<dyn Kernel>, FrameSet); 2]>,
}

impl Contender {
    /// A kernel that is timed on the first rotation only.
    pub fn cold(kernel: Box<dyn Kernel>) -> Self {
        Self {
            kernel,
            rotation: 0,
            hot: None,
        }
    }
}

/// What a pixel costs.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Processor time.
    pub ns: f64,
    /// Instructions, where the processor's counters can be read.
    pub instructions: Option<f64>,
}

/// What one round measured, per pixel.
pub struct Round {
    /// The kernel on frames that are in no cache.
    pub cold: Cost,
    /// The kernel on wide and narrow frames that are in the cache, ns.
    pub hot: Option<[f64; 2]>,
    /// The floor, ns.
    pub floor: f64,
}

impl Round {
    /// The kernel's time in floors.
    pub fn x_floor(&self) -> f64 {
        self.cold.ns / self.floor
    }
}

/// One thread, on which kernels are timed.
///
/// # Errors
/// If the system has no more threads.
pub fn alone() -> Result<ThreadPool, String> {
    let builder = ThreadPoolBuilder::new().num_threads(1);
    builder.build().map_err(words)
}

/// The rounds of each kernel, on one thread. In every round the floor is timed first and then each
/// kernel in turn, so that other work on the machine affects all of them alike.
///
/// # Errors
/// As [`alone`].
pub fn interleaved(
    contenders: &mut [Contender],
    rotations: &mut [Rotation],
    base: &mut FloorSets,
    effort: &Effort,
) -> Result<Vec<Vec<Round>>, String> {
    Ok(alone()?.install(|| in_turn(contenders, rotations, base, effort)))
}

fn in_turn(
    contenders: &mut [Contender],
    rotations: &mut [Rotation],
    base: &mut FloorSets,
    effort: &Effort,
) -> Vec<Vec<Round>> {
    let mut rounds: Vec<Vec<Round>> = contenders.iter().map(|_| Vec::new()).collect();
    base.time();
    for _ in 0..effort.rounds {
        let floor = base.time();
        for (contender, rounds) in contenders.iter_mut().zip(&mut rounds) {
            let Contender {
                kernel,
                rotation,
                hot,
            } = contender;
            let cold = rotate(&mut **kernel, &mut rotations[*rotation], effort.patience);
            let pixels = effort.size.0 * effort.size.1 / HOT_SHARE;
            let again =
                |(kernel, set): &mut (Box<dyn Kernel>, _)| again(&mut **kernel, set, pixels);
            let hot = hot.as_mut().map(|sizes| sizes.each_mut().map(again));
            rounds.push(Round { cold, hot, floor });
        }
    }
    rounds
}

/// The cost of `kernel` over at most one rotation of `sets`.
pub fn rotate(kernel: &mut dyn Kernel, sets: &mut Rotation, patience: Duration) -> Cost {
    let counter = Counter::instructions();
    let read = || counter.as_ref().and_then(Counter::read);
    let (mut taken, mut pixels, mut counted) = (Duration::ZERO, 0, Some(0));
    for _ in 0..sets.copies() {
        let set = sets.next();
        kernel.prepare(set);
        let before = read();
        taken += timed(|| kernel.run(set));
        let added = read().zip(before).map(|(after, before)| after - before);
        counted = counted.zip(added).map(|(sum, added)| sum + added);
        pixels += set.pixels();
        black_box(&set.out);
        if taken >= patience {
            break;
        }
    }
    let pixels = pixels.max(1) as f64;
    Cost {
        ns: taken.as_secs_f64() * 1e9 / pixels,
        instructions: counted.map(|counted| counted as f64 / pixels),
    }
}

/// Processor time in ns per pixel of decoding one small set until `pixels` pixels are decoded.
fn again(kernel: &mut dyn Kernel, set: &mut FrameSet, pixels: usize) -> f64 {
    let times = pixels.div_ceil(set.pixels().max(1)).max(1);
    kernel.prepare(set);
    // Fetches everything into the cache.
    kernel.run(set);
    let taken = timed(|| {
        for _ in 0..times {
            kernel.run(set);
            black_box(&set.out);
        }
    });
    taken.as_secs_f64() * 1e9 / (times * set.pixels()).max(1) as f64
}
