//! Parts that are bright here and dark there, measured with longer exposures and less light where
//! they are bright.

use super::gauges::frames;
use super::placement::{Bed, bed, naming, scenario, taught_asking};
use super::station_plc::{Daemon, Place, Plc, command, long};
use super::two_frames::MIDDLE;
use super::written::program;
use appliance::recipe::file::archive;
use appliance::recipe::plan::Plan;
use appliance::recipe::teach::golden::Naming;
use appliance::recipe::teach::replace;
use appliance::recipe::{Recipe, RecipeFile, SequenceKind};
use appliance::station::{Inspection, Verdict};
use hal::frame::Samples;
use sim::parts::{Board, Cone, Defect, SheetMetal};
use sim::{Part, Placement, Scenario};
use std::ops::Range;
use std::time::Instant;

/// How far any corner may lie from where it was taught: a shift of 2 mm along x and y.
const TOLERANCE_MM: f64 = 3.0;
/// What good parts that lie so far off keep beside steep edges, ± mm.
const LIMIT_MM: f64 = 0.25;
/// Exposures of the recipe with longer ones.
const EXPOSURES: u32 = 4;
/// A pixel is dark if golden's modulation by one exposure is below this, in counts.
const DARK: f32 = 24.0;
const DENT: Defect = Defect::Dent {
    x: -20.0,
    y: 4.0,
    depth_mm: 0.5,
    diameter_mm: 10.0,
};

/// A head in front of a part with the recipe that was taught there, whose patterns it shows.
struct Line {
    bed: Bed,
    plan: Plan,
    recipe: Recipe,
    sigma_mm: f64,
}

impl Line {
    fn new(scenario: &Scenario, exposures: u32) -> Self {
        let mut bed = bed(scenario);
        let naming = Naming {
            exposures: Some(exposures),
            limit_mm: Some(LIMIT_MM),
            ..naming(TOLERANCE_MM)
        };
        let taught = taught_asking(&mut bed, &naming).unwrap();
        let recipe = Recipe::from_bytes(&taught.bytes).unwrap();
        let plan = Plan::new(recipe.clone(), &bed.calibration, true).unwrap();
        let own = bed.head.camera_timing().exposure / bed.head.exposures();
        plan.load(&mut bed.head, &bed.calibration).unwrap();
        assert_eq!(bed.head.camera_timing().exposure, own * exposures);
        let full = taught.manifest.sequences.last().unwrap();
        assert_eq!(full.kind, SequenceKind::Full);
        Self {
            bed,
            plan,
            recipe,
            sigma_mm: full.sigma_mm,
        }
    }

    /// z of each pixel by the longest sequence, mm.
    fn heights(&mut self) -> Vec<f32> {
        let last = self.plan.sequence_count() - 1;
        let frames = frames(&mut self.bed, &self.plan, last);
        self.plan.layers(last, &frames).unwrap().height_mm
    }

    /// A cycle as the station runs it.
    fn cycle(&mut self, part: &Part, shift_mm: [f64; 3]) -> Inspection {
        let placement = Placement {
            shift_mm,
            ..Placement::default()
        };
        self.bed.stage.place(part, &placement).unwrap();
        let mut sequence = 0;
        loop {
            let frames = frames(&mut self.bed, &self.plan, sequence);
            let found = self.plan.inspect(sequence, &frames, Instant::now());
            if found.step_up.is_none() {
                return found;
            }
            sequence += 1;
        }
    }
}

/// σ of one measurement by the difference of two, mm, over the pixels that `these` picks, and how
/// many there are.
fn noise(first: &[f32], second: &[f32], these: impl Fn(usize) -> bool) -> (f64, usize) {
    let differences = (0..first.len())
        .filter(|&at| these(at))
        .map(|at| f64::from(first[at] - second[at]).abs())
        .filter(|difference| difference.is_finite());
    let mut differences: Vec<f64> = differences.collect();
    differences.sort_by(f64::total_cmp);
    let count = differences.len();
    // The median of |normal| is 0.6745 σ.
    let median = differences.get(count / 2).copied().unwrap_or(f64::NAN);
    (median / 0.6745 / 2.0_f64.sqrt(), count)
}

