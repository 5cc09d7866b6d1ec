//! Parts that lie on a floor: what is taught of them is the part alone.

use crate::every_part;
use crate::gauges::plan;
use crate::limits::cycle;
use crate::placement::{Bed, bed, naming, taught, taught_asking};
use appliance::recipe::golden::Naming;
use appliance::recipe::plan::Plan;
use appliance::station::{Inspection, Verdict};
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

fn plate() -> Part {
    Part::Plate(Plate {
        thickness_mm: 1.0,
        ..Plate::default()
    })
}

fn scenario(part: &Part, floor: Option<Ground>) -> Scenario {
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
fn everywhere() -> Vec<(&'static str, Option<Ground>)> {
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

#[test]
#[ignore = "takes an hour: `.ci/run full`"]
fn every_part_is_taught_and_judged_right_in_all_surroundings() {
    let (mut refused, mut invalid, mut judged) = (0, 0, 0);
    let mut wrong = Vec::new();
    let only = std::env::var("ONLY").unwrap_or_default();
    for (name, floor) in everywhere() {
        if !only.is_empty() && !name.contains(&only) {
            continue;
        }
        for (kind, part) in parts() {
            if ["pins", "next"].contains(&name) && FILL.contains(&&*kind) {
                continue;
            }
            if !std::env::var("KIND").unwrap_or_default().is_empty()
                && !kind.contains(&std::env::var("KIND").unwrap())
            {
                continue;
            }
            let mut bed = bed(&scenario(&part, floor.clone()));
            let taught = match taught(&mut bed) {
                Ok(taught) => taught,
                Err(words) => {
                    println!("{name}, {kind}: refused: {words}");
                    refused += 1;
                    continue;
                }
            };
            let limit = taught.manifest.gauges[0].high;
            let words: Vec<_> = taught
                .choice
                .reasons
                .iter()
                .filter(|words| words.contains("the picture"))
                .collect();
            let mut line = every_part::Line::of(bed, taught.recipe, limit.unwrap(), part);
            let mut random = Random::new(5);
            let (mut fails, mut invalids) = (0, 0);
            for _ in 0..if floor == Some(grey()) || floor.is_none() {
                6
            } else {
                3
            } {
                let placement = line.placement(&mut random);
                let found = line.judge(&placement);
                if !std::env::var("KIND").unwrap_or_default().is_empty() {
                    println!("{placement:?} found {:?}", found.placement);
                }
                judged += 1;
                match found.verdict() {
                    Verdict::Pass => {}
                    Verdict::Invalid => {
                        invalids += 1;
                        println!("  INVALID {:?}", found.reason)
                    }
                    _ => {
                        fails += 1;
                        println!(
                            "  FAIL {:?} {:?}",
                            found.reason,
                            found
                                .gauges
                                .iter()
                                .map(|g| (g.value, g.uncertainty))
                                .collect::<Vec<_>>()
                        )
                    }
                }
            }
            println!(
                "{name}, {kind}: limit {limit:?}, {fails} FAIL, {invalids} INVALID, {words:?}"
            );
            invalid += invalids;
            if fails > 0 || limit != Some(ASKED_MM) {
                wrong.push(format!("{name}, {kind}: limit {limit:?}, {fails} FAIL"));
            }
        }
    }
    println!("{refused} refused, {invalid} of {judged} INVALID");
    assert!(wrong.is_empty(), "{wrong:#?}");
}
