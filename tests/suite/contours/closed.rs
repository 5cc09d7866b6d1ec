//! Holes, slots and edges that are not there, in sheets of every thickness, tilt, floor and rim: they
//! are absent, and what is merely hidden is not.

use super::line::Line;
use super::plates::{Setting, plate};
use super::{bright, thick};
use appliance::station::Verdict;
use sim::parts::{Defect, Plate};
use tests::random::Random;

/// The settings: of each list one.
fn settings(thicknesses: &[f64], tilts: &[f64], rims: &[f64]) -> Vec<(String, Setting)> {
    let mut all = Vec::new();
    for &thickness_mm in thicknesses {
        for &tilt_deg in tilts {
            for &rim_mm in rims {
                for is_lit in [false, true] {
                    let plate = Plate {
                        thickness_mm,
                        rim_mm,
                        ..thick(plate())
                    };
                    let setting = Setting {
                        plate: if is_lit { bright(plate) } else { plate },
                        thickness_mm: Some(thickness_mm),
                        tilt_deg,
                        some: true,
                        ..Setting::default()
                    };
                    let floor = if is_lit { "bright" } else { "dark" };
                    let name = format!(
                        "{thickness_mm} mm thick, tilted by {tilt_deg}°, rims {rim_mm} mm, {floor} floor"
                    );
                    all.push((name, setting));
                }
            }
        }
    }
    all
}

/// What is not there, and the plate without it.
fn closed(open: &Plate, at: usize) -> (String, Plate) {
    let mut plate = open.clone();
    let name = match at {
        0..=3 => {
            plate.defects = vec![Defect::MissingHole { index: at }];
            format!("hole {}", at + 1)
        }
        4 => {
            plate.slots.clear();
            "slot".to_owned()
        }
        _ => {
            // The sheet goes on beyond the edge.
            plate.width += 16.0;
            "edge".to_owned()
        }
    };
    (name, plate)
}

/// Measures plates that lack something and whole ones, so many of each in each setting.
fn are_absent(settings: Vec<(String, Setting)>, parts: usize) {
    let (mut count, mut left_out, mut invalid) = (0, 0, 0);
    let mut wrong = Vec::new();
    for (name, setting) in settings {
        let mut line = Line::new(&setting);
        let mut random = Random::new(9);
        for part in 0..parts {
            let lies = setting.placement((part > 0).then_some(&mut random));
            let (missing, plate) = closed(&setting.plate, part % 6);
            let whole = line.inspect(setting.plate.clone(), &lies);
            invalid += usize::from(whole.verdict() == Verdict::Invalid);
            if whole.verdict() == Verdict::Fail {
                wrong.push(format!("{name}: a whole plate fails: {:?}", whole.reason));
            }
            if !line.features.contains(&missing) {
                left_out += 1;
                continue;
            }
            let found = line.inspect(plate, &lies);
            count += 1;
            let of_missing = |of: &[String]| of.contains(&missing);
            let mut gauges = line.gauges.iter().zip(&found.gauges);
            let is_absent =
                gauges.any(|((gauge, _), found)| of_missing(&gauge.of) && found.decision.absent);
            if found.verdict() != Verdict::Fail || !is_absent {
                wrong.push(format!(
                    "{name}: without {missing} {:?}: {:?}",
                    found.verdict(),
                    found.reason
                ));
            }
        }
    }
    println!(
        "{count} parts lack something, {} verdicts are wrong; {left_out} are not shown by golden, {invalid} whole ones are INVALID",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn what_a_sheet_lacks_is_absent_whatever_its_thickness_tilt_and_floor() {
    are_absent(settings(&[1.5], &[5.0], &[0.0]), 6);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn three_hundred_sheets_that_lack_something_fail_and_whole_ones_do_not() {
    are_absent(
        settings(&[0.0, 0.5, 1.5, 3.0], &[0.0, 5.0, 10.0], &[0.0, 0.2]),
        7,
    );
}
