//! `fringed-lab adapt`, and `fringed measure --recipe`.

use crate::measured::SPHERE;
use crate::written::{Written, geometric, laboratory};
use algo::pattern::Shot;
use appliance::head::calibrated::CalibratedHead;
use appliance::head::calibration::Calibration;
use appliance::head::seam;
use appliance::recipe::Recipe;
use appliance::recipe::teach::{Naming, teach};
use appliance::system::headway::Headway;
use hal::head::Head;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame};
use sim::parts::Sphere;
use sim::{Part, Scenario, Stage};
use std::f64::consts::PI;
use std::ffi::OsStr;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;
use tempfile::TempDir;
use tests::oracle::{Pattern, Rig};
use tests::program::Run;
use tests::render::{Scene, levels};
use tests::{files, shared};

const TIMEOUT: Duration = Duration::from_secs(5);

/// Runs `adapt RECORDING --out OUT --json` with more arguments.
fn adapt(recording: &Path, out: &Path, more: &[&str]) -> Run {
    let fixed = [OsStr::new("adapt"), recording.as_os_str()];
    let out = [OsStr::new("--json"), OsStr::new("--out"), out.as_os_str()];
    let more = more.iter().map(OsStr::new);
    let arguments: Vec<&OsStr> = fixed.into_iter().chain(out).chain(more).collect();
    laboratory().run(&arguments)
}

fn json(run: &Run) -> serde_json::Value {
    serde_json::from_str(&run.stdout).expect("a report in JSON")
}

/// Reads a phase function from a file of f64: rows, columns and turns.
pub fn turns(path: &Path) -> (usize, usize, Vec<f64>) {
    let bytes = std::fs::read(path).expect("a phase function");
    let array = hal::npy::read(&bytes).expect("elements of f64");
    (array.rows, array.columns, array.elements)
}

/// Checks a phase function of the better method for a recording with truth: its size, a minimum of
/// zero, rising along ξ, no pitch below the limits. Returns its pattern.
fn check_fringed(recording: &Recording, run: &Run, out: &Path) -> PatternSpec {
    let projector = &recording.projector;
    let (rows, columns, values) = turns(out);
    assert_eq!(
        (columns, rows),
        (projector.width as usize, projector.height as usize)
    );
    let steps = values
        .chunks(columns)
        .flat_map(|row| row.windows(2).map(|pair| pair[1] - pair[0]));
    let (low, high) = steps.fold((f64::INFINITY, 0.0_f64), |(low, high), step| {
        (low.min(step), high.max(step))
    });
    assert!(
        low > 0.0 && high <= 1.0 / 5.0 + 1e-9,
        "steps of {low} to {high} turns"
    );
    let (least, most) = values
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(a, b), &x| (a.min(x), b.max(x)));
    assert_eq!(least, 0.0);
    let report = json(run);
    let close = |key: &serde_json::Value, value: f64| {
        let stated = key.as_f64().expect("a number");
        assert!(
            (stated - value).abs() < 1e-6 * value,
            "{stated} for {value}"
        );
    };
    assert_eq!(report["method"], "fringed");
    assert_eq!(report["shape"], serde_json::json!([rows, columns]));
    close(&report["max_turns"], most);
    close(&report["pitch_px"][0], 1.0 / high);
    close(&report["pitch_px"][1], 1.0 / low);
    // What the camera sees of it, from the truth and the oracle's geometry.
    let spec = PatternSpec::File {
        rows,
        columns,
        turns: values,
    };
    let pattern = Pattern::new(spec.clone(), projector.width, projector.height);
    let rig = Rig::of(recording).expect("both models");
    let truth = recording.truth_height.as_ref().expect("truth");
    let class = recording.truth_class.as_ref().expect("truth");
    let width = recording.width as usize;
    let phase = |at: usize| {
        let (u, v) = ((at % width) as f64, (at / width) as f64);
        rig.phase_at(&pattern, u, v, f64::from(truth[at]))
    };
    let (mut seen, mut fine) = (0, 0);
    for at in 1..truth.len() {
        if at % width != 0 && class[at] == 2 && class[at - 1] == 2 {
            seen += 1;
            // 2.2 px, plus the change of the slope within a cell and its smoothing.
            fine += usize::from((phase(at) - phase(at - 1)).abs() > 1.1 / 2.2);
        }
    }
    println!(
        "{fine} of {seen} px are finer than the limit; {}",
        run.stdout
    );
    assert!(fine * 200 < seen, "{fine} of {seen} px");
    let used = report["pixels_used"].as_u64().expect("a number");
    assert!(used as usize * 10 > seen * 9, "{used} of {seen} px");
    spec
}

