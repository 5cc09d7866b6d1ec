//! Parts that lie on a floor: what is taught of them is the part alone.

use crate::gauges::plan;
use crate::limits::cycle;
use crate::placement::{Bed, bed, taught};
use appliance::recipe::plan::Plan;
use appliance::station::{Inspection, Verdict};
use sim::parts::{Defect, Plate, SheetMetal};
use sim::{Ground, Part, Placement, Scenario, Stage};
use tests::random::Random;

/// The limit that every teach asks for, ± mm.
const ASKED_MM: f64 = 0.15;
/// Placements of good parts, in the long form and in the quick one.
const PLACEMENTS: usize = 6;
const FEW_PLACEMENTS: usize = 2;

const GREY: Ground = Ground {
    albedo: 0.35,
    depth_mm: 20.0,
    tilt_deg: [0.0; 2],
};
/// A sheet of 1 mm lies on it.
const TOUCHED: Ground = Ground {
    depth_mm: 0.0,
    ..GREY
};
const WHITE: Ground = Ground {
    albedo: 1.0,
    depth_mm: 18.0,
    tilt_deg: [0.0; 2],
};

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
        let mut bed = bed(&scenario(part, floor));
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
        let mut line = Line::new(&plate(), *floor);
        line.good_parts_pass(placements);
        line.defects_fail(&[DENT, Defect::MissingHole { index: 0 }]);
    }
}

#[test]
fn a_plate_over_a_floor_keeps_its_limit_and_is_judged_right() {
    is_judged_right(&[Some(GREY)], FEW_PLACEMENTS);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn a_plate_over_any_floor_keeps_its_limit_and_is_judged_right() {
    let floors = [None, Some(GREY), Some(WHITE), Some(TOUCHED)];
    is_judged_right(&floors, PLACEMENTS);
}

/// Fails if verdicts are others where the floor is one of these, and not the grey one that was taught.
fn verdicts_stay(floors: &[Option<Ground>]) {
    let mut line = Line::new(&plate(), Some(GREY));
    for floor in floors {
        line = line.moved_to(*floor);
        line.good_parts_pass(FEW_PLACEMENTS);
        line.defects_fail(&[DENT, Defect::MissingHole { index: 0 }]);
    }
    let nothing = line.judge(&Part::Empty {}, &Placement::default());
    assert_ne!(nothing.verdict(), Verdict::Pass, "{nothing:#?}");
}

const LOWER: Ground = Ground {
    depth_mm: 21.0,
    tilt_deg: [1.0, -1.0],
    ..GREY
};

#[test]
fn a_floor_that_is_lower_and_tilted_changes_no_verdict() {
    verdicts_stay(&[Some(LOWER)]);
}

#[test]
#[ignore = "takes a minute: `.ci/run full`"]
fn what_the_floor_does_changes_no_verdict() {
    verdicts_stay(&[None, Some(WHITE), Some(LOWER)]);
}

#[test]
fn a_stamped_bracket_over_a_floor_is_judged_right() {
    let mut line = Line::new(&Part::SheetMetal(SheetMetal::default()), Some(GREY));
    line.good_parts_pass(FEW_PLACEMENTS);
    line.defects_fail(&[
        Defect::MissingHole { index: 0 },
        Defect::BentFlange { degrees: 3.0 },
    ]);
}

#[test]
fn the_floor_lies_below_the_part_that_is_put_there_and_not_below_the_first_one() {
    let small = |part: &Part| {
        let mut scenario = scenario(part, Some(GREY));
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
