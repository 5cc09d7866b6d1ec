//! How often a trigger allocates, after the first ones, and what a plan takes: a binary of its own, because it counts every
//! allocation of a thread.

mod plans;

use allocation_counter::measure;
use appliance::calibration::Calibration;
use appliance::plan::Plan;
use appliance::recipe::Recipe;
use appliance::recipe::golden::Naming;
use appliance::recipe::teach::teach;
use appliance::station::{
    ActiveRecipe, Event, Identity, Limits, Micros, Settings, Station, StationHandle,
};
use appliance::station::{ConnectionEdges, ControlWrite, Effect};
use hal::frame::Frame;
use hal::sim::Scenario;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_secs(5);
/// Triggers before counting: buffers find their sizes.
const WARM_UP: usize = 4;
/// No buffer of a frame's size may be made anew in a cycle.
const PIXELS: u64 = 160 * 160;
/// Frames are written to the memory of those before.
const TAKING: u64 = 0;
/// Of the judgement, at most: a list of views, of findings, a name per gauge, what the strips hand to each other. Measured
/// are 48 for six gauges, 22 kB.
const JUDGING: u64 = 160;
/// Of the station, at most: a snapshot per event, the result.
const PUBLISHING: u64 = 2 * 14;

fn naming() -> Naming {
    Naming {
        number: 1,
        part_number: "P".into(),
        name: "part".into(),
        taught_at_unix_s: 0,
        placement_tolerance_mm: 1.0,
    }
}

#[test]
fn a_trigger_allocates_little_and_nothing_of_a_frame_s_size() {
    let scenario = Scenario::from_toml(
        "sub_rays = 2\n[rig.camera]\nwidth = 160\nheight = 160\n",
        "small",
    )
    .unwrap();
    let (mut head, stage) = hal::sim::head(&scenario).unwrap();
    let calibration = Calibration::of_stage(&stage);
    let taught = teach(&mut head, &calibration, &naming(), TIMEOUT, &|_, _| ()).unwrap();
    let plan = Plan::new(
        Recipe::from_bytes(&taught.bytes).unwrap(),
        &calibration,
        true,
    )
    .unwrap();
    head.load(plan.rasters(&calibration).unwrap()).unwrap();
    // One thread, so that what it counts is all there is.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let count = plan.sequence().frame_count();
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
                let inspection = plan.inspect(&frames, Instant::now());
                assert_eq!(inspection.error_code, 0);
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
    assert!(judging.count_total <= JUDGING, "{judging:?}");
    assert!(publishing.count_total <= PUBLISHING, "{publishing:?}");
    assert!(
        taking.bytes_total + judging.bytes_total < PIXELS,
        "{taking:?} {judging:?}"
    );
}

/// What the station takes for the measuring task's events of a cycle of twelve frames.
fn publishing() -> allocation_counter::AllocationInfo {
    let settings = Settings {
        next_seq: 1,
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
            // Whoever does not look loses nothing.
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