#[test]
fn adapt_makes_a_pattern_for_the_shared_sphere() {
    let Some((folder, recording)) = shared::recording(SPHERE) else {
        return;
    };
    let room = tempfile::tempdir().unwrap();
    let out = room.path().join("new/phase.npy");
    let run = adapt(&folder, &out, &["--method", "fringed"]).succeeded();
    check_fringed(&recording, &run, &out);
    // The paper's method needs more than one vertical pattern.
    let other = room.path().join("paper.npy");
    let run = adapt(&folder, &other, &["--method", "paper"]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("horizontal") && run.stderr.contains("--method fringed"));
    assert!(!other.exists());
}

#[test]
fn the_adapted_pattern_measures_as_much_better_as_adapt_predicts() {
    // A pitch of 20 px, as preliminary patterns have, and so little noise that none of 9,216 errors
    // of σ 0.13 mm is gross.
    let preliminary = Scene {
        patches: false,
        noise: 0.01,
        ..Scene::new(12.8, levels(&[0.9 / 12.8, 0.27, 1.0], 4))
    };
    let recording = preliminary.record();
    let written = Written::new(&recording);
    let out = written.out().join("phase.npy");
    let run = adapt(&written.recording(), &out, &["--method", "fringed"]).succeeded();
    let spec = check_fringed(&recording, &run, &out);
    let report = json(&run);
    let number = |key: &str| report[key].as_f64().expect("a number");
    let scene = Scene {
        patterns: vec![spec],
        frames: levels(&[0.9 / number("max_turns"), 0.15, 1.0], 4),
        ..preliminary
    };
    let [before, after] = [recording, scene.record()].map(|recording| {
        let written = Written::new(&recording);
        written.measure(&[]).succeeded();
        let score = files::report(&written.out())["score"].clone();
        assert_eq!(score["gross"], 0);
        score["rms_mm"].as_f64().expect("a score")
    });
    let predicted = number("predicted_sigma_mm") / number("preliminary_sigma_mm");
    println!(
        "{before} mm, then {after} mm: {}, predicted {predicted}",
        after / before
    );
    // The renderer samples points, so its pixels do not lose contrast (10 to 15 % here), and no
    // lens blurs them, where `adapt` takes one of σ 0.5 px if none is given.
    let lens = |pitch_px: f64| (-2.0 * (PI * 0.5 / pitch_px).powi(2)).exp();
    let pitch_px = report["pitch_px"][0].as_f64().expect("a pitch");
    let share = after / before / predicted / (lens(pitch_px) / lens(20.0));
    assert!(predicted < 0.5 && (0.8..1.05).contains(&share), "{share}");
}

#[test]
fn the_papers_pattern_is_made_from_vertical_and_horizontal_fringes() {
    let recording = Scene {
        patterns: vec![
            PatternSpec::Horizontal { fringes: 9.6 },
            PatternSpec::Vertical { fringes: 12.8 },
        ],
        ..Scene::new(0.0, levels(&[0.9 / 12.8, 0.27, 1.0], 4))
    }
    .record();
    let written = Written::new(&recording);
    let out = written.out().join("phase.npy");
    let run = adapt(&written.recording(), &out, &["--method", "paper"]).succeeded();
    let (rows, columns, values) = turns(&out);
    assert_eq!((rows, columns), (192, 256));
    // Eq. 8: a zero first column; the smallest pitch is 8 px.
    assert!(values.chunks(columns).all(|row| row[0] == 0.0));
    for row in values.chunks(columns) {
        for pair in row.windows(2) {
            let pitch = 1.0 / (pair[1] - pair[0]);
            assert!((7.999..128.1).contains(&pitch), "{pitch}");
        }
    }
    // On a slope of 1.3 px per px, p_I = 5 px is coarser than the pattern without a limit.
    let free = written.out().join("free.npy");
    let more = ["--method", "paper", "--image-pitch", "20"];
    let coarse = adapt(&written.recording(), &free, &more).succeeded();
    let widest = |run: &Run| json(run)["pitch_px"][1].as_f64().expect("a pitch");
    assert!(widest(&coarse) > widest(&run) + 1.0);
}

