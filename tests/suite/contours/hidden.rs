//! What the camera does not see of a plate is unseen: never absent, never a value that is off by more
//! than it says.

use super::line::Line;
use super::plates::{Setting, Z_MM};
use crate::gauges::frames;
use crate::placement::bed;
use crate::two_frames::{samples, with_left};
use algo::inspect::State;
use appliance::station::{Inspection, Verdict};
use sim::parts::{Hole, Joggle, Plate};
use sim::{Part, Placement};
use std::time::Instant;

/// A large sheet without holes, so far above the plate.
const HAND_MM: f64 = 40.0;

/// Fails if a gauge is off by more than its uncertainty, or a hole is taken for closed. The names of
/// the features that are unseen.
fn unseen(line: &Line, found: &Inspection) -> Vec<String> {
    for ((gauge, truth), found) in line.gauges.iter().zip(&found.gauges) {
        assert!(!found.decision.absent, "{} {found:?}", gauge.name);
        if let (Some(value), Some(u)) = (found.value, found.uncertainty) {
            let off = (value - truth).abs();
            assert!(off <= u.max(0.03), "{}: {off} of U {u}", gauge.name);
        }
    }
    let unseen = found.features.iter().filter(|of| {
        assert_ne!(of.state, State::Absent);
        of.state == State::Unseen
    });
    unseen.map(|of| line.features[of.feature].clone()).collect()
}

fn names_one(found: &Inspection, names: &[String]) -> bool {
    let reason = found.reason.clone().unwrap_or_default();
    names.iter().any(|name| reason.contains(name.as_str()))
}

#[test]
fn holes_under_a_hand_are_unseen() {
    let setting = Setting::default();
    let mut line = Line::new(&setting);
    let hand = Plate {
        z: Z_MM + HAND_MM,
        width: 400.0,
        height: 400.0,
        holes: Vec::new(),
        slots: Vec::new(),
        ..Plate::default()
    };
    let mut other = bed(&Setting {
        plate: hand,
        ..setting
    }
    .scenario());
    let patterns = line.plan.rasters(&line.bed.calibration).unwrap();
    other.head.load(patterns).unwrap();
    let hand: Vec<Vec<u8>> = frames(&mut other, &line.plan, 0)
        .iter()
        .map(samples)
        .collect();
    let part = Part::Plate(line.setting.plate.clone());
    line.bed.stage.place(&part, &Placement::default()).unwrap();
    let plain = frames(&mut line.bed, &line.plan, 0);
    let covered: Vec<_> = plain
        .iter()
        .zip(&hand)
        .map(|(frame, hand)| with_left(frame, |place, _| hand[place]))
        .collect();
    let found = line.plan.inspect(0, &covered, Instant::now());
    let unseen = unseen(&line, &found);
    assert_eq!(found.verdict(), Verdict::Invalid);
    for name in ["hole 1", "hole 3", "edge"] {
        assert!(unseen.iter().any(|of| of == name), "{name}: {unseen:?}");
    }
    println!("{:?}", found.reason);
}

#[test]
fn a_hole_that_lies_outside_of_the_frame_is_unseen() {
    let mut line = Line::new(&Setting::default());
    // Half of hole 1 lies beyond the frame's border then.
    for shift in [20.0, 28.0, 36.0, 44.0] {
        let lies = Placement {
            shift_mm: [-shift, 0.0, 0.0],
            ..Placement::default()
        };
        let found = line.inspect(line.setting.plate.clone(), &lies);
        let unseen = unseen(&line, &found);
        println!("{shift}: {:?} {unseen:?}", found.reason);
        if !unseen.is_empty() {
            assert_eq!(found.verdict(), Verdict::Invalid);
            assert!(found.reason.is_some());
        }
    }
}

#[test]
fn a_hole_in_the_shadow_of_a_step_is_unseen_or_as_true_as_it_says() {
    let mut plate = Setting::default().plate;
    plate.joggle = Some(Joggle {
        x: 40.0,
        drop: 3.0,
        run: 3.0,
    });
    plate.holes[1] = Hole {
        x: 60.0,
        y: 41.0,
        radius: 5.0,
    };
    let setting = Setting {
        plate,
        ..Setting::default()
    };
    let mut line = Line::new(&setting);
    let _ = &mut line;
    for x in [45.0, 50.0, 55.0] {
        let mut deeper = setting.plate.clone();
        deeper.joggle = Some(Joggle {
            x,
            drop: 3.0,
            run: 0.0,
        });
        let found = line.inspect(deeper, &Placement::default());
        println!("{x}: {:?}", found.reason);
        let unseen = unseen(&line, &found);
        if !unseen.is_empty() {
            assert!(names_one(&found, &unseen), "{:?} {unseen:?}", found.reason);
        }
    }
}
