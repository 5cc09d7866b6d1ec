//! The kernel table: processor time per pixel of every variant, in ns and in multiples of the floor.

use super::floor::{self, floor};
use super::frames::{FrameSet, Rotation};
use super::median::median;
use super::variants;
use super::workload::Workload;
use appliance::production::stopwatch::timed;
use serde::{Serialize, Serializer};
use std::hint::black_box;
use std::time::Duration;

/// An implementation that computes the phases of a set of frames.
pub trait Kernel {
    /// Decodes a set and returns the processor time of the timed part: of everything, or, where the coarser levels are decoded on
    /// arrival, only of what remains after the last frame.
    fn run(&mut self, set: &mut FrameSet) -> Duration;
    /// Φ in turns that the last run found in `set`, NaN where rejected.
    fn turns(&self, set: &FrameSet) -> Vec<f64>;
}

/// The size of the frames, and how often each kernel is timed.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Columns and rows of the frames.
    pub size: (usize, usize),
    /// Bytes that are read before the first frame set comes again: more than caches hold.
    pub bytes: usize,
    /// Rounds; figures are medians over them.
    pub rounds: usize,
    /// A time is measured over a whole rotation, or over fewer sets if these take this long already.
    pub patience: Duration,
}

impl Effort {
    /// For figures that are quoted.
    pub const FULL: Self = Self {
        size: (1456, 1088),
        bytes: 210_000_000,
        rounds: 5,
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

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Implementation and workload, `f32_geometric_12`.
    #[serde(skip)]
    pub name: String,
    /// Frames of a set.
    pub frames: usize,
    /// Processor time per pixel of one frame, median.
    pub ns_per_px: f64,
    /// Median of the ratios to the floor of the same round.
    pub x_floor: f64,
    /// The least and the most of these ratios.
    pub x_floor_range: [f64; 2],
    /// Share of the pixels with the right result: the phase within 0.05 turn, or rejected where it is dark.
    pub right: f64,
}

/// The whole table; in JSON each variant is a key.
#[derive(Clone, Debug, Serialize)]
pub struct KernelTable {
    /// Processor time of the floor per pixel, median over all rounds.
    pub floor_ns_per_px: f64,
    /// The least and the most of it.
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

/// Times every variant on every workload. Frames of one workload at a time are in memory, beside those of the floor.
///
/// # Errors
/// If a sequence cannot be decoded.
pub fn kernel_table(effort: &Effort, progress: &dyn Fn(f64, &str)) -> Result<KernelTable, String> {
    let workloads = Workload::all();
    let mut base = FloorSets::new(effort);
    let (mut floors, mut rows) = (Vec::new(), Vec::new());
    for (at, workload) in workloads.iter().enumerate() {
        progress(at as f64 / workloads.len() as f64, workload.name);
        let mut sets = Rotation::of(workload.render(effort.size), effort.bytes);
        let variants = variants::of(workload, effort.size)?;
        let (names, mut kernels): (Vec<_>, Vec<_>) = variants.into_iter().unzip();
        let right: Vec<f64> = kernels
            .iter_mut()
            .map(|kernel| share_right(&mut **kernel, workload, effort.size, sets.next()))
            .collect();
        let times = interleaved(&mut kernels, &mut sets, &mut base, effort);
        for ((name, right), times) in names.into_iter().zip(right).zip(&times) {
            let mut ratios: Vec<f64> = times.iter().map(|time| time.of / time.floor).collect();
            ratios.sort_by(f64::total_cmp);
            rows.push(Timing {
                name,
                frames: workload.frames.len(),
                ns_per_px: median(times.iter().map(|time| time.of).collect()),
                x_floor: median(ratios.clone()),
                x_floor_range: ends(&ratios),
                right,
            });
        }
        floors.extend(times.first().into_iter().flatten().map(|time| time.floor));
    }
    floors.sort_by(f64::total_cmp);
    Ok(KernelTable {
        floor_ns_per_px: median(floors.clone()),
        floor_range: ends(&floors),
        rows,
    })
}

fn ends(sorted: &[f64]) -> [f64; 2] {
    [sorted.first(), sorted.last()].map(|end| end.copied().unwrap_or(f64::NAN))
}

/// Times of one round, ns per pixel.
pub(super) struct Round {
    /// Of the kernel.
    pub of: f64,
    /// Of the floor.
    pub floor: f64,
}

/// The rounds of each kernel. In every round the floor is timed first and then each kernel in turn, so that other work
/// on the machine affects all of them alike.
pub(super) fn interleaved(
    kernels: &mut [Box<dyn Kernel>],
    sets: &mut Rotation,
    base: &mut FloorSets,
    effort: &Effort,
) -> Vec<Vec<Round>> {
    let mut rounds: Vec<Vec<Round>> = kernels.iter().map(|_| Vec::new()).collect();
    base.time();
    for _ in 0..effort.rounds {
        let floor = base.time();
        for (kernel, rounds) in kernels.iter_mut().zip(&mut rounds) {
            let of = rotate(&mut **kernel, sets, effort.patience);
            rounds.push(Round { of, floor });
        }
    }
    rounds
}

/// Processor time of `kernel` in ns per pixel, over at most one rotation of `sets`.
pub fn rotate(kernel: &mut dyn Kernel, sets: &mut Rotation, patience: Duration) -> f64 {
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

/// Share of the pixels that a kernel gets right.
fn share_right(
    kernel: &mut dyn Kernel,
    workload: &Workload,
    size: (usize, usize),
    set: &mut FrameSet,
) -> f64 {
    kernel.run(set);
    let found = kernel.turns(set);
    let right = found.iter().enumerate().filter(|&(at, found)| {
        let phase = workload.phase(at, size);
        (phase.is_nan() && found.is_nan()) || (found - phase).abs() <= RIGHT
    });
    right.count() as f64 / found.len().max(1) as f64
}

/// The memory that the floor reads and writes.
pub(super) struct FloorSets {
    sets: Vec<(Vec<u8>, Vec<[u8; 4]>)>,
    pixels: usize,
}

impl FloorSets {
    pub(super) fn new(effort: &Effort) -> Self {
        let pixels = effort.size.0 * effort.size.1;
        let bytes = floor::FRAMES * pixels;
        let frames: Vec<u8> = (0..bytes).map(|at| (at * 7 + at / 251) as u8 | 1).collect();
        let copies = effort.bytes.div_ceil(bytes).max(1);
        Self {
            sets: vec![(frames, vec![[1; 4]; pixels]); copies],
            pixels,
        }
    }

    /// Processor time of one rotation, ns per pixel.
    fn time(&mut self) -> f64 {
        let pixels = self.pixels;
        let taken = timed(|| {
            for (frames, map) in &mut self.sets {
                let mut frames = frames.chunks(pixels);
                let frames = [(); floor::FRAMES].map(|()| frames.next().unwrap_or_default());
                floor(&frames, map);
                black_box(map);
            }
        });
        taken.as_secs_f64() * 1e9 / (self.sets.len() * pixels).max(1) as f64
    }
}
