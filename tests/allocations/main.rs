//! How often a trigger allocates after the first ones (not at all until its result is handed over),
//! and how much memory a plan takes. A binary of its own, because it counts every allocation of a
//! thread.

mod plans;

use algo::inspect::{FeatureKind, Measure};
use allocation_counter::measure;
use appliance::head::calibration::Calibration;
use appliance::recipe::file::archive;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::golden::Naming;
use appliance::recipe::teach::teach;
use appliance::recipe::{FeatureFile, GaugeFile, Recipe};
use appliance::station::{
    ActiveRecipe, Event, Identity, Limits, Micros, Settings, Station, StationHandle,
};
use appliance::station::{ConnectionEdges, ControlWrite, Effect};
use appliance::system::headway::Headway;
use hal::frame::Frame;
use sim::Scenario;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_secs(5);
/// Triggers before counting, in which buffers reach their sizes.
const WARM_UP: usize = 4;
/// Frames are written to the memory of earlier ones.
const TAKING: u64 = 0;
/// Decoding, alignment and gauges of every kind use memory that was allocated with the plan.
const JUDGING: u64 = 0;
/// Most allocations of the station: a snapshot per event, and the result. Their readers may keep
/// them, so they cannot be reused.
const PUBLISHING: u64 = 2 * 14;

fn naming() -> Naming {
    Naming {
        number: 1,
        part_number: "P".into(),
        name: "part".into(),
        taught_by: String::new(),
        taught_at_unix_s: 0,
        placement_tolerance_mm: 1.0,
        exposures: None,
        everything: false,
        marking: Default::default(),
        empty: None,
        limit_mm: Some(0.15),
    }
}

#[test]
fn a_trigger_allocates_nothing_until_its_result_is_handed_over() {
    let scenario = Scenario::from_toml(
        "sub_rays = 2\n[rig.camera]\nwidth = 160\nheight = 160\n",
        "small",
    )
    .unwrap();
    let (mut head, stage) = sim::head(&scenario).unwrap();
    let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
    let taught = teach(
        &mut head,
        &calibration,
        &naming(),
        TIMEOUT,
        Headway::silent(),
    )
    .unwrap()
    .seal()
    .unwrap();
    let mut file = taught.manifest.clone();
    file.judges_nothing = true;
    let frame = &file.features[0].region;
    file.features = features(frame);
    file.gauges = gauges();
    let (bytes, _) = archive::pack(&file, &taught.recipe.arrays).unwrap();
    let plan = Plan::new(Recipe::from_bytes(&bytes).unwrap(), &calibration, true).unwrap();
    head.load(plan.rasters(&calibration).unwrap()).unwrap();
    // One thread, because allocations are counted per thread.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let count = plan.indices(0).len();
    let indices: Vec<usize> = (0..count).collect();
    let mut frames: Vec<Frame> = Vec::new();
    let (mut taking, mut judging) = (Default::default(), Default::default());
    for _ in 0..=WARM_UP {
        taking = measure(|| {
            frames.clear();
            head.acquire(&indices, TIMEOUT, &mut |_, frame| frames.push(frame))
                .unwrap();
        });
        judging = pool.install(|| {
            measure(|| {
                let mut arriving = plan.arriving(0);
                for arrived in 1..=count {
                    if plan.can_arrive(&arriving, arrived) {
                        plan.arrive(&mut arriving, &frames[..arrived]);
                    }
                }
                let inspection = plan.inspect_arrived(&frames, arriving, Instant::now());
                assert_eq!((inspection.error_code, &inspection.reason), (0, &None));
                assert!(inspection.placement.is_some());
            })
        });
    }
    let publishing = publishing();
    println!(
        "allocations of a trigger: {} for {count} frames ({} bytes), {} to judge ({} bytes), {} to publish ({} bytes)",
        taking.count_total,
        taking.bytes_total,
        judging.count_total,
        judging.bytes_total,
        publishing.count_total,
        publishing.bytes_total
    );
    assert_eq!(taking.count_total, TAKING, "{taking:?}");
    assert_eq!(judging.count_total, JUDGING, "{judging:?}");
    assert!(publishing.count_total <= PUBLISHING, "{publishing:?}");
}

/// Two features of every kind, the second of a slightly smaller region.
fn features(region: &[[f64; 2]]) -> Vec<FeatureFile> {
    let mut smaller = region.to_vec();
    smaller[0][0] += 1.0;
    let feature = |kind: FeatureKind, place: usize| {
        let name = format!("{} {place}", kind.name());
        FeatureFile::new(name, kind, [region, &smaller][place].to_vec())
    };
    let kinds = FeatureKind::ALL.into_iter();
    kinds
        .filter(is_of_heights)
        .flat_map(|kind| [feature(kind, 0), feature(kind, 1)])
        .collect()
}

/// Whether a feature is made of heights: a contour is found into lists as long as its rim, and a
/// section into one as long as it has points.
fn is_of_heights(kind: &FeatureKind) -> bool {
    matches!(kind, FeatureKind::Surface | FeatureKind::Plane)
}

/// One gauge of every kind that is of heights.
fn gauges() -> Vec<GaugeFile> {
    let gauge = |(slot, measures): (u16, Measure)| {
        let takes = measures.facts().takes.iter().enumerate();
        let of = takes.map(|(place, kinds)| format!("{} {place}", kinds[0].name()));
        GaugeFile {
            of: of.collect(),
            ..GaugeFile::new(slot, &format!("gauge {slot}"), measures, &[])
        }
    };
    let mut kinds = Measure::examples();
    kinds.retain(|kind| kind.facts().takes.iter().all(|of| is_of_heights(&of[0])));
    (1..).zip(kinds).map(gauge).collect()
}

/// The allocations of the station for the measuring task's events of a cycle with twelve frames.
fn publishing() -> allocation_counter::AllocationInfo {
    let settings = Settings {
        next_seq: 1,
        buffered: Default::default(),
        boot_id: 1,
        teach_allowed: false,
        identity: Arc::new(Identity {
            vendor: "v".into(),
            product: "p".into(),
            serial: "s".into(),
            version: "1".into(),
        }),
        limits: Limits::default(),
    };
    let (sink, effects) = mpsc::channel();
    let station = StationHandle::new(
        Station::new(settings, Micros(0)),
        Instant::now(),
        move |effect| {
            // Effects that are not received may be lost.
            let _ = sink.send(effect);
            None
        },
    );
    station.event(Event::Started);
    let load = appliance::station::Request::Load(appliance::station::RecipeKey::Number(1));
    station.event(Event::Request(load));
    let mut counted = Default::default();
    for token in 1..=3_u16 {
        let write = ControlWrite {
            token: Some(token),
            ..Default::default()
        };
        let mut edges = ConnectionEdges::default();
        while let Ok(effect) = effects.try_recv() {
            if let Effect::Load { job, .. } = effect {
                let recipe = ActiveRecipe {
                    number: 1,
                    crc: 1,
                    part_number: "PART-1".into(),
                    name: "part".into(),
                };
                station.event(Event::RecipeLoaded { job, recipe });
            }
        }
        station.write(&mut edges, write).unwrap();
        let job = effects
            .try_iter()
            .find_map(|effect| match effect {
                Effect::Measure(job) => Some(job.job),
                _ => None,
            })
            .unwrap();
        let inspection = Arc::new(appliance::station::Inspection::default());
        counted = measure(|| {
            for _ in 0..12 {
                station.event(Event::Alive);
            }
            station.event(Event::ExposureDone { job });
            station.event(Event::Finished { job, inspection });
        });
    }
    counted
}
