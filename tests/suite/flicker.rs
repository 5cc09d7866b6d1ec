//! Light that changes within a cycle: lamps on the mains, a projector that is not constant, a flash, a
//! shadow. A part in it reads as in steady light, or is INVALID with that reason.

use crate::history::reader;
use crate::placement::{Bed, TIMEOUT, bed, taught_within};
use crate::station_plc::{Daemon, Place, Plc, long};
use appliance::recipe::plan::Plan;
use appliance::station::error_code::UNSTEADY_LIGHT;
use appliance::station::snapshot::warning;
use appliance::station::{Inspection, Verdict};
use hal::frame::{Frame, Pixels, Samples};
use sim::parts::{Defect, Flowerpot, SheetMetal, Sphere};
use sim::scenario::Optics;
use sim::{Part, Placement, Scenario, Unsteady};
use std::f64::consts::SQRT_2;
use std::fs;
use std::sync::Arc;
use std::time::Instant;
use tests::random::Random;
use tests::until::{PATIENCE, until};

/// Other light of 40 counts, and a projector that leaves room for it.
fn scenario(part: &Part, unsteady: Unsteady, exposure_refreshes: f64) -> Scenario {
    let mut scenario = Scenario {
        part: part.clone(),
        sub_rays: 2,
        unsteady,
        optics: Optics {
            projector_blur_px: 1.0,
            camera_blur_px: 0.5,
            ..Optics::default()
        },
        ..Scenario::default()
    };
    (scenario.light.ambient, scenario.light.diffuse) = (40.0 / 255.0, 0.7);
    scenario.timing.exposure_refreshes = exposure_refreshes;
    scenario
}

/// A lamp whose light changes by ± `counts` of 40 where exposures are short against its period.
fn lamp(hz: f64, counts: f64) -> Unsteady {
    Unsteady {
        lamp_hz: hz,
        lamp_depth: counts / 40.0,
        lamp_phase: 0.13,
        ..Unsteady::default()
    }
}

/// A projector whose light changes by 3 % from refresh to refresh.
fn noisy() -> Unsteady {
    Unsteady {
        projector_noise: 0.03,
        ..Unsteady::default()
    }
}

/// A part that was taught in steady light, and heads that see it in steady and in changing light.
struct Taught {
    plan: Plan,
    heads: [Bed; 2],
    part: Part,
    tolerance_mm: f64,
}

impl Taught {
    fn new(part: Part, tolerance_mm: f64, unsteady: Unsteady, exposure_refreshes: f64) -> Self {
        let steady = scenario(&part, Unsteady::default(), exposure_refreshes);
        let mut quiet = bed(&steady);
        let taught = taught_within(&mut quiet, tolerance_mm).unwrap();
        let plan = Plan::new(taught.recipe, &quiet.calibration, true).unwrap();
        let mut heads = [quiet, bed(&scenario(&part, unsteady, exposure_refreshes))];
        let rasters = plan.rasters(&heads[0].calibration).unwrap();
        for head in &mut heads {
            head.head.load(rasters.clone()).unwrap();
        }
        Self {
            plan,
            heads,
            part,
            tolerance_mm,
        }
    }

    fn place(&self, part: &Part, placement: &Placement) {
        for head in &self.heads {
            head.stage.place(part, placement).unwrap();
        }
    }

    /// The frames of a sequence in steady light, or in the other one.
    fn frames(&mut self, sequence: usize, changing: bool) -> Vec<Frame> {
        let mut frames = Vec::new();
        let mut keep = |_, frame| frames.push(frame);
        let head = &mut self.heads[usize::from(changing)].head;
        head.acquire(self.plan.indices(sequence), TIMEOUT, &mut keep)
            .unwrap();
        frames
    }

    fn inspect(&self, sequence: usize, frames: &[Frame]) -> Inspection {
        self.plan.inspect(sequence, frames, Instant::now())
    }
}

/// A placement within the tolerance of a part, mm.
fn near(random: &mut Random, tolerance_mm: f64) -> Placement {
    let mut within = |most: f64| tolerance_mm * most * (2.0 * random.share() - 1.0);
    Placement {
        shift_mm: [within(0.3), within(0.3), within(0.2)],
        tilt_deg: [within(0.1), within(0.1)],
        rotation_deg: within(0.2),
    }
}

