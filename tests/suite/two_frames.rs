//! Parts that are measured with two frames, the fringe and its complement, wherever they lie within
//! 3 mm.

use super::gauges::frames;
use super::history::recording;
use super::placement::{Bed, bed, taught_within, with_two_frames};
use super::station_plc::{Daemon, Place, Plc, command, long};
use super::written::program;
use appliance::head::seam;
use appliance::recipe::plan::Plan;
use appliance::recipe::{Recipe, RecipeFile};
use appliance::station::{Inspection, Verdict};
use hal::frame::{Frame, Pixels};
use sim::parts::{Defect, SheetMetal, Sphere};
use sim::{Part, Placement, Scenario};
use std::sync::Arc;
use std::time::Instant;
use tests::random::Random;

/// Largest shift along x and y, mm, and largest turn about z, degrees.
const SHIFT_MM: f64 = 3.0;
const TURN_DEG: f64 = 0.5;
/// Of a corner of the part: both shifts and the turn together.
const TOLERANCE_MM: f64 = 5.5;
/// On the plate between bead, slot and the large hole.
const DENT: Defect = Defect::Dent {
    x: -20.0,
    y: 4.0,
    depth_mm: 0.3,
    diameter_mm: 8.0,
};

/// A head with a recipe whose cycles begin with two frames.
struct Line {
    bed: Bed,
    plan: Plan,
    random: Random,
}

/// A quarter of the default head's rays.
fn quick() -> Scenario {
    Scenario {
        sub_rays: 2,
        ..Scenario::default()
    }
}

fn bracket(defects: &[Defect]) -> Part {
    Part::SheetMetal(SheetMetal {
        defects: defects.to_vec(),
        ..SheetMetal::default()
    })
}

impl Line {
    fn new(scenario: &Scenario) -> Self {
        let mut bed = bed(scenario);
        let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
        let taught = with_two_frames(taught);
        let recipe = Recipe::from_bytes(&taught.bytes).unwrap();
        let plan = Plan::new(recipe, &bed.calibration, true).unwrap();
        assert_eq!(plan.indices(0).len(), 2);
        let rasters = plan.rasters(&bed.calibration).unwrap();
        bed.head.load(rasters).unwrap();
        let random = Random::new(1);
        Self { bed, plan, random }
    }

    fn placement(&mut self) -> Placement {
        let mut between = |reach: f64| reach * (2.0 * self.random.share() - 1.0);
        Placement {
            shift_mm: [between(SHIFT_MM), between(SHIFT_MM), 0.0],
            tilt_deg: [0.0; 2],
            rotation_deg: between(TURN_DEG),
        }
    }

    /// A pair of a part in a random placement.
    fn pair(&mut self, part: &Part) -> Vec<Frame> {
        let placement = self.placement();
        self.bed.stage.place(part, &placement).unwrap();
        frames(&mut self.bed, &self.plan, 0)
    }

    /// A cycle as the station runs it, of a part in a random placement; the second value is the
    /// sequence that it was judged by.
    fn cycle(&mut self, part: &Part) -> (Inspection, usize) {
        let placement = self.placement();
        self.bed.stage.place(part, &placement).unwrap();
        let mut sequence = 0;
        loop {
            let frames = frames(&mut self.bed, &self.plan, sequence);
            let inspection = self.plan.inspect(sequence, &frames, Instant::now());
            match inspection.step_up {
                Some(why) => println!("  {placement:?}: {why}"),
                None => return (inspection, sequence),
            }
            sequence += 1;
        }
    }
}

/// Judges parts in random placements. All verdicts must be right, and nine of ten without more
/// frames.
fn judge(line: &mut Line, part: &Part, expected: Verdict, count: usize) {
    let (mut right, mut by_two) = (0, 0);
    let mut values = Vec::new();
    for _ in 0..count {
        let (found, sequence) = line.cycle(part);
        right += usize::from(found.judged == expected);
        by_two += usize::from(sequence == 0);
        if found.judged != expected {
            println!("  wrong: {:?} {:?}", found.reason, found.gauges);
        }
        values.push(found.gauges[0].value.map_or(f64::NAN, f64::abs));
    }
    values.sort_by(f64::total_cmp);
    println!(
        "{expected:?}: {right} of {count} right, {by_two} by two frames, |deviation| {:.3} to {:.3} mm",
        values[0],
        values[count - 1]
    );
    assert_eq!(right, count, "{expected:?}");
    assert!(
        10 * by_two >= 9 * count,
        "{by_two} of {count} by two frames"
    );
}