#[test]
fn adapt_says_what_a_recording_lacks() {
    let written = Written::new(&geometric().record());
    let out = written.out().join("phase.npy");
    let fringed = ["--method", "fringed"];
    let run = adapt(
        &written.recording(),
        &out,
        &["--method", "paper", "--projector-pitch", "6"],
    );
    assert_eq!(run.code, 64, "{}", run.stderr);
    let run = adapt(
        &written.recording(),
        &out,
        &["--method", "fringed", "--camera-blur", "-1"],
    );
    assert_eq!(run.code, 64, "{}", run.stderr);
    written.edit(|manifest| {
        manifest["camera"].as_object_mut().unwrap().remove("model");
    });
    let run = adapt(&written.recording(), &out, &fringed);
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(
        run.stderr.contains("model") && run.stderr.contains("add"),
        "{}",
        run.stderr
    );
    let run = adapt(Path::new("nowhere"), &out, &fringed);
    assert_eq!(run.code, 66, "{}", run.stderr);
    assert!(!out.exists());
}

/// A simulated head on which a sphere was taught: the recipe's bytes, and recordings of the part.
struct Taught {
    recipe: Vec<u8>,
    full: Recording,
    single: Recording,
    dense: Recording,
}

/// Teaches a recipe. Only this function knows how.
fn taught_recipe(head: &mut Head, calibration: &Calibration) -> (Vec<u8>, Recipe) {
    let naming = Naming {
        number: 7,
        part_number: "S".into(),
        name: "sphere".into(),
        taught_by: String::new(),
        taught_at_unix_s: 0,
        placement_tolerance_mm: 1.0,
        exposures: None,
        everything: false,
        marking: Default::default(),
        empty: None,
        limit_mm: Some(0.15),
    };
    let taught = teach(head, calibration, &naming, TIMEOUT, Headway::silent()).expect("a sphere");
    let taught = taught.seal().expect("packed");
    (taught.bytes, taught.recipe)
}

impl Taught {
    fn get() -> &'static Self {
        static TAUGHT: OnceLock<Taught> = OnceLock::new();
        TAUGHT.get_or_init(Self::new)
    }

    fn new() -> Self {
        let mut scenario = Scenario {
            part: Part::Sphere(Sphere::default()),
            sub_rays: 2,
            ..Scenario::default()
        };
        (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
        (scenario.rig.projector.width, scenario.rig.projector.height) = (512, 384);
        let (mut head, stage) = sim::head(&scenario).expect("a head");
        let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
        let (bytes, recipe) = taught_recipe(&mut head, &calibration);
        let mut record = |ratios: &[f64], steps| {
            let levels = ratios.iter().flat_map(|&ratio| Shot::level(ratio, steps));
            let shots: Vec<_> = levels.collect();
            record(&mut head, &stage, &calibration, &recipe, &shots)
        };
        let max = recipe.function.range().max;
        Self {
            full: record(&[0.95 / max, (0.95 / max).sqrt(), 1.0], 4),
            single: record(&[1.0], 4),
            dense: record(&[0.8, 1.0], 3),
            recipe: bytes,
        }
    }

    /// Writes the recipe into a new folder.
    fn file(&self) -> (TempDir, String) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taught.recipe");
        std::fs::write(&path, &self.recipe).unwrap();
        let name = path.to_str().expect("a name in UTF-8").to_owned();
        (folder, name)
    }
}

