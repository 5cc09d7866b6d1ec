//! From trigger to verdict: how long each stage takes on a simulated head with a taught recipe.

use super::gauges::Gauges;
use super::kernel::{Decoding, Inspecting};
use super::timing::{Effort, FrameSet, FrameSets, Kernel, alone, median, ns_per_px};
use crate::Failed;
use appliance::head::calibration::Calibration;
use appliance::recipe::file::archive;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::{Naming, teach};
use appliance::recipe::{AlignmentKind, Recipe};
use appliance::system::headway::Headway;
use hal::frame::Frame;
use hal::head::Head;
use serde::{Serialize, Serializer};
use sim::{Placement, Scenario};
use std::time::{Duration, Instant};

/// Angles of view of the physical head of the study (section 5.2), degrees.
const FOV_DEG: [f64; 2] = [22.28, 16.77];
/// Longest wait for a frame.
const TIMEOUT: Duration = Duration::from_secs(5);
/// From the camera's start until it can be triggered, µs: the start-up delay in the overlay of the
/// reference camera.
const START_UP_US: u64 = 500_000;
/// Placement tolerance, mm: small enough for single levels.
const PLACEMENT_MM: f64 = 0.5;
/// Where a moved part lies: displaced by some pixels that differ over the frame.
const MOVED: Placement = Placement {
    shift_mm: [0.4, -0.3, 0.1],
    tilt_deg: [0.1, -0.15],
    rotation_deg: 0.3,
};

/// The time of one cycle, stage by stage.
#[derive(Clone, Debug, Serialize)]
pub struct Budget {
    /// Columns of the camera.
    #[serde(skip)]
    pub width: u32,
    /// Rows of the camera.
    #[serde(skip)]
    pub height: u32,
    /// Frames of the production sequence.
    #[serde(skip)]
    pub frames: usize,
    /// How the part lies, and whether its motion is measured and compensated.
    #[serde(skip)]
    pub lies: Lies,
    /// What is measured.
    #[serde(skip)]
    pub gauges: Gauges,
    /// What a cycle waits for the camera's start, ms: 0, although it takes 500 ms (the imx296
    /// overlay's), because the camera stays on.
    pub start_ms: f64,
    /// From the trigger to the end of the last exposure at the projector's refresh rate, ms.
    pub exposure_ms: f64,
    /// Stage and wall time on all threads, ms, medians; without what is decoded on arrival.
    #[serde(serialize_with = "by_stage")]
    pub stages: Vec<(String, f64)>,
    /// From the last frame to the verdict, ms: all stages.
    pub verdict_ms: f64,
    /// From the trigger to the verdict, ms.
    pub total_ms: f64,
    /// Processor time of frames → verdict on one thread, ms.
    pub one_thread_ms: f64,
    /// Processor time of the phase kernel alone, same frames and window, ms.
    pub kernel_ms: f64,
    /// The ratio of the last two.
    pub x_kernel: f64,
}

/// How a part lies, and what is made of that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lies {
    /// As taught, and is taken to.
    AsTaught,
    /// As taught; its motion, which is noise only, is compensated.
    Aligned,
    /// Shifted, tilted and turned; its motion is compensated.
    Moved,
}

impl Lies {
    const ALL: [Self; 3] = [Self::AsTaught, Self::Aligned, Self::Moved];

    fn alignment(self) -> AlignmentKind {
        match self {
            Self::AsTaught => AlignmentKind::None,
            Self::Aligned | Self::Moved => AlignmentKind::Rigid,
        }
    }

    fn placement(self) -> Placement {
        match self {
            Self::AsTaught | Self::Aligned => Placement::default(),
            Self::Moved => MOVED,
        }
    }
}

/// Budgets of a camera of this size: with four frames of one level about the golden map, and with
/// the full sequence; each without and with compensation of the part's motion, and with that of a
/// part that was moved. With the full sequence and a moved part also with many gauges.
///
/// # Errors
/// If something cannot be simulated or taught.
pub fn budgets(
    (width, height): (u32, u32),
    effort: &Effort,
    progress: &dyn Fn(f64, &str),
) -> Result<Vec<Budget>, Failed> {
    let mut scenario = Scenario::default();
    let camera = &mut scenario.rig.camera;
    (camera.width, camera.height, camera.fov_deg) = (width, height, FOV_DEG);
    scenario.timing.start_up_us = START_UP_US;
    let about = format!("{width}x{height}");
    progress(0.0, &format!("{about}: light of the scene"));
    let (mut head, stage) = sim::head(&scenario)?;
    let calibration = Calibration::of_scenario(stage.scenario())?;
    let naming = Naming {
        number: 1,
        part_number: "BENCH".into(),
        name: "bench".into(),
        taught_by: "bench".into(),
        taught_at_unix_s: 0,
        placement_tolerance_mm: PLACEMENT_MM,
        exposures: None,
        everything: false,
        marking: Default::default(),
        empty: None,
        limit_mm: Some(0.15),
    };
    progress(0.3, &format!("{about}: teaching"));
    let headway = Headway::silent();
    let taught = teach(&mut head, &calibration, &naming, TIMEOUT, headway)?;
    let taught = taught.seal()?;
    let sequences = &taught.manifest.sequences;
    let full = sequences.len().saturating_sub(1);
    let four = sequences
        .iter()
        .position(|sequence| sequence.frames.len() == 4);
    let mut found = Vec::new();
    let cycles = four.into_iter().chain([full]);
    let (part, ..) = stage.placed();
    let taught_gauges = cycles.flat_map(|at| Lies::ALL.map(|lies| (at, lies, Gauges::Taught)));
    let many = Gauges::MANY.into_iter();
    let many = many.filter(|gauges| gauges.need_columns() <= width);
    let many = many.map(|gauges| (full, Lies::Moved, gauges));
    for (production, lies, gauges) in taught_gauges.chain(many) {
        progress(
            0.8,
            &format!("{about}: {} frames", sequences[production].frames.len()),
        );
        let mut file = taught.manifest.clone();
        file.production = production;
        file.alignment = lies.alignment();
        gauges.replace(&mut file, (width, height));
        let (bytes, _) = archive::pack(&file, &taught.recipe.arrays)?;
        let recipe = Recipe::from_bytes(&bytes)?;
        let plan = Plan::new(recipe, &calibration, true)?;
        stage.place(&part, &lies.placement())?;
        found.push(Budget {
            lies,
            gauges,
            ..budget(
                &plan,
                &mut head,
                &calibration,
                stage.scenario().refresh(),
                effort,
            )?
        });
    }
    Ok(found)
}