/// What changing light makes of the values of parts, per sequence.
#[derive(Default)]
struct Tally {
    parts: usize,
    passed: [usize; 2],
    failed: usize,
    invalid: usize,
    /// Differences of deviations from those in steady light, mm, and over U of the steady one.
    off: Vec<[f64; 2]>,
}

impl Tally {
    /// Values that are off by so many U at most.
    fn within(&self, u: f64) -> usize {
        self.off.iter().filter(|off| off[1].abs() <= u).count()
    }

    /// Whether 95 of 100 values are off by 10 µm at most, or by √2 U: both values have U. Noise alone
    /// makes 3 to 5 µm RMS of two measurements in steady light.
    fn is_near(&self) -> bool {
        let near = |off: &&[f64; 2]| off[0].abs() <= 0.01 || off[1].abs() <= SQRT_2;
        20 * self.off.iter().filter(near).count() >= 19 * self.off.len()
    }

    /// Whether 95 of 100 values are off by U at most, which says how much of the light is left.
    fn is_known(&self) -> bool {
        20 * self.within(1.0) >= 19 * self.off.len()
    }
}

fn tally(taught: &mut Taught, count: u64, what: &str) -> Vec<Tally> {
    let mut all: Vec<Tally> = (0..taught.plan.sequence_count())
        .map(|_| Tally::default())
        .collect();
    for seed in 0..count {
        taught.place(
            &taught.part,
            &near(&mut Random::new(seed), taught.tolerance_mm),
        );
        for (sequence, tally) in all.iter_mut().enumerate() {
            let frames = [false, true].map(|changing| taught.frames(sequence, changing));
            let [steady, found] = frames.map(|frames| taught.inspect(sequence, &frames));
            tally.parts += 1;
            tally.passed[0] += usize::from(steady.verdict() == Verdict::Pass);
            tally.passed[1] += usize::from(found.verdict() == Verdict::Pass);
            tally.failed += usize::from(found.verdict() == Verdict::Fail);
            tally.invalid += usize::from(found.verdict() == Verdict::Invalid);
            for (steady, found) in steady.gauges.iter().zip(&found.gauges) {
                let Some((steady_value, value)) = steady.value.zip(found.value) else {
                    continue;
                };
                let off = value.abs() - steady_value.abs();
                if &*steady.name == "deviation" {
                    let u = steady.uncertainty.unwrap().max(found.uncertainty.unwrap());
                    tally.off.push([off, off / u]);
                }
            }
        }
    }
    for (sequence, tally) in all.iter().enumerate() {
        let off = |at: usize| tally.off.iter().map(move |off| off[at].abs());
        let most = |at: usize| off(at).fold(0.0, f64::max);
        let squares: f64 = off(0).map(|off| off * off).sum();
        let rms = (squares / tally.off.len().max(1) as f64).sqrt();
        println!(
            "{what}, {} frames: {} parts, PASS {:?}, FAIL {}, INVALID {}; deviation off by {:.4} RMS, {:.4} mm or {:.2} U at most, {} of {} within U",
            taught.plan.indices(sequence).len(),
            tally.parts,
            tally.passed,
            tally.failed,
            tally.invalid,
            rms,
            most(0),
            most(1),
            tally.within(1.0),
            tally.off.len(),
        );
    }
    all
}

/// A lamp that is slow against an exposure, so that frames see all of its change.
const SLOW: &str = "light of 13.7 Hz, 16.7 ms";

/// A lamp on the mains with exposures of one and two refreshes, a slow one, and a projector whose light is
/// not constant.
fn kinds() -> Vec<(&'static str, Unsteady, f64)> {
    vec![
        ("lamp of 100 Hz, 16.7 ms", lamp(100.0, 15.0), 1.0),
        ("lamp of 100 Hz, 33 ms", lamp(100.0, 15.0), 2.0),
        (SLOW, lamp(13.7, 15.0), 1.0),
        ("projector 3 %, 16.7 ms", noisy(), 1.0),
    ]
}

/// Good parts pass as in steady light, with values as in steady light.
fn are_as_in_steady_light(part: &Part, tolerance_mm: f64, placements: u64) {
    for (what, unsteady, refreshes) in kinds() {
        let mut taught = Taught::new(part.clone(), tolerance_mm, unsteady, refreshes);
        for tally in tally(&mut taught, placements, what) {
            assert_eq!([tally.failed, tally.invalid], [0, 0], "{what}");
            assert!(
                tally.is_near() || what == SLOW && tally.is_known(),
                "{what}"
            );
        }
    }
}