/// Frames of the recipe's phase function as a recording without noise and working range, which the
/// recipe has.
fn record(
    head: &mut Head,
    stage: &Stage,
    calibration: &Calibration,
    recipe: &Recipe,
    shots: &[Shot],
) -> Recording {
    let mut head = CalibratedHead::new(head, calibration, TIMEOUT);
    let function = &recipe.function;
    let measured = head
        .measure(function, shots, None, &|_| ())
        .expect("a measurement");
    let (columns, rows) = (function.columns(), function.rows());
    let turns = (0..columns * rows).map(|at| function.at_pixel(at % columns, at / columns));
    let truth = stage.truth();
    Recording {
        description: "a sphere".into(),
        notes: Vec::new(),
        source: "the simulated head".into(),
        noise_counts: None,
        patterns: vec![PatternSpec::File {
            rows,
            columns,
            turns: turns.collect(),
        }],
        frames: shots
            .iter()
            .zip(measured.frames)
            .map(|(&shot, frame)| RecordedFrame {
                timestamp_ns: None,
                ..seam::recorded(shot, frame)
            })
            .collect(),
        truth_height: Some(truth.height.clone()),
        truth_class: Some(truth.class.clone()),
        ..calibration.recording()
    }
}

#[test]
fn with_a_recipe_a_few_frames_give_the_heights_of_the_full_sequence() {
    let taught = Taught::get();
    let (_folder, recipe) = taught.file();
    let measured = |recording: &Recording| {
        let written = Written::new(recording);
        written.measure(&["--recipe", &recipe]).succeeded();
        let read = |name: &str| files::array(&written.out().join(name)).elements;
        let report = files::report(&written.out());
        assert_eq!(report["recipe"]["number"], 7);
        let fingerprint = report["recipe"]["fingerprint"]
            .as_str()
            .expect("a fingerprint");
        assert_eq!(fingerprint.len(), 64);
        assert_eq!(report["score"]["gross"], 0, "{report:#}");
        (read("height.npy"), read("sigma.npy"), report)
    };
    let (full, full_sigma, report) = measured(&taught.full);
    assert_eq!(
        (&report["kind"], report["map"].is_null()),
        (&"geometric".into(), true)
    );
    for (short, kind) in [(&taught.single, "single"), (&taught.dense, "dense")] {
        let (height, sigma, report) = measured(short);
        assert_eq!(
            (&report["kind"], &report["map"]),
            (&kind.into(), &"golden".into())
        );
        let (mut both, mut worst) = (0, 0.0_f32);
        for at in 0..full.len() {
            let expected = full_sigma[at].hypot(sigma[at]);
            if !expected.is_nan() {
                both += 1;
                worst = worst.max((height[at] - full[at]).abs() / expected);
            }
        }
        println!("{kind}: {both} px, at most {worst:.2} σ apart, {report:#}");
        assert!(both > 8000 && worst <= 5.0, "{both} px, {worst} σ");
    }
}

#[test]
fn without_the_recipe_the_report_names_the_reference_map() {
    let written = Written::new(&Taught::get().single);
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert_eq!(report["map"], "reference");
    assert!(report["recipe"].is_null());
}

#[test]
fn a_recipe_that_does_not_fit_the_recording_is_refused_naming_both() {
    let taught = Taught::get();
    let (folder, recipe) = taught.file();
    let refused = |recording: &Recording, recipe: &str, code: i32, words: &[&str]| {
        let written = Written::new(recording);
        let run = written.measure(&["--recipe", recipe]);
        assert_eq!(run.code, code, "{}", run.stderr);
        for word in words {
            assert!(run.stderr.contains(word), "no {word} in {}", run.stderr);
        }
        assert!(!written.out().exists());
    };
    let mut other = taught.single.clone();
    other.patterns = vec![PatternSpec::Vertical { fringes: 37.5 }];
    refused(
        &other,
        &recipe,
        65,
        &["37.5 vertical fringes", "recipe 7", "apart"],
    );
    let small = geometric().record();
    refused(&small, &recipe, 65, &["96x96", "128x128", "recipe 7"]);
    let nowhere = folder.path().join("nowhere.recipe");
    refused(
        &taught.single,
        nowhere.to_str().unwrap(),
        66,
        &["nowhere.recipe"],
    );
    let broken = folder.path().join("broken.recipe");
    std::fs::write(&broken, &taught.recipe[..taught.recipe.len() / 2]).unwrap();
    refused(
        &taught.single,
        broken.to_str().unwrap(),
        65,
        &["broken.recipe", "teach it"],
    );
}