#[test]
fn parts_anywhere_within_3_mm_are_judged_right_by_two_frames() {
    let mut line = Line::new(&quick());
    judge(&mut line, &bracket(&[]), Verdict::Pass, 10);
    judge(&mut line, &bracket(&[DENT]), Verdict::Fail, 5);
}

#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn fifty_dented_and_a_hundred_good_parts_within_3_mm_are_judged_right_by_two_frames() {
    let mut line = Line::new(&Scenario::default());
    judge(&mut line, &bracket(&[DENT]), Verdict::Fail, 50);
    judge(&mut line, &bracket(&[]), Verdict::Pass, 100);
}

#[test]
#[ignore = "takes ten minutes: `.ci/run full`"]
fn five_hundred_good_parts_within_3_mm_pass_by_two_frames() {
    let mut line = Line::new(&quick());
    judge(&mut line, &bracket(&[]), Verdict::Pass, 500);
}

#[test]
fn missing_holes_and_bent_flanges_fail_with_two_frames() {
    let mut line = Line::new(&quick());
    let missing = (0..3).map(|index| Defect::MissingHole { index });
    let bent = [-1.0, 1.0, 4.0].map(|degrees| Defect::BentFlange { degrees });
    for defect in missing.chain(bent) {
        let (found, sequence) = line.cycle(&bracket(&[defect]));
        println!("{defect:?}: {:?} by sequence {sequence}", found.judged);
        assert_eq!(
            found.judged,
            Verdict::Fail,
            "{defect:?}: {:?}",
            found.reason
        );
    }
}

/// The samples of a frame, row by row.
pub(crate) fn samples(frame: &Frame) -> Vec<u8> {
    let view = seam::view(frame).unwrap();
    let rows = (0..view.height()).map(|v| match view.row(v) {
        algo::frame::Samples::Eight(row) => row.to_vec(),
        algo::frame::Samples::Sixteen(_) => Vec::new(),
    });
    rows.flatten().collect()
}

/// A frame with other samples in its left half.
pub(crate) fn with_left(frame: &Frame, sample: impl Fn(usize, u8) -> u8) -> Frame {
    let view = seam::view(frame).unwrap();
    let (width, height) = (view.width(), view.height());
    let mut samples = Vec::with_capacity(width * height);
    for v in 0..height {
        let algo::frame::Samples::Eight(row) = view.row(v) else {
            panic!("the default camera has 8 bits");
        };
        samples.extend(
            row.iter()
                .enumerate()
                .map(|(u, &here)| match u < width / 2 {
                    true => sample(v * width + u, here),
                    false => here,
                }),
        );
    }
    let pixels = Arc::new(Pixels::Eight(samples));
    let format = hal::frame::FrameFormat::packed(width as u32, height as u32, 8);
    Frame::new(format, pixels, frame.timestamp(), frame.count()).unwrap()
}

#[test]
fn a_cycle_goes_on_with_more_frames_where_half_the_picture_is_disturbed() {
    let mut line = Line::new(&quick());
    let good = line.pair(&bracket(&[]));
    let inspect = |frames: &[Frame]| line.plan.inspect(0, frames, Instant::now());
    assert_eq!(inspect(&good).step_up, None);
    // Another part in the left half of both frames.
    let mut other = Line::new(&quick());
    other
        .bed
        .head
        .load(line.plan.rasters(&line.bed.calibration).unwrap())
        .unwrap();
    let other = other.pair(&Part::Sphere(Sphere::default()));
    let [first, second] = [0, 1].map(|at| {
        let left = samples(&other[at]);
        with_left(&good[at], |place, _| left[place])
    });
    let why = inspect(&[first, second]).step_up;
    println!("another part: {why:?}");
    assert!(why.is_some());
    // A light that was switched on over half the part between both frames.
    let lit = with_left(&good[1], |_, sample| sample.saturating_add(60));
    let why = inspect(&[good[0].clone(), lit]).step_up;
    println!("light: {why:?}");
    assert!(why.is_some());
    // The fringes of the left half are blurred away.
    let flat = with_left(&good[1], |_, _| 100);
    let why = inspect(&[with_left(&good[0], |_, _| 100), flat]).step_up;
    println!("no fringes: {why:?}");
    assert!(why.is_some());
}

#[test]
fn oil_on_half_of_a_part_does_not_fail_it() {
    let mut line = Line::new(&quick());
    let good = line.pair(&bracket(&[]));
    let oiled = |frame: &Frame| {
        with_left(frame, |place, sample| {
            let streak = 0.6 + 0.15 * ((place % 512) as f64 / 9.0).sin();
            (f64::from(sample) * streak).round() as u8
        })
    };
    let found = line
        .plan
        .inspect(0, &[oiled(&good[0]), oiled(&good[1])], Instant::now());
    let value = found.gauges[0].value.unwrap();
    println!(
        "oil: {:?}, {value:+.4} mm, {:?}",
        found.judged, found.step_up
    );
    assert!(found.step_up.is_some() || found.judged == Verdict::Pass);
}