#[test]
fn a_part_in_changing_light_reads_as_in_steady_light() {
    are_as_in_steady_light(&Part::default(), 1.0, 1);
}

#[test]
#[ignore = "takes half an hour: `.ci/run full`"]
fn fifty_placements_of_parts_in_changing_light_read_as_in_steady_light() {
    let sphere = Part::Sphere(Sphere::default());
    let flowerpot = Part::Flowerpot(Flowerpot::default());
    // Parts that may lie anywhere get 12 frames, a sphere that lies better 6 or 3.
    for (part, tolerance_mm) in [
        (Part::default(), 1.0),
        (sphere.clone(), 1.0),
        (sphere, 0.3),
        (flowerpot, 1.0),
    ] {
        are_as_in_steady_light(&part, tolerance_mm, 50);
    }
}

#[test]
fn a_dent_fails_in_changing_light() {
    let dented = Part::SheetMetal(SheetMetal {
        defects: vec![Defect::Dent {
            x: 10.0,
            y: -20.0,
            depth_mm: 0.3,
            diameter_mm: 8.0,
        }],
        ..SheetMetal::default()
    });
    for (what, unsteady, refreshes) in kinds().into_iter().skip(2) {
        let mut taught = Taught::new(Part::default(), 1.0, unsteady, refreshes);
        taught.place(&dented, &near(&mut Random::new(3), 1.0));
        let frames = taught.frames(0, true);
        let found = taught.inspect(0, &frames);
        assert_eq!(found.verdict(), Verdict::Fail, "{what}: {:?}", found.reason);
        assert!(found.warnings & warning::UNSTEADY_LIGHT != 0, "{what}");
    }
}

/// A frame whose samples are changed, by their places.
fn changed(frame: &Frame, change: impl Fn(usize, f64) -> f64) -> Frame {
    let Samples::Eight(samples) = frame.samples() else {
        unreachable!("the head has 8 bits");
    };
    let samples = samples.iter().enumerate();
    let samples =
        samples.map(|(at, sample)| change(at, f64::from(*sample)).round().clamp(0.0, 255.0) as u8);
    let pixels = Arc::new(Pixels::Eight(samples.collect()));
    Frame::new(frame.format(), pixels, frame.timestamp(), frame.count()).unwrap()
}

#[test]
fn a_flash_or_a_shadow_in_any_one_frame_is_named_and_no_good_part_fails() {
    let mut taught = Taught::new(Part::default(), 1.0, Unsteady::default(), 1.0);
    let width = taught.heads[0].stage.scenario().frame_size().0 as usize;
    let steady = taught.frames(0, false);
    let found = taught.inspect(0, &steady);
    assert_eq!(found.verdict(), Verdict::Pass);
    assert_eq!((found.light, found.warnings), (None, 0));
    for at in 0..steady.len() {
        let flash = changed(&steady[at], |_, sample| sample + 200.0);
        let shadow = changed(&steady[at], |at, sample| {
            if at % width < width / 2 {
                0.2 * sample
            } else {
                sample
            }
        });
        for (what, frame) in [("a flash", flash), ("a shadow", shadow)] {
            let mut frames = steady.clone();
            frames[at] = frame;
            let found = taught.inspect(0, &frames);
            let named = (found.verdict(), found.error_code);
            assert_eq!(
                named,
                (Verdict::Invalid, UNSTEADY_LIGHT),
                "{what} in {at}: {:?}",
                found.reason
            );
            assert!(found.warnings & warning::UNSTEADY_LIGHT != 0);
            let frame = format!("frame {} of {}", at + 1, frames.len());
            assert!(
                found.reason.clone().unwrap().contains(&frame),
                "{what} in {at}: {:?}",
                found.reason
            );
        }
    }
}

#[test]
fn the_frequency_of_a_lamp_is_named_where_the_times_of_frames_tell_it() {
    // Refreshes of 1/60 s see a lamp of 120 Hz always in the same phase.
    for (hz, refreshes, told) in [
        (100.0, 1.0, Some(100)),
        (100.0, 2.0, Some(100)),
        (120.0, 1.0, None),
    ] {
        let mut taught = Taught::new(Part::default(), 1.0, lamp(hz, 15.0), refreshes);
        let frames = taught.frames(0, true);
        let found = taught.inspect(0, &frames);
        assert_eq!(
            found.light.and_then(|light| light.hz),
            told,
            "{hz} Hz, {refreshes} refreshes"
        );
    }
}