/// What two lines measure of the same part, with one exposure and with longer ones: σ of the latter
/// over σ of the former where golden's modulation by one exposure is in `counts`, also so many
/// pixels to the left and right, above and below.
fn compared([once, longer]: &mut [Line; 2], counts: Range<f32>, around: usize) -> f64 {
    let modulation = once.recipe.arrays.modulation.clone();
    let (columns, rows, _) = once.recipe.conditions.camera;
    let (columns, rows) = (columns as usize, rows as usize);
    let these = |at: usize| {
        let (u, v) = (at % columns, at / columns);
        let across = [u.saturating_sub(around), (u + around).min(columns - 1)];
        let down = [v.saturating_sub(around), (v + around).min(rows - 1)];
        let beside = across.map(|u| v * columns + u).into_iter();
        let mut all = beside.chain(down.map(|v| v * columns + u)).chain([at]);
        all.all(|at| counts.contains(&modulation[at]))
    };
    let of = |line: &mut Line| noise(&line.heights(), &line.heights(), these);
    let ((before, pixels), (after, still)) = (of(once), of(longer));
    println!(
        "  {counts:?} counts, also {around} pixels around: σ {:.1} µm of {pixels} pixels, with longer exposures {:.1} µm of {still}: {:.3}",
        1e3 * before,
        1e3 * after,
        after / before
    );
    after / before
}

/// Pixels of which a sample of the longest sequence is at full scale.
fn saturated(line: &mut Line) -> usize {
    let last = line.plan.sequence_count() - 1;
    let frames = frames(&mut line.bed, &line.plan, last);
    let at_full_scale = |at: usize| {
        frames.iter().any(|frame| match frame.samples() {
            Samples::Eight(samples) => samples[at] == u8::MAX,
            Samples::Sixteen(_) => panic!("samples of 8 bits"),
        })
    };
    let pixels = frames[0].format().samples();
    (0..pixels).filter(|&at| at_full_scale(at)).count()
}

fn resolved(line: &mut Line) -> usize {
    line.heights().iter().filter(|z| z.is_finite()).count()
}

/// A sheet whose quarters are white and black, which reflects 8 % of the light.
fn quarters() -> Part {
    Part::Board(Board {
        columns: 3,
        rows: 3,
        square_mm: 120.0,
        ..Board::default()
    })
}

fn lines(scenario: &Scenario) -> [Line; 2] {
    let mut lines = [1, EXPOSURES].map(|exposures| Line::new(scenario, exposures));
    let [once, longer] = &mut lines;
    let least = *longer.recipe.arrays.amplitude.iter().min().unwrap();
    println!(
        "{:?}: least amplitude {least} of 255, predicted σ {:.1} and {:.1} µm, resolved {} and {}, saturated {} and {}",
        scenario.part,
        1e3 * once.sigma_mm,
        1e3 * longer.sigma_mm,
        resolved(once),
        resolved(longer),
        saturated(once),
        saturated(longer)
    );
    // Nothing is attenuated where the whole light is needed.
    assert_eq!(longer.recipe.arrays.amplitude.iter().max(), Some(&255));
    assert!(once.recipe.arrays.amplitude.is_empty());
    assert_eq!(saturated(longer), 0);
    lines
}

#[test]
fn longer_exposures_lower_the_noise_where_a_part_is_dark_and_saturate_no_pixel() {
    let mut quiet = scenario(quarters());
    quiet.noise.noise_counts = Some(1.5);
    let mut of_quarters = lines(&quiet);
    // A quarter, and a little more near the white quarters and by rounding to 8 bits.
    compared(&mut of_quarters, 1.0..DARK, 0);
    let dark = compared(&mut of_quarters, 1.0..DARK, 40);
    assert!((0.24..0.32).contains(&dark), "{dark}");
    // The other light is exposed longer as well, and leaves less room for that of the projector.
    let bright = compared(&mut of_quarters, DARK..256.0, 0);
    assert!(bright < 1.35, "{bright}");
    // The wall of the cone's hole is dark, and its rim bright.
    let mut of_cone = lines(&scenario(Part::Cone(Cone::default())));
    let dark = compared(&mut of_cone, 1.0..DARK, 0);
    assert!(dark < 0.7, "{dark}");
    compared(&mut of_cone, DARK..256.0, 0);
}

