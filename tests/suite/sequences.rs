//! The sequences of a recipe: which ones a part is measured with, and which frames belong to which.

use crate::gauges::{frames, inspect, plan};
use crate::placement::{Bed, bed, scenario, taught};
use algo::pattern::Shot;
use appliance::recipe::RecipeFile;
use appliance::station::{Inspection, Verdict};
use sim::parts::Cone;
use sim::{Part, Placement};
use std::time::Instant;

#[test]
fn the_shortest_sequence_will_do_for_a_part_in_place_and_not_for_one_out_of_it() {
    let part = Part::Cone(Cone::default());
    let mut bed = bed(&scenario(part.clone()));
    let taught = taught(&mut bed).unwrap();
    let file = RecipeFile {
        production: 0,
        ..taught.manifest.clone()
    };
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    assert_eq!(plan.sequence_count(), 3);
    let counts: Vec<usize> = (0..3)
        .map(|sequence| plan.indices(sequence).len())
        .collect();
    assert_eq!(counts, [3, 6, 12]);
    let place = |bed: &Bed, z: f64| {
        let placement = Placement {
            shift_mm: [0.0, 0.0, z],
            ..Placement::default()
        };
        bed.stage.place(&part, &placement).unwrap();
    };
    let flags = |found: &Inspection| found.flags & 0b1110;
    place(&bed, 0.3);
    let found: Vec<Inspection> = (0..3)
        .map(|sequence| inspect(&mut bed, &plan, sequence))
        .collect();
    assert_eq!(
        [0, 1, 2].map(|sequence| flags(&found[sequence])),
        [0b10, 0b100, 0b1000]
    );
    let z = |found: &Inspection| found.placement.unwrap().values[2].unwrap();
    for found in &found[1..] {
        assert_eq!(found.step_up, None);
        assert!((z(found) - 0.3).abs() < 0.02, "{}", z(found));
    }
    // Beyond the tolerance short sequences may be wrong. The full one measures the displacement,
    // and is the last.
    place(&bed, 2.0);
    let short = inspect(&mut bed, &plan, 1);
    assert!(short.step_up.is_some());
    let full = inspect(&mut bed, &plan, 2);
    assert_eq!(full.step_up, None);
    assert!((z(&full) - 2.0).abs() < 0.05, "{}", z(&full));
    assert_eq!(full.verdict(), Verdict::Invalid);
}

#[test]
fn sequences_of_the_same_length_and_of_different_kinds_are_all_run() {
    let part = Part::Cone(Cone::default());
    let mut bed = bed(&scenario(part.clone()));
    let taught = taught(&mut bed).unwrap();
    let mut file = RecipeFile {
        production: 0,
        ..taught.manifest.clone()
    };
    // Its one level has as many shifts as the two levels of the next have together.
    file.sequences[0].frames = Shot::level(1.0, 6).collect();
    let plan = plan(&bed, &file, &taught.recipe.arrays);
    let counts: Vec<usize> = (0..plan.sequence_count())
        .map(|sequence| plan.indices(sequence).len())
        .collect();
    assert_eq!(counts, [6, 6, 12]);
    let flags: Vec<u16> = (0..3)
        .map(|sequence| inspect(&mut bed, &plan, sequence).flags & 0b1110)
        .collect();
    assert_eq!(flags, [0b10, 0b100, 0b1000]);
    for sequence in 0..3 {
        let shots: Vec<_> = plan.shots(sequence).collect();
        assert_eq!(plan.sequence_of(&shots), Some(sequence));
        let frames = frames(&mut bed, &plan, sequence);
        let layers = plan.layers(sequence, &frames).unwrap();
        let resolved = layers.height_mm.iter().filter(|z| !z.is_nan()).count();
        assert!(resolved > 5000, "sequence {sequence}: {resolved}");
    }
    // A recording names its frames, so a part that was judged with the second sequence is judged
    // with it again.
    let other: Vec<_> = Shot::level(1.0, 1).collect();
    assert_eq!(plan.sequence_of(&other), None);
    let none = plan.inspect(3, &[], Instant::now());
    assert_eq!((none.verdict(), none.error_code), (Verdict::Invalid, 103));
}