#[test]
fn another_part_is_never_passed_by_two_frames() {
    let mut line = Line::new(&quick());
    let (found, sequence) = line.cycle(&Part::Sphere(Sphere::default()));
    assert!(sequence > 0);
    assert_ne!(found.judged, Verdict::Pass);
}

#[test]
fn teach_asks_for_two_frames_only_when_it_is_told_to() {
    let place = Place::new();
    let config = place.path("fringed.toml").display().to_string();
    for (more, expected) in [(&["--frames", "2"][..], true), (&[][..], false)] {
        let out = place.path("part.recipe");
        let _ = std::fs::remove_file(&out);
        let command = ["teach", "--number", "1", "--config", &config, "--out"];
        let run = program().run(&[&command[..], &[out.to_str().unwrap()], more].concat());
        assert_eq!(run.code, 0, "{}", run.stderr);
        let bytes = std::fs::read(&out).unwrap();
        let (file, _): (RecipeFile, _) = appliance::recipe::file::archive::unpack(
            std::io::Cursor::new(&bytes),
            bytes.len() as u64,
        )
        .unwrap();
        assert_eq!(file.two_frames, expected);
        let recipe = Recipe::from_bytes(&bytes).unwrap();
        assert_eq!(recipe.sequences[0].shots.len() == 2, expected);
    }
    let command = [
        "teach", "--number", "1", "--config", &config, "--frames", "3",
    ];
    let run = program().run(&command);
    assert_eq!(run.code, 64, "{}", run.stderr);
}

/// A head that sees the middle of the bracket, with the large hole and half of bead and slot.
pub(crate) const MIDDLE: &str = "sub_rays = 2
part = { kind = \"sheet_metal\" }
[rig.camera]
width = 256
height = 192
fov_deg = [10.0, 7.5]
";

#[test]
fn a_station_judges_by_two_frames_keeps_them_and_goes_on_with_more_for_another_part() {
    let place = Place::before(MIDDLE);
    let mut bed = bed(&Scenario::from_toml(MIDDLE, "scene").unwrap());
    let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
    let taught = with_two_frames(taught);
    std::fs::create_dir_all(place.recipe().parent().unwrap()).unwrap();
    std::fs::write(place.recipe(), taught.bytes).unwrap();
    // FLAGS 1: one level, 3: the full sequence, 4: after a shorter one.
    for (more, verdict, flags) in [
        (
            &["--part", "sheet_metal", "--shift", "1,-1,0"][..],
            1,
            0b0_0010,
        ),
        (
            &["--part", "sheet_metal", "--defect", "dent:-20,4,1,12"],
            2,
            0b0_0010,
        ),
        (&["--part", "sphere"], 3, 0b1_1000),
    ] {
        let mut command = command(&place);
        command.args(more);
        let daemon = Daemon::of(command);
        let words = Plc::connect(&daemon).measure(1);
        let seq = long(&words, 0);
        let found = (words[8], words[31] & 0b1_1110);
        println!("{more:?}: verdict {}, flags {:b}", words[8], words[31]);
        assert!(found.1 == flags, "{more:?}: {:b}", words[31]);
        assert!(
            found.0 == verdict || (verdict == 3 && found.0 == 2),
            "{more:?}: {}",
            words[8]
        );
        if verdict == 2 {
            let folder = recording(&place, seq);
            daemon.kill();
            let run = program().run(&["replay", folder.to_str().unwrap()]);
            assert!(
                run.stdout.contains("bit by bit"),
                "{} {}",
                run.stdout,
                run.stderr
            );
        }
    }
}

#[test]
#[ignore = "takes a minute and prints times"]
fn two_frames_of_1456_by_1088_take_so_long_on_one_thread() {
    let mut scenario = quick();
    let camera = &mut scenario.rig.camera;
    (camera.width, camera.height, camera.fov_deg) = (1456, 1088, [20.0, 15.0]);
    let mut line = Line::new(&scenario);
    let pair = line.pair(&bracket(&[]));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.unwrap();
    for _ in 0..4 {
        let found = pool.install(|| line.plan.inspect(0, &pair, Instant::now()));
        let deviation = found.gauges[0].value;
        println!(
            "{:?}, deviation {deviation:?} mm, {:?}",
            found.judged, found.stages
        );
        assert!(found.step_up.is_some() || found.judged == Verdict::Pass);
    }
}