#[test]
fn what_is_too_dark_for_one_exposure_is_measured_by_longer_ones() {
    let [mut once, mut longer] = lines(&scenario(quarters()));
    let (before, after) = (resolved(&mut once), resolved(&mut longer));
    assert!(after * 4 > before * 5, "{before} and {after}");
}

#[test]
fn good_parts_pass_and_dented_ones_fail_with_longer_exposures_also_where_they_lie_2_mm_away() {
    let part = |defects: &[Defect]| {
        Part::SheetMetal(SheetMetal {
            defects: defects.to_vec(),
            ..SheetMetal::default()
        })
    };
    let mut line = Line::new(&scenario(part(&[])), EXPOSURES);
    for shift_mm in [[0.0; 3], [2.0, -2.0, 0.0], [-2.0, 2.0, 0.0]] {
        for (defects, expected) in [(&[][..], Verdict::Pass), (&[DENT], Verdict::Fail)] {
            let found = line.cycle(&part(defects), shift_mm);
            println!(
                "{shift_mm:?}: {:?} {:?}",
                found.judged, found.gauges[0].value
            );
            assert_eq!(found.verdict(), expected, "{shift_mm:?} {found:?}");
        }
    }
}

#[test]
fn a_station_measures_by_a_recipe_that_teach_makes_with_longer_exposures() {
    let place = Place::before(MIDDLE);
    let config = place.path("fringed.toml").display().to_string();
    let out = place.path("part.recipe");
    let teach = ["teach", "--number", "1", "--config", &config, "--out"];
    let teach = [&teach[..], &[out.to_str().unwrap(), "--exposures", "3"]].concat();
    let run = program().run(&teach);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.contains("exposed 3 times"), "{}", run.stdout);
    let bytes = std::fs::read(&out).unwrap();
    let (file, arrays) = archive::unpack(std::io::Cursor::new(&bytes), bytes.len() as u64).unwrap();
    assert_eq!(file.exposures, 3);
    // Taught again, it stays so.
    assert_eq!(replace::naming(1, Some(&file), false).exposures, Some(3));
    refused_without_its_light(&file, &arrays);
    std::fs::create_dir_all(place.recipe().parent().unwrap()).unwrap();
    std::fs::copy(&out, place.recipe()).unwrap();
    for (more, verdict) in [
        (&["--part", "sheet_metal"][..], 1),
        (&["--part", "sheet_metal", "--defect", "dent:-20,4,1,12"], 2),
    ] {
        let mut command = command(&place);
        command.args(more);
        let daemon = Daemon::of(command);
        let mut plc = Plc::connect(&daemon);
        assert_eq!(plc.measure(1)[8], verdict, "{more:?}");
        // CAMERA_FPS in hundredths: an exposure lasts three refreshes of 60 Hz at least.
        let rate = long(&plc.read(600, 2).unwrap(), 0);
        assert!((1..=2000).contains(&rate), "{rate}");
    }
    // Recordings cannot be exposed anew.
    let run = program().run(&[&teach[..], &["--golden", "recording"]].concat());
    assert_eq!(run.code, 64, "{}", run.stderr);
}

/// A recipe whose exposures and amplitude do not fit each other is refused, naming them.
fn refused_without_its_light(file: &RecipeFile, arrays: &archive::Arrays) {
    let check = |exposures: u32, amplitude: Vec<u8>| {
        let file = RecipeFile {
            exposures,
            ..file.clone()
        };
        let arrays = archive::Arrays {
            amplitude: amplitude.into(),
            ..arrays.clone()
        };
        Recipe::check(&file, arrays).map(drop)
    };
    let whole = arrays.amplitude.to_vec();
    check(3, whole.clone()).unwrap();
    check(1, Vec::new()).unwrap();
    check(1, whole.clone()).unwrap();
    let mut dark = whole.clone();
    dark[7] = 0;
    for (exposures, amplitude) in [
        (1, whole[1..].to_vec()),
        (3, Vec::new()),
        (3, whole[1..].to_vec()),
        (3, dark),
    ] {
        let refused = check(exposures, amplitude).unwrap_err();
        assert!(refused.words.contains("amplitude has"), "{refused}");
    }
    for exposures in [0, 5] {
        let refused = check(exposures, whole.clone()).unwrap_err();
        assert!(refused.words.contains("exposures"), "{refused}");
    }
}
