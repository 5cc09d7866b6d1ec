//! Promises of the simulated head: the contract, any number of threads, scenarios, speed; the
//! submodules have the other topics.

mod board;
mod cables;
mod controller;
mod light;
mod sections;
mod solids;
mod staging;
mod surfaces;

use std::time::{Duration, Instant};

use super::parts::{Board, Defect, Joint, Plate};
use super::{Part, Scenario, head};
use hal::contract::check_head;
use hal::frame::{Frame, Samples};
use hal::head::Head;
use hal::projector::Raster;

const PATIENT: Duration = Duration::from_secs(1);

/// The study's rig with fewer pixels, so that tests are quick.
fn small(part: Part) -> Scenario {
    let mut scenario = Scenario {
        part,
        sub_rays: 2,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (64, 48);
    scenario
}

/// Every stock part, and every one that can have dents with a dent and a bump; the sheet metal has
/// its other defects too.
fn all_parts() -> Vec<Part> {
    let stock = Part::stock().map(|part| match part {
        Part::Board(board) => Part::Board(Board {
            bow_um: 300.0,
            ..board
        }),
        part => part,
    });
    let dented = stock.iter().filter_map(|part| {
        let mut part = part.clone();
        let dents = [1.5, -0.6].map(|depth_mm| dent(&part, depth_mm));
        let others = [
            Defect::MissingHole { index: 1 },
            Defect::BentFlange { degrees: 6.0 },
        ];
        let can_have = |defect: &Defect| part.can_have(defect).is_ok();
        let defects: Vec<_> = dents.into_iter().chain(others).filter(can_have).collect();
        *part.defects_mut()? = defects;
        Some(part)
    });
    stock.iter().cloned().chain(dented).collect()
}

/// A dent at a place where the part slopes.
fn dent(part: &Part, depth_mm: f64) -> Defect {
    let [x, y] = match part {
        Part::Flowerpot(_) => [-60.0, 52.0],
        Part::SheetMetal(_) => [58.0, -5.0],
        Part::Sawtooth(_) => [9.0, 12.0],
        Part::Face(_) => [-20.0, 62.0],
        Part::Handset(_) => [20.0, 26.0],
        _ => [-20.0, 35.0],
    };
    Defect::Dent {
        x,
        y,
        depth_mm,
        diameter_mm: 8.0,
    }
}

/// One frame for each grey, shown uniformly.
fn frames(head: &mut Head, greys: &[u8]) -> Vec<Frame> {
    let (width, height) = head.projector_size();
    let rasters = greys
        .iter()
        .map(|grey| Raster::uniform(width, height, *grey).unwrap());
    head.load(rasters.collect()).unwrap();
    let indices: Vec<usize> = (0..greys.len()).collect();
    let mut frames = Vec::new();
    head.acquire(&indices, PATIENT, &mut |_, frame| frames.push(frame))
        .unwrap();
    frames
}

fn counts(frame: &Frame) -> Vec<f64> {
    match frame.samples() {
        Samples::Eight(samples) => samples.iter().map(|s| f64::from(*s)).collect(),
        Samples::Sixteen(samples) => samples.iter().map(|s| f64::from(*s)).collect(),
    }
}

#[test]
fn a_scenario_is_read_over_its_defaults_and_refuses_what_it_does_not_know() {
    let text = "bit_depth = 10\nmaterial = \"oiled\"\n[rig.camera]\nwidth = 640\n[part]\nkind = \"sheet_metal\"\n\
        [[part.defects]]\nkind = \"dent\"\nx = 1.0\ny = 2.0\ndepth_mm = 1.0\ndiameter_mm = 9.0\n";
    let scenario = Scenario::from_toml(text, "s.toml").unwrap();
    assert_eq!(
        (
            scenario.bit_depth,
            scenario.rig.camera.width,
            scenario.rig.camera.height
        ),
        (10, 640, 512)
    );
    assert_eq!(scenario.rig.projector, Scenario::default().rig.projector);
    assert_eq!(
        Scenario::from_toml("", "s.toml").unwrap(),
        Scenario::default()
    );
    for (text, expected) in [
        ("bits = 8", "bits"),
        ("bit_depth = 9", "bit_depth is 9"),
        ("[rig.camera]\nfocus = 1", "focus"),
        ("[rig.camera]\nwidth = 0", "rig.camera.width is 0"),
        (
            "sub_rays = 16\n[rig.camera]\nwidth = 4096\nheight = 4096",
            "4096×4096 pixels with 16²",
        ),
        ("[part]\nkind = \"cube\"", "cube"),
        ("[part]\nkind = \"empty\"\nsize = 1", "size"),
        ("[part]\nkind = \"cone\"\nheight = 1", "height"),
        ("[light]\nambient = nan", "light.ambient is NaN"),
        ("[light]\nspecular = 4.1", "light.specular is 4.1"),
        ("[light]\nshininess = 0.5", "light.shininess is 0.5"),
        ("material = \"wood\"", "rolled_steel"),
        (
            "[placement]\ntilt_deg = [90.0, 0.0]",
            "placement.tilt_deg is 90",
        ),
        (
            "[part]\nkind = \"sheet_metal\"\ndefects = [{ kind = \"missing_hole\", index = 3 }]",
            "index is 3",
        ),
    ] {
        let message = Scenario::from_toml(text, "s.toml").unwrap_err().to_string();
        assert!(
            message.contains("s.toml") && message.contains(expected),
            "{text}: {message}"
        );
    }
    let written = toml::to_string(&scenario).unwrap();
    assert_eq!(Scenario::from_toml(&written, "s.toml").unwrap(), scenario);
}

#[test]
fn a_simulated_head_keeps_the_contract() {
    for bit_depth in [8, 10, 12] {
        let scenario = Scenario {
            bit_depth,
            ..small(Part::default())
        };
        check_head(&mut head(&scenario).unwrap().0, 6).unwrap();
    }
}

#[test]
fn frames_and_truth_are_the_same_for_any_number_of_threads() {
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            [Part::default(), Part::Plate(Plate::default())].map(|part| {
                let mut scenario = small(part);
                scenario.optics.camera_blur_px = 0.7;
                let (mut head, stage) = head(&scenario).unwrap();
                let frames: Vec<_> = frames(&mut head, &[200, 50]).iter().map(counts).collect();
                let bits: Vec<u32> = stage.truth().height.iter().map(|z| z.to_bits()).collect();
                (frames, bits, stage.truth().class)
            })
        })
    };
    assert!(with_threads(1) == with_threads(2));
}

/// Prints the times that the README states. Run with
/// `cargo test --release -p sim --lib -- --ignored --nocapture speed`.
#[test]
#[ignore = "a measurement, not a promise: run it alone and in release"]
fn speed_of_building_a_transport_and_of_one_frame() {
    let solids = [Part::Plate(Plate::default()), Part::Joint(Joint::default())];
    for part in solids.into_iter().chain(all_parts()) {
        let scenario = Scenario {
            part,
            ..Scenario::default()
        };
        let begun = Instant::now();
        let (mut head, _) = head(&scenario).unwrap();
        let build = begun.elapsed();
        let (width, height) = head.projector_size();
        head.load(vec![Raster::uniform(width, height, 100).unwrap(); 12])
            .unwrap();
        let indices: Vec<usize> = (0..12).cycle().take(48).collect();
        let begun = Instant::now();
        head.acquire(&indices, PATIENT, &mut |_, _| ()).unwrap();
        let name = format!("{:?}", scenario.part);
        println!(
            "{:14} build {:6.2} s, frame {:5.2} ms",
            name.split('(').next().unwrap(),
            build.as_secs_f64(),
            begun.elapsed().as_secs_f64() * 1e3 / 48.0
        );
    }
}