fn budget(
    plan: &Plan,
    head: &mut Head,
    calibration: &Calibration,
    refresh: Duration,
    effort: &Effort,
) -> Result<Budget, Failed> {
    plan.load(head, calibration)?;
    let indices = plan.indices(0);
    let mut frames = Vec::new();
    // The first cycle after a pause starts the camera; all others find it on.
    head.acquire(indices, TIMEOUT, &mut |_, _| ())?;
    let exposure = head.acquire(indices, TIMEOUT, &mut |_, frame| frames.push(frame))?;
    let start_ms = ms(exposure.start_up);
    // The last exposure lasts a refresh, and the trigger waits for up to one before the first.
    let shown = Duration::from_nanos(exposure.done.0.saturating_sub(exposure.started.0));
    let exposure_ms = ms(shown + 2 * refresh);
    let mut runs: Vec<Vec<(String, f64)>> = Vec::new();
    for _ in 0..effort.rounds {
        let mut arriving = plan.arriving(0);
        while plan.can_arrive(&arriving, frames.len()) {
            plan.arrive(&mut arriving, &frames);
        }
        let inspection = plan.inspect_arrived(&frames, arriving, Instant::now());
        let stages = inspection.stages.iter();
        runs.push(
            stages
                .map(|stage| (stage.stage.name().to_owned(), f64::from(stage.us) / 1e3))
                .collect(),
        );
    }
    let middle = |at: usize| median(runs.iter().map(|run| run[at].1).collect());
    let stages: Vec<(String, f64)> = runs
        .first()
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(at, (name, _))| (name.clone(), middle(at)))
        .collect();
    let whole = |run: &Vec<(String, f64)>| run.iter().map(|stage| stage.1).sum();
    let verdict_ms = median(runs.iter().map(whole).collect());
    let [one_thread_ms, kernel_ms, x_kernel] = on_one_thread(plan, &frames, effort)?;
    let (width, height, _) = calibration.frames();
    Ok(Budget {
        width,
        height,
        frames: frames.len(),
        lies: Lies::AsTaught,
        gauges: Gauges::Taught,
        start_ms,
        exposure_ms,
        stages,
        verdict_ms,
        total_ms: start_ms + exposure_ms + verdict_ms,
        one_thread_ms,
        kernel_ms,
        x_kernel,
    })
}

/// Processor time of frames → verdict and of the phase kernel alone, ms, and their ratio. The two
/// are timed in turn, each on more frame sets than fit into any cache.
fn on_one_thread(plan: &Plan, frames: &[Frame], effort: &Effort) -> Result<[f64; 3], Failed> {
    let map = plan.production().map().to_vec();
    let mut sets = FrameSets::of(FrameSet::new(frames.to_vec(), Some(map)), effort.bytes);
    let pixels = sets.next().pixels() as f64;
    let decoder = plan.production().decoder().clone();
    let mut kernel = Decoding::new(decoder, Some(plan.production().window().to_vec()));
    let mut whole = Inspecting::new(plan.production());
    let alone = alone()?;
    let (mut inspected, mut decoded, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..effort.rounds {
        let [inspection, phase] = alone.install(|| {
            [&mut whole as &mut dyn Kernel, &mut kernel]
                .map(|kernel| ns_per_px(kernel, &mut sets, effort.patience))
        });
        inspected.push(inspection * pixels / 1e6);
        decoded.push(phase * pixels / 1e6);
        ratios.push(inspection / phase.max(f64::MIN_POSITIVE));
    }
    Ok([inspected, decoded, ratios].map(median))
}

/// An object with a key `<stage>_ms` for each stage.
fn by_stage<S: Serializer>(stages: &[(String, f64)], out: S) -> Result<S::Ok, S::Error> {
    out.collect_map(stages.iter().map(|(name, ms)| (format!("{name}_ms"), ms)))
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
