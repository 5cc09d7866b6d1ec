//! Light as real projectors make it and colour cameras see it, on the simulated head.

use crate::measured::Measured;
use algo::pattern::{PhaseFunction, Sequence};
use appliance::config::{Backend, HeadConfig};
use appliance::head::calibrated::CalibratedHead;
use appliance::head::examine::{Lit, SETTLE};
use appliance::head::seam;
use appliance::production::backend::{self, OpenedHead};
use hal::error::DeviceKind;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use std::path::Path;
use std::time::Duration;
use tests::small_head::SMALL_HEAD as HEAD;

/// Opens a small head with these keys, as every command does that measures.
fn open(folder: &Path, keys: &str) -> (HeadConfig, OpenedHead) {
    open_scenario(folder, &format!("{HEAD}{keys}"))
}

fn open_scenario(folder: &Path, text: &str) -> (HeadConfig, OpenedHead) {
    let scenario = folder.join("scenario.toml");
    std::fs::write(&scenario, text).unwrap();
    let config = HeadConfig {
        backend: Backend::Sim,
        scenario: Some(scenario),
        ..HeadConfig::default()
    };
    let opened = backend::open(&config, &|_| ()).unwrap();
    (config, opened)
}

#[test]
fn light_that_comes_seconds_after_the_mode_was_set_is_waited_for_also_when_a_lost_head_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let (config, mut opened) = open(folder.path(), "[timing]\nfirst_light_us = 3000000\n");
    let lit = |opened: &mut OpenedHead| Lit::take(&mut opened.head, SETTLE).unwrap().share();
    assert_eq!((opened.dark.clone(), lit(&mut opened)), (None, 1.0));
    let stage = opened.stage.clone().unwrap();
    stage.unplug(DeviceKind::Projector);
    stage.plug(DeviceKind::Projector);
    opened.reopen(&config).unwrap();
    assert_eq!((opened.dark.clone(), lit(&mut opened)), (None, 1.0));
}

#[test]
fn light_that_does_not_come_is_said_and_the_head_is_open_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (_, opened) = open(folder.path(), "[timing]\nfirst_light_us = 60000000\n");
    let said = opened.dark.unwrap();
    assert!(
        said.contains("within 15 s") && said.contains("power"),
        "{said}"
    );
    // A fixture without a part is no reason to wait, where opening sets no mode.
    let (_, opened) = open(folder.path(), "[light]\ndiffuse = 0.0\n");
    assert_eq!(opened.dark, None);
}

#[test]
fn a_colour_camera_measures_through_one_green_plane_with_the_geometry_of_that_plane() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = format!("colour = true\n{HEAD}[noise]\nnoise_counts = 1.0\n");
    let (_, mut opened) = open_scenario(folder.path(), &scenario);
    let format = opened.head.camera_format();
    // Half the columns and rows of the sensor.
    assert_eq!((format.width, format.height), (64, 48));
    assert!(opened.head.encoding().name.contains("one green plane"));
    let (columns, rows) = opened.head.projector_size();
    let fringes = f64::from(columns) / 20.0;
    let function = PhaseFunction::vertical(columns as usize, rows as usize, fringes).unwrap();
    let shots = Sequence::geometric(function.range(), 3, 4);
    let calibration = &opened.calibration;
    let measured = CalibratedHead::new(&mut opened.head, calibration, Duration::from_secs(1))
        .measure(&function, &shots, None, &|_| ())
        .unwrap();
    let truth = opened.stage.as_ref().unwrap().truth();
    let frames = shots.iter().zip(measured.frames);
    let played = Measured::new(Recording {
        patterns: vec![PatternSpec::Vertical { fringes }],
        frames: frames
            .map(|(shot, frame)| seam::recorded(*shot, frame))
            .collect(),
        truth_height: Some(truth.height),
        truth_class: Some(truth.class),
        ..calibration.recording()
    });
    let live: Vec<f32> = measured
        .heights
        .height
        .iter()
        .map(|height| height.mm() as f32)
        .collect();
    assert_eq!(live, played.heights(), "as replayed");
    let score = played.result.report.score.as_ref().unwrap();
    println!("{score:?}");
    assert!(score.scored > 64 * 48 * 9 / 10, "{score:?}");
    assert!(
        score.bias_mm.abs() < 0.005 && score.rms_mm < 0.1,
        "{score:?}"
    );
}
