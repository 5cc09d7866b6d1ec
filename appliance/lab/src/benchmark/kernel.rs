//! The kernel table: what a pixel costs in every variant, in ns, in instructions and in multiples
//! of the floor.

use super::effort::Effort;
use super::floor::FloorSets;
use super::frames::{FrameSet, Rotation};
use super::median::median;
use super::timing::{Contender, Kernel, Round, interleaved};
use super::variants;
use super::workload::Workload;
use appliance::system::computing::give_back;
use serde::{Serialize, Serializer};

/// One row of the table. Figures that a variant does not have, or that the machine does not offer,
/// are left out of the JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Implementation and workload, `f32_geometric_12`.
    #[serde(skip)]
    pub name: String,
    /// Frames of a set.
    pub frames: usize,
    /// Processor time per pixel of one frame, median.
    pub ns_per_px: f64,
    /// Processor time per pixel of one frame, least.
    pub least_ns_per_px: f64,
    /// Processor time per pixel for 8 rows that are in the cache, median.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hot_ns_per_px: Option<f64>,
    /// What a row costs beside its pixels, ns, median: from hot frames of two widths and equal
    /// pixels, none of which is dark.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ns_per_row: Option<f64>,
    /// Instructions per pixel of one frame, median.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instructions_per_px: Option<f64>,
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

/// Makes variants of a workload for so many frame sets.
type Variants = fn(&Workload, usize) -> Result<Vec<variants::Named<String>>, String>;

/// A phase is right within this many turns: seven σ of the noise that the frames have.
const RIGHT: f64 = 0.05;
/// A kernel is bound by memory if frames that are in no cache take it at least this many times as
/// long as those that are.
const BOUND_BY_MEMORY: f64 = 1.15;

impl Timing {
    /// Whether memory limits the variant, so that the floor says how much faster it could become.
    pub fn bound_by_memory(&self) -> bool {
        self.hot_ns_per_px
            .is_some_and(|hot| self.ns_per_px >= BOUND_BY_MEMORY * hot)
    }
}

/// Times every variant on every workload. Frames of one workload at a time are in memory, beside
/// those of the floor.
///
/// # Errors
/// If a sequence cannot be decoded.
pub fn kernel_table(effort: &Effort, progress: &dyn Fn(f64, &str)) -> Result<KernelTable, String> {
    // So that the frames of the aligned sets lie in mappings of their own.
    give_back();
    let workloads = Workload::all();
    let mut base = FloorSets::new(effort);
    let (mut floors, mut rows) = (Vec::new(), Vec::new());
    for (at, workload) in workloads.iter().enumerate() {
        progress(at as f64 / workloads.len() as f64, &workload.name);
        let packed = workload.render(effort.size);
        let aligned = workload.has_aligned.then(|| packed.aligned());
        let sets = [packed].into_iter().chain(aligned);
        let mut rotations: Vec<_> = sets.map(|set| Rotation::of(set, effort.bytes)).collect();
        let (names, mut contenders) = contenders(workload, effort, &rotations)?;
        let rounds = interleaved(&mut contenders, &mut rotations, &mut base, effort)?;
        floors.extend(
            rounds
                .first()
                .into_iter()
                .flatten()
                .map(|round| round.floor),
        );
        for ((name, contender), rounds) in names.into_iter().zip(&mut contenders).zip(&rounds) {
            let set = rotations[contender.rotation].next();
            let right = share_right(&mut *contender.kernel, workload, effort.size, set);
            rows.push(row(name, workload, right, rounds, effort));
        }
    }
    floors.sort_by(f64::total_cmp);
    Ok(KernelTable {
        floor_ns_per_px: median(floors.clone()),
        floor_range: ends(&floors),
        rows,
    })
}

/// Every variant of a workload: the decoders on each rotation, the first of which is packed and the
/// second aligned; the decoder of a quiet head and the references on the first.
fn contenders(
    workload: &Workload,
    effort: &Effort,
    rotations: &[Rotation],
) -> Result<(Vec<String>, Vec<Contender>), String> {
    let mut kinds: Vec<(usize, &str, Variants)> = vec![(0, "", variants::decoding)];
    if workload.has_quiet {
        kinds.push((0, "", variants::quiet));
    }
    if rotations.len() > 1 {
        kinds.push((1, "_aligned", variants::decoding));
    }
    let mut all = Vec::new();
    for (rotation, suffix, variants) in kinds {
        let hot = |size| {
            let set = workload.render(size);
            let set = if rotation > 0 { set.aligned() } else { set };
            let kernels = variants(workload, 1)?.into_iter();
            Ok::<_, String>(kernels.map(move |(_, kernel)| (kernel, set.clone())))
        };
        let [wide, narrow] = effort.hot_sizes().map(hot);
        let cold = variants(workload, rotations[rotation].copies())?.into_iter();
        for (((name, kernel), wide), narrow) in cold.zip(wide?).zip(narrow?) {
            let contender = Contender {
                kernel,
                rotation,
                hot: Some([wide, narrow]),
            };
            all.push((name + suffix, contender));
        }
    }
    let textbooks = variants::textbooks(workload, effort.size)?.into_iter();
    all.extend(textbooks.map(|(name, kernel)| (name, Contender::cold(kernel))));
    Ok(all.into_iter().unzip())
}

/// The medians of the rounds of a variant.
fn row(name: String, workload: &Workload, right: f64, rounds: &[Round], effort: &Effort) -> Timing {
    let sorted = |of: &dyn Fn(&Round) -> f64| {
        let mut all: Vec<f64> = rounds.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let where_had = |of: &dyn Fn(&Round) -> Option<f64>| {
        let all: Option<Vec<f64>> = rounds.iter().map(of).collect();
        all.map(median)
    };
    let cold = sorted(&|round| round.cold.ns);
    let ratios = sorted(&Round::x_floor);
    // Rows per pixel of the narrow frames and of the wide ones.
    let [wide, narrow] = effort.hot_sizes().map(|(width, _)| 1.0 / width as f64);
    let of_a_row = |[of_wide, of_narrow]: [f64; 2]| (of_narrow - of_wide) / (narrow - wide);
    // Where the part ends, a narrow row is not what a wide one is: other blocks of pixels are
    // skipped.
    let all_lit = workload.lit == 1.0;
    Timing {
        name,
        frames: workload.frames.len(),
        least_ns_per_px: ends(&cold)[0],
        ns_per_px: median(cold),
        hot_ns_per_px: where_had(&|round| round.hot.map(|[wide, _]| wide)),
        ns_per_row: where_had(&|round| round.hot.filter(|_| all_lit).map(of_a_row)),
        instructions_per_px: where_had(&|round| round.cold.instructions),
        x_floor_range: ends(&ratios),
        x_floor: median(ratios),
        right,
    }
}

fn ends(sorted: &[f64]) -> [f64; 2] {
    [sorted.first(), sorted.last()].map(|end| end.copied().unwrap_or(f64::NAN))
}

/// Share of the pixels that a kernel gets right.
fn share_right(
    kernel: &mut dyn Kernel,
    workload: &Workload,
    size: (usize, usize),
    set: &mut FrameSet,
) -> f64 {
    kernel.prepare(set);
    kernel.run(set);
    let found = kernel.turns(set);
    let right = found.iter().enumerate().filter(|&(at, found)| {
        let phase = workload.phase(at, size);
        (phase.is_nan() && found.is_nan()) || (found - phase).abs() <= RIGHT
    });
    right.count() as f64 / found.len().max(1) as f64
}
