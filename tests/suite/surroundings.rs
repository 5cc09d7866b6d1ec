//! Parts that lie on a floor: what is taught of them is the part alone.

use crate::every_part;
use crate::gauges::plan;
use crate::limits::cycle;
use crate::placement::{Bed, TIMEOUT, bed, naming, one_click, taught, taught_asking};
use algo::inspect::FeatureKind;
use appliance::recipe::FeatureFile;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::golden::Naming;
use appliance::recipe::teach::teach;
use appliance::station::{Inspection, Verdict};
use appliance::system::headway::Headway;
use sim::parts::{Across, Defect, Joint, Plate, SheetMetal};
use sim::{Clamp, Ground, Part, Pin, Placement, Scenario, Stage};
use tests::random::Random;

/// The limit that every teach asks for, ± mm.
const ASKED_MM: f64 = 0.15;
/// Placements of good parts, in the long form and in the quick one.
const PLACEMENTS: usize = 6;
const FEW_PLACEMENTS: usize = 2;

/// The floor of the stock scenes.
fn grey() -> Ground {
    Ground::default()
}

/// A sheet of 1 mm lies on it.
fn touched() -> Ground {
    Ground {
        depth_mm: 0.0,
        ..grey()
    }
}

fn white() -> Ground {
    Ground {
        albedo: 1.0,
        depth_mm: 18.0,
        ..grey()
    }
}

pub(crate) fn plate() -> Part {
    Part::Plate(Plate {
        thickness_mm: 1.0,
        ..Plate::default()
    })
}

pub(crate) fn scenario(part: &Part, floor: Option<Ground>) -> Scenario {
    Scenario {
        part: part.clone(),
        floor,
        sub_rays: 2,
        ..Scenario::default()
    }
}

/// A part that was taught on a floor, or on none.
struct Line {
    bed: Bed,
    plan: Plan,
    part: Part,
}

impl Line {
    fn new(part: &Part, floor: Option<Ground>) -> Self {
        let mut bed = bed(&scenario(part, floor.clone()));
        let taught = taught(&mut bed).unwrap();
        println!("{floor:?}: {:#?}", taught.choice.reasons);
        assert_eq!(taught.manifest.gauges[0].high, Some(ASKED_MM), "{floor:?}");
        let plan = plan(&bed, &taught.manifest, &taught.recipe.arrays);
        let part = part.clone();
        Self { bed, plan, part }
    }

    /// The same recipe on another floor.
    fn moved_to(mut self, floor: Option<Ground>) -> Self {
        self.bed = bed(&scenario(&self.part, floor));
        self
    }

    fn judge(&mut self, part: &Part, placement: &Placement) -> Inspection {
        self.bed.stage.place(part, placement).unwrap();
        let rasters = self.plan.rasters(&self.bed.calibration).unwrap();
        self.bed.head.load(rasters).unwrap();
        cycle(&mut self.bed, &self.plan)
    }

    /// Fails unless good parts pass wherever they lie.
    fn good_parts_pass(&mut self, placements: usize) {
        let (part, mut random) = (self.part.clone(), Random::new(3));
        for at in 0..placements {
            let mut between = |reach: f64| reach * (2.0 * random.share() - 1.0);
            let lies = Placement {
                shift_mm: [between(0.4), between(0.4), between(0.3)],
                tilt_deg: [between(0.15), between(0.15)],
                rotation_deg: between(0.15),
            };
            let found = self.judge(&part, &lies);
            assert_eq!(found.verdict(), Verdict::Pass, "{at}: {found:#?}");
        }
    }

    /// Fails if one of these parts passes.
    fn defects_fail(&mut self, defects: &[Defect]) {
        for defect in defects {
            let mut part = self.part.clone();
            part.defects_mut().unwrap().push(*defect);
            let found = self.judge(&part, &Placement::default());
            assert_eq!(found.verdict(), Verdict::Fail, "{defect:?}: {found:#?}");
        }
    }
}

const DENT: Defect = Defect::Dent {
    x: -20.0,
    y: 10.0,
    depth_mm: 0.3,
    diameter_mm: 8.0,
};

/// Fails if a plate over one of these floors is taught with another limit or judged wrong.
fn is_judged_right(floors: &[Option<Ground>], placements: usize) {
    for floor in floors {
        let mut line = Line::new(&plate(), floor.clone());
        line.good_parts_pass(placements);
        line.defects_fail(&[DENT, Defect::MissingHole { index: 0 }]);
    }
}