/// A part that shakes by so many mm along x and z.
fn shaking(shake_mm: [f64; 3], shake_hz: f64) -> Unsteady {
    Unsteady {
        shake_mm,
        shake_hz,
        ..Unsteady::default()
    }
}

/// Shakes a part along one axis: in steady light it reads as one that rests.
fn shakes(axes: &[usize], mm: &[f64], hz: &[f64], placements: u64) {
    for &mm in mm {
        for &axis in axes {
            let mut along = [0.0; 3];
            along[axis] = mm;
            for &hz in hz {
                let what = format!("shaken by {along:?} mm, {hz} Hz");
                let mut taught = Taught::new(Part::default(), 1.0, shaking(along, hz), 1.0);
                for tally in tally(&mut taught, placements, &what) {
                    assert_eq!(tally.failed, 0, "{what}");
                    assert!(tally.is_near(), "{what}");
                }
            }
        }
    }
}

#[test]
fn a_part_that_shakes_reads_as_one_that_rests() {
    shakes(&[2], &[0.05], &[17.0], 1);
}

#[test]
#[ignore = "takes a quarter of an hour: `.ci/run full`"]
fn a_part_that_shakes_slowly_or_fast_reads_as_one_that_rests() {
    let hz = [15.0, 17.0, 33.0, 47.0, 59.0];
    shakes(&[0, 2], &[0.02, 0.05], &hz, 10);
}

#[test]
fn teaching_says_that_light_changed() {
    let part = Part::default();
    for (unsteady, told) in [(Unsteady::default(), false), (lamp(13.7, 15.0), true)] {
        let taught = taught_within(&mut bed(&scenario(&part, unsteady, 1.0)), 1.0).unwrap();
        let mut reasons = taught.choice.reasons.iter();
        assert_eq!(reasons.any(|words| words.contains("light changed")), told);
    }
}

#[test]
fn a_station_takes_a_sequence_with_a_flash_again_and_keeps_what_changed() {
    let place = Place::taught();
    let scenario = fs::read_to_string(place.path("small.toml")).unwrap();
    let changing = "[unsteady]\nflash = 0.06\nlamp_hz = 13.7\nlamp_depth = 0.4\n";
    fs::write(place.path("small.toml"), format!("{scenario}\n{changing}")).unwrap();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let mut retried = 0;
    let mut last = 0;
    for token in 1..=6 {
        let words = plc.measure(token);
        last = long(&words, 0);
        let (verdict, error_code, flags) = (words[8], words[9], words[31]);
        println!("verdict {verdict}, error {error_code}, flags {flags:b}");
        assert!(
            verdict == 1 || error_code == UNSTEADY_LIGHT,
            "{verdict}, {error_code}"
        );
        retried += flags & 1;
        let warnings = plc.read(103, 1).unwrap()[0];
        assert!(warnings & warning::UNSTEADY_LIGHT != 0, "{warnings:b}");
    }
    assert!(retried > 0);
    // The history has the changes of the lamp of each part that was judged.
    let entries = until("the last result", PATIENCE, || {
        let found: Vec<_> = (1..=last)
            .filter_map(|seq| reader(&place).result(seq).unwrap())
            .collect();
        if found.len() == last as usize {
            Ok(found)
        } else {
            Err(found.len())
        }
    });
    let judged = entries.iter().filter(|entry| entry.error_code == 0);
    assert!(judged.filter(|entry| entry.light.is_some()).count() > 0);
}

#[test]
fn steady_light_is_never_taken_for_changing_light_by_a_small_camera_either() {
    let part = Part::default();
    let mut steady = Scenario {
        part,
        sub_rays: 2,
        ..Scenario::default()
    };
    (steady.rig.camera.width, steady.rig.camera.height) = (160, 160);
    let mut bed = bed(&steady);
    let taught = taught_within(&mut bed, 1.0).unwrap();
    let plan = Plan::new(taught.recipe, &bed.calibration, true).unwrap();
    let rasters = plan.rasters(&bed.calibration).unwrap();
    bed.head.load(rasters).unwrap();
    for seed in 0..400 {
        bed.stage.reseed(seed);
        let mut frames = Vec::new();
        let mut keep = |_, frame| frames.push(frame);
        bed.head
            .acquire(plan.indices(0), TIMEOUT, &mut keep)
            .unwrap();
        let found = plan.inspect(0, &frames, Instant::now());
        assert_eq!((found.light, found.error_code), (None, 0), "seed {seed}");
    }
}
