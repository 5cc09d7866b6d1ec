//! `fringed-lab adapt --patterns` and `fringed measure --about`: from a preliminary recording to
//! the heights of the adapted pattern.

use crate::adapt::turns;
use crate::written::{Written, laboratory};
use algo::pattern::{PhaseFunction, Sequence, Shot};
use appliance::head::calibrated::CalibratedHead;
use appliance::head::calibration::Calibration;
use appliance::head::seam;
use hal::head::Head;
use hal::projector::Raster;
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame};
use serde_json::Value;
use sim::parts::Sphere;
use sim::scenario::Noise;
use sim::{Part, Scenario, Stage};
use std::path::Path;
use std::time::Duration;
use tests::files;

const TIMEOUT: Duration = Duration::from_secs(5);

/// A simulated head in front of a sphere.
struct Bench {
    head: Head,
    stage: Stage,
    calibration: Calibration,
}

impl Bench {
    fn new() -> Self {
        let mut scenario = Scenario {
            part: Part::Sphere(Sphere::default()),
            sub_rays: 2,
            ..Scenario::default()
        };
        scenario.noise.noise_counts = Some(Noise::PAPER);
        (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
        (scenario.rig.projector.width, scenario.rig.projector.height) = (512, 384);
        let (head, stage) = sim::head(&scenario).expect("a head");
        let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
        Self {
            head,
            stage,
            calibration,
        }
    }

    /// Three geometric levels of vertical fringes with a pitch of 20 px.
    fn preliminary(&mut self) -> Recording {
        let function = PhaseFunction::vertical(512, 384, 25.6).unwrap();
        let shots = Sequence::geometric(function.range(), 3, 4);
        let mut head = CalibratedHead::new(&mut self.head, &self.calibration, TIMEOUT);
        let measured = head.measure(&function, &shots, None, &|_| ()).unwrap();
        let frames = shots.iter().zip(measured.frames);
        let frames = frames.map(|(&shot, frame)| seam::recorded(shot, frame));
        self.recording(PatternSpec::Vertical { fringes: 25.6 }, frames.collect())
    }

    /// Projects the pictures of a folder that `adapt` wrote, as they are, and records the frames
    /// with what `sequence.json` says; with `keys` also the harmonics.
    fn project(&mut self, folder: &Path, keys: bool) -> Recording {
        let sequence = sequence(folder);
        let frames = sequence["frames"].as_array().expect("frames");
        let number = |frame: &Value, key: &str| frame[key].as_f64().expect("a number");
        let rasters = frames.iter().map(|frame| {
            let file = folder.join(frame["file"].as_str().expect("a file"));
            let picture = files::picture(&file);
            assert_eq!(
                (picture.width, picture.height, picture.channels),
                (512, 384, 1)
            );
            let grey = picture
                .samples
                .into_iter()
                .map(|grey| u8::try_from(grey).unwrap());
            Raster::new(512, 384, grey.collect()).unwrap()
        });
        self.head.load(rasters.collect()).unwrap();
        let order: Vec<usize> = (0..frames.len()).collect();
        let mut taken = Vec::new();
        let mut keep = |_, frame| taken.push(frame);
        self.head.acquire(&order, TIMEOUT, &mut keep).unwrap();
        let recorded = frames.iter().zip(taken).map(|(shown, frame)| {
            let harmonics = serde_json::from_value(shown["harmonics"].clone());
            RecordedFrame {
                harmonics: if keys {
                    harmonics.unwrap_or_default()
                } else {
                    Vec::new()
                },
                ..seam::recorded(
                    Shot::sine(number(shown, "ratio"), number(shown, "shift_turns")),
                    frame,
                )
            }
        });
        let (rows, columns, turns) = turns(&folder.join("phase_function.npy"));
        let spec = PatternSpec::File {
            rows,
            columns,
            turns,
        };
        let recorded = recorded.collect();
        self.recording(spec, recorded)
    }

    /// A recording of this head that does not state its noise.
    fn recording(&self, pattern: PatternSpec, frames: Vec<RecordedFrame>) -> Recording {
        let truth = self.stage.truth();
        Recording {
            noise_counts: None,
            patterns: vec![pattern],
            frames,
            truth_height: Some(truth.height.clone()),
            truth_class: Some(truth.class.clone()),
            ..self.calibration.recording()
        }
    }
}

fn sequence(folder: &Path) -> Value {
    let text = std::fs::read(folder.join("sequence.json")).expect("a sequence");
    serde_json::from_slice(&text).expect("JSON")
}

/// Runs `adapt --method fringed --patterns DIR` with more arguments.
fn adapt(written: &Written, more: &[&str]) -> std::path::PathBuf {
    let folder = written.out().join("patterns");
    let name = |path: &Path| path.to_str().expect("a name in UTF-8").to_owned();
    let (recording, out) = (
        name(&written.recording()),
        name(&written.out().join("phase.npy")),
    );
    let fixed = [
        "adapt",
        &recording,
        "--method",
        "fringed",
        "--out",
        &out,
        "--patterns",
    ];
    let folder_name = name(&folder);
    let arguments: Vec<&str> = fixed
        .into_iter()
        .chain([&folder_name[..]])
        .chain(more.iter().copied())
        .collect();
    laboratory().run(&arguments).succeeded();
    folder
}

#[test]
fn the_pictures_that_adapt_writes_are_measured_about_its_expected_phase() {
    let mut bench = Bench::new();
    let preliminary = Written::new(&bench.preliminary());
    let mut measure = |more: &[&str], keys| {
        let folder = adapt(&preliminary, more);
        let frames = sequence(&folder)["frames"].as_array().map(Vec::len);
        let frames = frames.expect("frames");
        // Those of a longer sequence that was written before are gone.
        assert!(!folder.join(format!("{frames:03}.png")).exists());
        let written = Written::new(&bench.project(&folder, keys));
        let about = folder.join("expected_phase.npy");
        written
            .measure(&["--about", about.to_str().unwrap()])
            .succeeded();
        let report = files::report(&written.out());
        println!("{frames} frames {more:?}: {}", report["score"]);
        assert_eq!(report["map"], "given");
        assert_eq!(report["score"]["gross"], 0);
        let share = |key: &str| report[key].as_f64().expect("a number");
        assert!(share("resolved") > 0.99 * share("lit"), "{report}");
        (report["score"]["rms_mm"].as_f64().expect("a score"), report)
    };
    let (long, _) = measure(&["--frames", "24"], false);
    let (twelve, report) = measure(&[], true);
    // Waveforms of 7 and 5 shifts leave no redundancy for the noise; taken for sines they do.
    assert!(report["no_sigma"].is_string(), "{report}");
    let (sines, report) = measure(&["--frames", "12", "--waveform", "sine"], false);
    let noise = report["noise_counts"].as_f64().expect("a noise");
    assert!((noise - 3.69).abs() < 0.1, "{noise}");
    let (four, _) = measure(&["--frames", "4"], false);
    let (three, _) = measure(&["--frames", "3"], false);
    // 12 frames of 7 + 5: b = 1.25 and 1.23. Half of the information of 24 frames.
    assert!(
        (0.75..0.88).contains(&(twelve / sines)),
        "{twelve} of {sines}"
    );
    assert!(
        (0.62..0.80).contains(&(long / twelve)),
        "{long} of {twelve}"
    );
    assert!((0.93..1.07).contains(&(three / four)), "{three} of {four}");
}

#[test]
fn what_cannot_be_projected_or_measured_about_is_refused() {
    let mut bench = Bench::new();
    let preliminary = Written::new(&bench.preliminary());
    let recording = preliminary.recording();
    let recording = recording.to_str().unwrap();
    let out = preliminary.out().join("phase.npy");
    let out = out.to_str().unwrap();
    let adapt = |more: &[&str]| {
        let fixed = ["adapt", recording, "--out", out];
        let arguments: Vec<&str> = fixed.iter().chain(more).copied().collect();
        laboratory().run(&arguments)
    };
    for (more, words) in [
        (&["--method", "fringed", "--frames", "12"][..], "--patterns"),
        (
            &["--method", "fringed", "--patterns", "p", "--frames", "7"],
            "24, 12, 9, 6",
        ),
        (
            &["--method", "paper", "--patterns", "p"],
            "--method fringed",
        ),
    ] {
        let run = adapt(more);
        assert_eq!(run.code, 64, "{}", run.stderr);
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
    let about = |file: &Path, code: i32, words: &str| {
        let run = preliminary.measure(&["--about", file.to_str().unwrap()]);
        assert_eq!(run.code, code, "{}", run.stderr);
        assert!(run.stderr.contains(words), "{}", run.stderr);
    };
    let folder = preliminary.out();
    std::fs::create_dir_all(&folder).unwrap();
    about(&folder.join("nowhere.npy"), 66, "adapt wrote");
    let map = folder.join("map.npy");
    std::fs::write(&map, b"no array").unwrap();
    about(&map, 65, "map.npy");
    std::fs::write(&map, hal::npy::write(64, &[0.0_f32; 64 * 64])).unwrap();
    about(&map, 65, "64x64");
}
