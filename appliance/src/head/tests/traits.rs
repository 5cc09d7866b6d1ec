//! Traits of real devices that data sheets leave out: the doctor names each, calibration measures
//! it, and sequences cope with it.

use crate::head::calibration::Calibration;
use crate::head::calibration::file::CalibrationFile;
use crate::head::commission::{Choices, Commissioning, PLANE, Step, Subject, TIMING};
use crate::head::doctor::{Check, CheckVerdict, examine};
use crate::head::examine::pace;
use hal::head::{Exposure, Head, Timing};
use hal::projector::Raster;
use sim::Scenario;
use std::time::Duration;

/// A small camera in front of a plane, exposing for one refresh of 60 Hz; tests add to its section
/// `timing`, which is the last.
const HEAD: &str = "sub_rays = 1
part = { kind = \"plane\" }
[rig.camera]
width = 96
height = 72
fov_deg = [5.0, 3.75]
[timing]
exposure_refreshes = 1.0
stamp = \"exposure_end\"
flip_to_light_us = 20000
";
/// An IMX296 by its data sheet, which takes a little longer: 16.667 + 16.56 + 0.24 ms.
const IMX296: &str = "readout_us = 16560\ndead_us = 240\n";

fn scenario(more: &str) -> Scenario {
    Scenario::from_toml(&format!("{HEAD}{more}"), "here").unwrap()
}

/// The head, calibrated as its scenario says.
fn head(more: &str) -> (Head, Calibration) {
    let scenario = scenario(more);
    let (head, stage) = sim::head(&scenario).unwrap();
    (head, Calibration::of_scenario(stage.scenario()).unwrap())
}

/// The doctor's checks that failed.
fn failed((head, calibration): &mut (Head, Calibration)) -> Vec<Check> {
    let mut checks = examine(head, calibration, true, &|_, _| ());
    checks.retain(|check| check.verdict == CheckVerdict::Fail);
    checks
}

/// Takes twelve patterns.
fn sequence(head: &mut Head) -> Result<Exposure, hal::error::Error> {
    let (columns, rows) = head.projector_size();
    head.load(vec![Raster::uniform(columns, rows, 128)?; 12])?;
    let indices: Vec<usize> = (0..12).collect();
    head.acquire(&indices, Duration::from_secs(2), &mut |_, _| ())
}

/// Calibrates it without a plate.
fn calibrated((head, calibration): &mut (Head, Calibration)) -> CalibrationFile {
    let folder = tempfile::tempdir().unwrap();
    let mut calibration = calibration.clone();
    let mut kept = Commissioning::of(calibration.sizes(), None);
    let mut subject = Subject {
        head,
        calibration: &mut calibration,
        calibrated: true,
        exact: true,
        before: None,
        place: &folder.path().join("calibration.json"),
        poses: None,
        choices: Choices {
            no_plate: true,
            ..Choices::default()
        },
        progress: &|_, _| (),
        white: None,
        stored: None,
        notes: Vec::new(),
    };
    for name in [TIMING, PLANE] {
        let step = Step::of(name).unwrap();
        step.carry_out(&mut subject, &mut kept).unwrap();
    }
    subject.stored.unwrap()
}

#[test]
fn a_camera_that_is_not_ready_in_time_is_named_and_calibration_finds_the_pace_that_loses_no_trigger()
 {
    let more = format!("{IMX296}calibrated_refreshes = 2\n");
    let mut own = head(&more);
    let checks = failed(&mut own);
    let [check] = &checks[..] else {
        panic!("{checks:#?}");
    };
    assert_eq!(check.name, "trigger");
    assert!(check.remedy.contains("3 refreshes"), "{}", check.remedy);
    assert_eq!(check.measured["refreshes_needed"], 3);
    // Every other trigger is lost, and each costs a pattern another attempt.
    assert!(sequence(&mut own.0).unwrap().retaken > 4);
    let made = calibrated(&mut own);
    assert_eq!(made.timing.as_ref().unwrap().refreshes, Some(3));
    let taken = sequence(&mut own.0).unwrap();
    assert_eq!(taken.retaken, 0, "{taken:?}");
    // And by its file, on a head that is opened again.
    let (mut again, _) = head(&more);
    again.set_timing(made.timing(again.timing()));
    assert_eq!(sequence(&mut again).unwrap().retaken, 0);
    assert_eq!(failed(&mut (again, own.1)).len(), 0);
}

#[test]
fn a_head_that_is_not_calibrated_loses_no_trigger_of_such_a_camera() {
    let (mut head, _) = head(IMX296);
    head.set_timing(Timing {
        hold: Timing::unproven(head.camera_timing().starts).hold,
        ..head.timing()
    });
    assert_eq!(sequence(&mut head).unwrap().retaken, 0);
}

#[test]
fn two_refreshes_are_proven_for_a_slower_mode_and_for_a_camera_without_dead_time() {
    for more in [
        "readout_us = 16560\n".to_owned(),
        // 58 Hz: two refreshes are 34.48 ms.
        format!("{IMX296}calibrated_refreshes = 3\n"),
    ] {
        let mut scenario = scenario(&more);
        if scenario.timing.dead_us > 0 {
            scenario.refresh_hz = 58.0;
        }
        let (mut head, _) = sim::head(&scenario).unwrap();
        let tried = pace(&mut head).unwrap();
        let last = tried.last().unwrap();
        assert!(last.none_lost() && last.refreshes == 2, "{tried:?}");
    }
}

#[test]
fn a_bad_contact_of_the_trigger_is_not_taken_for_a_slow_camera() {
    let more = "readout_us = 16000\n[faults]\nlost_trigger = 0.3\nseed = 3\n";
    let mut own = head(more);
    let checks = failed(&mut own);
    assert_eq!(checks.len(), 1);
    assert!(checks[0].remedy.contains("contact"), "{checks:#?}");
    assert_eq!(
        checks[0].measured["refreshes_needed"],
        serde_json::Value::Null
    );
    assert!(!pace(&mut own.0).unwrap().last().unwrap().none_lost());
}

#[test]
fn stamps_that_are_late_by_a_constant_are_named_measured_and_corrected() {
    for late_us in [0, 150, 190, 300, 400] {
        let more = format!(
            "readout_us = 12000\nstamp_late_us = {late_us}\ncalibrated_stamp_late_us = 0\n[faults]\nstamp_jitter_us = 40\n"
        );
        let mut own = head(&more);
        let checks = failed(&mut own);
        assert_eq!(
            checks.len(),
            usize::from(late_us > 0),
            "{late_us}: {checks:#?}"
        );
        if let Some(check) = checks.first() {
            assert_eq!(check.name, "trigger");
            assert!(check.remedy.contains("later than"), "{}", check.remedy);
        }
        // Uncorrected, stamps at 190 µs with 40 µs of jitter are beyond the tolerance now and then,
        // and at 300 µs always.
        let uncorrected = sequence(&mut own.0);
        match late_us {
            0 => assert_eq!(uncorrected.unwrap().unexplained, 0),
            150 => {}
            190 => assert!(uncorrected.unwrap().unexplained > 0),
            _ => assert!(uncorrected.is_err(), "{uncorrected:?}"),
        }
        let made = calibrated(&mut own);
        let found = made.timing.as_ref().unwrap().stamp_late_ns.unwrap();
        assert!(
            found.abs_diff(late_us * 1000) < 25_000,
            "{late_us}: {found}"
        );
        let taken = sequence(&mut own.0).unwrap();
        assert_eq!((taken.unexplained, taken.retaken), (0, 0), "{taken:?}");
        let checks = failed(&mut own);
        assert!(checks.is_empty(), "{checks:#?}");
    }
}

#[test]
fn a_slow_start_of_the_camera_is_named_where_it_is_stopped_after_each_cycle_and_is_waited_for_once()
{
    let more = "readout_us = 12000\nstart_up_us = 500000\n";
    let mut own = head(&format!("{more}stays_on_s = 0\n"));
    let checks = failed(&mut own);
    let [check] = &checks[..] else {
        panic!("{checks:#?}");
    };
    assert_eq!(check.name, "start");
    assert_eq!(check.measured["start_ms"], 500.0);
    let waits = |head: &mut Head| [(); 3].map(|()| sequence(head).unwrap().start_up.as_millis());
    assert_eq!(waits(&mut own.0), [500, 500, 500]);
    let mut own = head(more);
    assert_eq!(waits(&mut own.0), [500, 0, 0]);
    assert_eq!(failed(&mut own).len(), 0);
    // A camera that runs by itself is always stopped.
    let mut own = head(&format!("{more}camera_period_us = 33333\n"));
    assert!(failed(&mut own)[0].remedy.contains("always-on"));
}

#[test]
fn a_camera_that_the_projector_triggers_is_paced_by_its_readout_and_dead_time() {
    let more = format!("{IMX296}calibrated_refreshes = 2\nby_projector = true\n");
    let mut own = head(&more);
    let checks = failed(&mut own);
    let [check] = &checks[..] else {
        panic!("{checks:#?}");
    };
    assert_eq!(check.name, "trigger");
    assert!(check.remedy.contains("3 refreshes"), "{}", check.remedy);
    let made = calibrated(&mut own);
    let timing = made.timing.as_ref().unwrap();
    assert_eq!(timing.refreshes, Some(3));
    assert!(timing.flip_to_light_ns.abs_diff(20_000_000) < 50_000);
    let taken = sequence(&mut own.0).unwrap();
    assert_eq!(taken.retaken, 0, "{taken:?}");
    assert_eq!(failed(&mut own).len(), 0);
}