#[test]
fn a_plate_over_a_floor_keeps_its_limit_and_is_judged_right() {
    is_judged_right(&[Some(grey())], FEW_PLACEMENTS);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_plate_over_any_floor_keeps_its_limit_and_is_judged_right() {
    let floors = [None, Some(grey()), Some(white()), Some(touched())];
    is_judged_right(&floors, PLACEMENTS);
}

/// Fails if verdicts are others where the floor is one of these, and not the grey one that was taught.
fn verdicts_stay(floors: &[Option<Ground>]) {
    let mut line = Line::new(&plate(), Some(grey()));
    for floor in floors {
        line = line.moved_to(floor.clone());
        line.good_parts_pass(FEW_PLACEMENTS);
        line.defects_fail(&[DENT, Defect::MissingHole { index: 0 }]);
    }
    let nothing = line.judge(&Part::Empty {}, &Placement::default());
    assert_ne!(nothing.verdict(), Verdict::Pass, "{nothing:#?}");
}

fn lower() -> Ground {
    Ground {
        depth_mm: 21.0,
        tilt_deg: [1.0, -1.0],
        ..grey()
    }
}

#[test]
fn a_floor_that_is_lower_and_tilted_changes_no_verdict() {
    verdicts_stay(&[Some(lower())]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn what_the_floor_does_changes_no_verdict() {
    verdicts_stay(&[None, Some(white()), Some(lower())]);
}

#[test]
fn a_stamped_bracket_over_a_floor_is_judged_right() {
    let mut line = Line::new(&Part::SheetMetal(SheetMetal::default()), Some(grey()));
    line.good_parts_pass(FEW_PLACEMENTS);
    line.defects_fail(&[
        Defect::MissingHole { index: 0 },
        Defect::BentFlange { degrees: 3.0 },
    ]);
}

/// Openings that teaching finds to be round, and to be slots, by their rims.
fn rims(part: &Part, floor: Option<Ground>) -> [usize; 2] {
    let mut bed = bed(&Scenario {
        part: part.clone(),
        floor,
        ..Scenario::default()
    });
    let (head, calibration) = (&mut bed.head, &bed.calibration);
    let taught = teach(head, calibration, &naming(1.0), TIMEOUT, Headway::silent());
    let taught = taught.unwrap().with_rims(Headway::silent()).unwrap();
    let features = &taught.manifest.features;
    [FeatureKind::Circle, FeatureKind::Slot].map(|kind| {
        let is_it = |of: &&FeatureFile| of.kind == kind;
        features.iter().filter(is_it).count()
    })
}

#[test]
fn round_openings_and_slots_over_a_floor_are_found_by_their_rims() {
    assert_eq!(rims(&plate(), Some(grey())), [3, 1]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn round_openings_of_a_bracket_over_a_floor_are_found_by_their_rims() {
    // Those of the bracket's small holes are disturbed by what other openings light.
    let bracket = Part::SheetMetal(SheetMetal::default());
    assert!(rims(&bracket, Some(grey()))[0] >= 1);
}

#[test]
fn a_floor_that_is_taken_for_the_part_is_refused_by_its_place_and_opens_no_limit() {
    let mut bed = bed(&scenario(&plate(), Some(grey())));
    let naming = Naming {
        everything: true,
        ..naming(1.0)
    };
    let refused = taught_asking(&mut bed, &naming).err().unwrap();
    for words in [
        "would not keep the limit of deviation, ±0.15 mm",
        "about column",
        "choose the limit",
    ] {
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn the_floor_lies_below_the_part_that_is_put_there_and_not_below_the_first_one() {
    let small = |part: &Part| {
        let mut scenario = scenario(part, Some(grey()));
        (scenario.rig.camera.width, scenario.rig.camera.height) = (64, 64);
        scenario
    };
    let (_head, stage) = sim::head(&small(&plate())).unwrap();
    let bits = |stage: &Stage| {
        stage
            .truth()
            .height
            .iter()
            .map(|z| z.to_bits())
            .collect::<Vec<_>>()
    };
    for part in Part::stock()
        .into_iter()
        .filter(|part| *part != (Part::Empty {}))
    {
        stage.place(&part, &Placement::default()).unwrap();
        let (_head, own) = sim::head(&small(&part)).unwrap();
        assert_eq!(bits(&stage), bits(&own), "{part:?}");
    }
}

/// The surroundings of the ensemble, by name.
pub(crate) fn everywhere() -> Vec<(&'static str, Option<Ground>)> {
    let at = |depth_mm| Some(Ground { depth_mm, ..grey() });
    let pin = |x, y| Pin {
        x,
        y,
        diameter_mm: 8.0,
        height_mm: 24.0,
    };
    let clamp = Clamp {
        low: [-100.0, -15.0, -5.0],
        high: [-82.0, 5.0, 20.0],
    };
    vec![
        ("black", None),
        ("touched", at(0.0)),
        ("grey 5", at(5.0)),
        ("grey 9.6", at(9.6)),
        ("grey 20", at(20.0)),
        ("grey 35", at(35.0)),
        ("grey 40", at(40.0)),
        ("white 18", Some(white())),
        (
            "print",
            Some(Ground {
                print_mm: 12.0,
                ..grey()
            }),
        ),
        (
            "pins",
            Some(Ground {
                pins: vec![pin(-80.0, 35.0), pin(-80.0, -35.0), pin(0.0, -60.0)],
                clamps: vec![clamp],
                ..grey()
            }),
        ),
        (
            "next",
            Some(Ground {
                next_mm: Some([165.0, 0.0]),
                ..grey()
            }),
        ),
    ]
}

/// Stock parts that leave no room for others in the picture.
const FILL: [&str; 7] = [
    "flowerpot",
    "cone",
    "sawtooth",
    "sphere",
    "spline",
    "face",
    "plane",
];

/// The stock parts, a plate and both joints.
fn parts() -> Vec<(String, Part)> {
    let mut parts = every_part::stock();
    parts.push(("plate".into(), plate()));
    for across in [Across::X, Across::Y] {
        let joint = Part::Joint(Joint {
            across,
            ..Joint::default()
        });
        parts.push((format!("joint {across:?}"), joint));
    }
    parts
}

/// What became of a part in some surroundings.
struct Judged {
    scene: String,
    /// Why it was not taught.
    refused: Option<String>,
    fails: usize,
    invalid: usize,
}

/// Teaches a part in these surroundings and judges it, good, at so many places within the tolerance.
fn judged(
    (name, floor): (&str, Option<Ground>),
    kind: &str,
    part: &Part,
    placements: usize,
) -> Judged {
    let mut found = Judged {
        scene: format!("{kind}, {name}"),
        refused: None,
        fails: 0,
        invalid: 0,
    };
    let mut bed = bed(&scenario(part, floor));
    match one_click(&mut bed) {
        Ok(taught) => {
            assert_eq!(
                taught.manifest.gauges[0].high,
                Some(ASKED_MM),
                "{}",
                found.scene
            );
            let mut line = every_part::Line::of(bed, taught.recipe, ASKED_MM, part.clone());
            let mut random = Random::new(5);
            for _ in 0..placements {
                let placement = line.placement(&mut random);
                let judged = line.judge(&placement);
                let verdict = judged.verdict();
                if verdict != Verdict::Pass {
                    println!("{}: {verdict:?}, {:?}", found.scene, judged.reason);
                }
                found.fails += usize::from(verdict == Verdict::Fail);
                found.invalid += usize::from(verdict == Verdict::Invalid);
            }
        }
        Err(words) => found.refused = Some(words),
    }
    let Judged {
        scene,
        refused,
        fails,
        invalid,
    } = &found;
    println!("{scene}: {fails} FAIL, {invalid} INVALID of {placements}; refused: {refused:?}");
    found
}

#[test]
fn a_plate_among_pins_is_judged_right() {
    is_right_in(&["pins"]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn a_plate_on_a_print_and_beside_the_next_one_is_judged_right() {
    is_right_in(&["print", "next"]);
}

/// Fails if a plate in these surroundings is refused or judged wrong.
fn is_right_in(names: &[&str]) {
    for (name, floor) in everywhere() {
        if names.contains(&name) {
            let found = judged((name, floor), "plate", &plate(), FEW_PLACEMENTS);
            assert_eq!(
                (found.refused, found.fails, found.invalid),
                (None, 0, 0),
                "{name}"
            );
        }
    }
}

#[test]
#[ignore = "takes an hour: `.ci/run full`"]
fn every_part_is_taught_and_judged_right_in_all_surroundings() {
    let mut all = Vec::new();
    for (name, floor) in everywhere() {
        for (kind, part) in parts() {
            let has_room = !FILL.contains(&&*kind);
            // A sheet without thickness that its floor touches is that floor.
            let is_floor = name == "touched" && kind == "plane";
            if !is_floor && (has_room || !["pins", "next"].contains(&name)) {
                all.push(judged((name, floor.clone()), &kind, &part, 2 * PLACEMENTS));
            }
        }
    }
    let count = |of: fn(&Judged) -> usize| all.iter().map(of).sum::<usize>();
    let placements = 2 * PLACEMENTS * all.len();
    let refused = count(|of| usize::from(of.refused.is_some()));
    let (fails, invalid) = (count(|of| of.fails), count(|of| of.invalid));
    println!(
        "{} scenes: {refused} refused, {fails} FAIL, {invalid} INVALID of {placements}",
        all.len()
    );
    assert!(refused <= 1 && fails == 0 && 100 * invalid <= placements);
}
