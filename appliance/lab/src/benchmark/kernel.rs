//! The kernel table: what a pixel costs every decoder on every workload, in ns and in multiples of
//! the floor.

use super::decoding::{Decoding, decoders};
use super::timing::{Effort, Floor, FrameSets, Kernel, Round, interleaved, median};
use super::workload::{RANGE, Workload};
use crate::Failed;
use algo::pattern::Sequence;
use algo::phase::{Decoder, LeastModulation};
use serde::{Serialize, Serializer};

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

/// An implementation by its name.
type Named = (String, Box<dyn Kernel>);

/// The decoders of a workload, by implementation and workload: `avx2_geometric_12`, and where a
/// quiet head is timed as well the fastest with its least modulation, `avx2_geometric_12_quiet`.
/// Where the clock starts after the coarser levels were decoded, these are kept for `copies` frame
/// sets in turn.
fn variants(workload: &Workload, copies: usize) -> Result<Vec<Named>, Failed> {
    let sequence = Sequence::from_frames(&workload.frames)?;
    let mut named: Vec<(&str, Decoder, &str)> = Vec::new();
    for (name, decoder) in decoders(&sequence, RANGE, workload.bit_depth)? {
        named.push((name, decoder, ""));
    }
    if workload.has_quiet {
        let decoder = Decoder::new(&sequence, RANGE, workload.bit_depth)?;
        let least =
            LeastModulation::new(QUIET_COUNTS).ok_or("no least modulation of a quiet head")?;
        let decoder = decoder.with_least_modulation(least);
        named.push((decoder.backend().name(), decoder, "_quiet"));
    }
    let mut variants: Vec<Named> = Vec::new();
    for (name, decoder, suffix) in named {
        let of = &workload.name;
        if workload.has_last {
            let last = Decoding::after_the_last(decoder.clone(), copies);
            variants.push((
                format!("{name}_last_frames_of_{of}{suffix}"),
                Box::new(last),
            ));
        }
        let whole = Decoding::new(decoder, None);
        variants.push((format!("{name}_{of}{suffix}"), Box::new(whole)));
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
