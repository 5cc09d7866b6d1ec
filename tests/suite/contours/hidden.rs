//! What the camera does not see of a plate is unseen: never absent, never a value that is off by more
//! than it says.

use super::line::Line;
use super::plates::{Setting, Z_MM};
use crate::gauges::frames;
use crate::placement::bed;
use crate::two_frames::{samples, with_left};
use algo::inspect::State;
use appliance::station::{Inspection, Verdict};
use sim::parts::Plate;
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
    let reason = found.reason.as_deref().unwrap_or_default();
    for name in ["hole 1", "hole 3", "edge"] {
        assert!(unseen.iter().any(|of| of == name), "{name}: {unseen:?}");
        assert!(reason.contains(name), "{name}: {reason}");
    }
}

#[test]
fn a_plate_that_lies_partly_beside_the_frame_is_invalid_and_no_hole_is_absent() {
    let (mut line, mut most) = (Line::new(&Setting::default()), 0);
    for shift in [28.0, 44.0, 60.0] {
        let lies = Placement {
            shift_mm: [-shift, 0.0, 0.0],
            ..Placement::default()
        };
        let found = line.inspect(line.setting.plate.clone(), &lies);
        let unseen = unseen(&line, &found);
        assert_eq!(found.verdict(), Verdict::Invalid, "{shift}: {unseen:?}");
        let reason = found.reason.as_deref().unwrap_or_default();
        for name in &unseen {
            assert!(reason.contains(name.as_str()), "{name}: {reason}");
        }
        most = most.max(unseen.len());
    }
    assert!(most > 0);
}
