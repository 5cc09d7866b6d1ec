//! Parts on the stage: defects, placements, and light transports that are kept.

use super::{PATIENT, all_parts, counts, small};
use crate::parts::{Defect, Plane, SheetMetal};
use crate::{Material, Part, Placement, Scenario, Stage, head};
use hal::head::Head;
use hal::projector::Raster;
use std::sync::Arc;

/// Pixels whose truth is not NaN, and the largest difference of truth from the good part.
fn against_good(stage: &Stage, defects: Vec<Defect>) -> (usize, f32) {
    let seen = |z: &[f32]| z.iter().filter(|z| !z.is_nan()).count();
    stage
        .place(&Part::default(), &Placement::default())
        .unwrap();
    let good = stage.truth().height;
    stage
        .place(
            &Part::SheetMetal(SheetMetal {
                defects,
                ..Default::default()
            }),
            &Placement::default(),
        )
        .unwrap();
    let bad = stage.truth().height;
    let differences = good
        .iter()
        .zip(&bad)
        .map(|(a, b)| (a - b).abs())
        .filter(|d| !d.is_nan());
    (
        seen(&bad).abs_diff(seen(&good)),
        differences.fold(0.0, f32::max),
    )
}

#[test]
fn each_defect_of_the_bracket_shows_in_the_truth() {
    let mut scenario = Scenario {
        sub_rays: 1,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
    let (_, stage) = head(&scenario).unwrap();
    let truth = stage.truth();
    let seen = truth.height.iter().filter(|z| !z.is_nan()).count();
    assert!(
        seen > 128 * 128 * 3 / 10,
        "the bracket fills a good part of the picture: {seen}"
    );
    assert!(
        truth
            .height
            .iter()
            .filter(|z| !z.is_nan())
            .all(|z| z.abs() < 40.0)
    );
    let edge = |at: usize| [0, 127].contains(&(at / 128)) || [0, 127].contains(&(at % 128));
    assert!(
        truth
            .height
            .iter()
            .enumerate()
            .all(|(at, z)| z.is_nan() || !edge(at)),
        "it lies inside the picture"
    );

    let dent = Defect::Dent {
        x: 10.0,
        y: -8.0,
        depth_mm: 1.5,
        diameter_mm: 18.0,
    };
    let (_, depth) = against_good(&stage, vec![dent]);
    assert!((depth - 1.5).abs() < 0.1, "{depth}");
    let (more, _) = against_good(&stage, vec![Defect::MissingHole { index: 2 }]);
    assert!(more > 60, "a hole of 11 mm radius is {more} pixels");
    let (_, bend) = against_good(&stage, vec![Defect::BentFlange { degrees: 8.0 }]);
    assert!(bend > 2.0, "{bend}");
    assert_eq!(against_good(&stage, vec![]).1, 0.0);
}

#[test]
fn a_placed_part_is_shifted_and_turned_as_its_placement_says() {
    let (_, stage) = head(&small(Part::Plane(Plane::default()))).unwrap();
    let part = Part::Plane(Plane::default());
    stage
        .place(
            &part,
            &Placement {
                shift_mm: [3.0, 1.0, 7.5],
                ..Placement::default()
            },
        )
        .unwrap();
    assert!(stage.truth().height.iter().all(|z| (z - 7.5).abs() < 1e-4));
    // Tilted about x, +y goes up; +y is up in the picture too, so its first row is higher than its
    // last.
    stage
        .place(
            &part,
            &Placement {
                tilt_deg: [5.0, 0.0],
                ..Placement::default()
            },
        )
        .unwrap();
    let tilted = stage.truth().height;
    assert!(
        tilted[32] > 3.0 && tilted[47 * 64 + 32] < -3.0,
        "{} {}",
        tilted[32],
        tilted[47 * 64 + 32]
    );
    // Tilted about y, +x goes down.
    stage
        .place(
            &part,
            &Placement {
                tilt_deg: [0.0, 5.0],
                ..Placement::default()
            },
        )
        .unwrap();
    let tilted = stage.truth().height;
    assert!(tilted[24 * 64] > 3.0 && tilted[24 * 64 + 63] < -3.0);
    assert!(
        stage
            .place(
                &part,
                &Placement {
                    rotation_deg: f64::NAN,
                    ..Placement::default()
                }
            )
            .is_err()
    );
}

#[test]
fn going_back_to_a_placed_part_costs_nothing() {
    let (_, stage) = head(&small(Part::default())).unwrap();
    let built = std::sync::atomic::AtomicU32::new(0);
    let count = |_: f64| {
        built.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    for _ in 0..5 {
        for material in [None, Some(Material::Oiled)] {
            for part in all_parts().iter().skip(1).take(2) {
                stage
                    .place_with_progress(part, material, &Placement::default(), &count)
                    .unwrap();
                assert_eq!(stage.placed().1, material);
            }
        }
    }
    assert_eq!(
        built.into_inner(),
        4 * 48,
        "each of two parts is traced once in either material, row by row"
    );
}

#[test]
fn a_part_that_is_placed_without_a_word_on_its_material_is_of_the_scenarios() {
    let scenario = Scenario {
        material: Some(Material::RolledSteel),
        ..small(Part::default())
    };
    let (_, stage) = head(&scenario).unwrap();
    assert_eq!(stage.placed().1, scenario.material);
    stage
        .place(&Part::Plane(Plane::default()), &Placement::default())
        .unwrap();
    assert_eq!(stage.placed().1, scenario.material);
}

#[test]
fn a_stage_can_be_shared_between_threads() {
    fn shared<T: Send + Sync + Clone>() {}
    shared::<Stage>();
}

#[test]
fn a_frame_shows_the_part_and_the_patterns_that_are_there_whatever_was_shown_before() {
    let scenario = small(Part::default());
    let other = (Part::Plane(Plane::default()), Placement::default());
    let load = |head: &mut Head, greys: &[u8]| {
        let (width, height) = head.projector_size();
        let rasters = greys
            .iter()
            .map(|grey| Raster::uniform(width, height, *grey));
        head.load(rasters.map(Result::unwrap).collect()).unwrap();
    };
    let shown = |head: &mut Head| {
        let mut frames = Vec::new();
        let mut keep = |_, frame| frames.push(counts(&frame));
        head.acquire(&[0, 1, 0, 1], PATIENT, &mut keep).unwrap();
        frames
    };
    // What a new head sees, that has exposed as many frames.
    let fresh = |part: &Part, greys: &[u8], exposed: usize| {
        let (mut head, stage) = head(&scenario).unwrap();
        load(&mut head, &[0, 0]);
        (0..exposed).for_each(|_| drop(shown(&mut head)));
        stage.place(part, &Placement::default()).unwrap();
        load(&mut head, greys);
        shown(&mut head)
    };
    let (mut head, stage) = head(&scenario).unwrap();
    load(&mut head, &[200, 50]);
    assert_eq!(shown(&mut head), fresh(&scenario.part, &[200, 50], 0));
    assert_eq!(shown(&mut head), fresh(&scenario.part, &[200, 50], 1));
    load(&mut head, &[200, 120]);
    assert_eq!(shown(&mut head), fresh(&scenario.part, &[200, 120], 2));
    stage.place(&other.0, &other.1).unwrap();
    assert_eq!(shown(&mut head), fresh(&other.0, &[200, 120], 3));
    head.aside(1, Arc::new(|| true), |head| {
        load(head, &[90]);
        let mut seen = Vec::new();
        let mut keep = |_, frame| seen.push(counts(&frame));
        head.acquire(&[0], PATIENT, &mut keep).unwrap();
        assert_eq!(seen.len(), 1);
    });
    stage.reseed(scenario.noise.seed);
    let [_, again, ..] = &shown(&mut head)[..] else {
        panic!("four frames");
    };
    assert_eq!(*again, fresh(&other.0, &[200, 90], 0)[1]);
}
