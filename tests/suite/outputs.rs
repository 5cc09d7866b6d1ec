//! The files and the text of `fringed measure`.

use crate::written::{Written, geometric};
use hal::replay::recording::PatternSpec;
use std::collections::BTreeSet;
use std::fs;
use tests::oracle::{self, Device, Pattern, Reason, Rig};
use tests::render::{Scene, levels};
use tests::{files, program::Run};

const WITH_HEIGHT: [&str; 10] = [
    "cloud.ply",
    "height.npy",
    "height.png",
    "mask.npy",
    "modulation.npy",
    "phase.npy",
    "picture.png",
    "report.json",
    "sigma.npy",
    "wrapped.npy",
];
const WITHOUT_HEIGHT: [&str; 6] = [
    "mask.npy",
    "modulation.npy",
    "phase.npy",
    "picture.png",
    "report.json",
    "wrapped.npy",
];

#[test]
fn phase_and_height_are_nan_exactly_where_the_definition_rejects() {
    let mut recording = geometric().record();
    // The top of the bump is outside the working range.
    recording.range_mm = Some([-60.0, 5.0]);
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    assert_eq!(files::names(&written.out()), WITH_HEIGHT);
    let phase = files::array(&written.out().join("phase.npy"));
    let height = files::array(&written.out().join("height.npy"));
    let sigma = files::array(&written.out().join("sigma.npy"));
    for array in [&phase, &height, &sigma] {
        assert_eq!((array.rows, array.columns), (96, 96));
    }
    let twin = oracle::decode(&recording, 0);
    let rig = Rig::of(&recording).unwrap();
    let pattern = Pattern::of(&recording, 0);
    let mut seen = BTreeSet::new();
    let (mut resolved, mut out_of_range) = (0, 0);
    for pixel in 0..96 * 96 {
        let rejected = twin.reason[pixel] != Reason::Resolved;
        assert_eq!(phase.elements[pixel].is_nan(), rejected, "pixel {pixel}");
        let (u, v) = ((pixel % 96) as f64, (pixel / 96) as f64);
        let found = (!rejected).then(|| rig.height(&pattern, u, v, twin.phase[pixel]));
        let missing = !matches!(found, Some(Some(_)));
        assert_eq!(height.elements[pixel].is_nan(), missing, "pixel {pixel}");
        assert_eq!(sigma.elements[pixel].is_nan(), missing, "pixel {pixel}");
        seen.insert(twin.reason[pixel]);
        resolved += usize::from(!missing);
        out_of_range += usize::from(found == Some(None));
    }
    // Every reason occurs, so the test is not trivial.
    assert!(seen.len() >= 4 && out_of_range > 100, "{seen:?}");
    let report = files::report(&written.out());
    assert_eq!(report["resolved"], resolved);
    assert_eq!(report["unresolved"]["out_of_range"], out_of_range);
}

#[test]
fn the_report_has_every_key_and_its_counts_add_up() {
    let recording = geometric().record();
    let written = Written::new(&recording);
    let run = written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    for key in [
        "lit",
        "resolved",
        "unresolved",
        "kind",
        "ratios",
        "stage_us",
        "noise_counts",
        "score",
    ] {
        assert!(!report[key].is_null(), "{key}");
    }
    for key in [
        "scored",
        "rms_mm",
        "bias_mm",
        "median_mm",
        "p99_mm",
        "gross",
    ] {
        assert!(report["score"][key].is_number(), "score.{key}");
    }
    assert_eq!(report["kind"], "geometric");
    assert_eq!(report["ratios"], serde_json::json!([0.0192, 0.138, 1.0]));
    let count = |key: &str| report[key].as_u64().unwrap();
    let twin = oracle::decode(&recording, 0);
    let reasons = report["unresolved"].as_object().unwrap();
    for reason in [Reason::LowModulation, Reason::Saturated, Reason::Residual] {
        let expected = twin.reason.iter().filter(|r| **r == reason).count();
        assert_eq!(reasons[reason.word()], expected, "{}", reason.word());
    }
    // Dark pixels count as not lit unless the truth says otherwise; here it calls the dark patch
    // unseen.
    assert_eq!(reasons["dark"], 0);
    let unresolved: u64 = reasons.values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(count("lit"), count("resolved") + unresolved);
    let stages = report["stage_us"].as_object().unwrap();
    assert!(!stages.is_empty() && stages.values().all(serde_json::Value::is_u64));
    for number in [count("lit"), count("resolved")] {
        assert!(run.stdout.contains(&number.to_string()), "{}", run.stdout);
    }
}

#[test]
fn a_dark_pixel_that_the_truth_calls_whole_is_lit_and_unresolved() {
    let mut recording = geometric().record();
    let dark = oracle::decode(&recording, 0)
        .reason
        .iter()
        .filter(|reason| **reason == Reason::Dark)
        .count();
    recording.truth_class = Some(vec![2; 96 * 96]);
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert!(dark > 100);
    assert_eq!(report["unresolved"]["dark"], dark);
    assert_eq!(report["lit"], 96 * 96);
}

#[test]
fn the_cloud_has_one_vertex_per_resolved_pixel_on_that_pixels_ray() {
    let recording = geometric().record();
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let cloud = files::cloud(&written.out().join("cloud.ply"));
    let height = files::array(&written.out().join("height.npy")).elements;
    let sigma = files::array(&written.out().join("sigma.npy")).elements;
    let resolved: Vec<usize> = (0..height.len())
        .filter(|&pixel| !height[pixel].is_nan())
        .collect();
    assert_eq!(cloud.len(), resolved.len());
    assert_eq!(files::report(&written.out())["resolved"], resolved.len());
    let camera = Device::new(recording.camera_model.as_ref().unwrap());
    let mut levels = BTreeSet::new();
    for (vertex, pixel) in cloud.iter().zip(resolved) {
        assert_eq!(vertex.point[2], height[pixel]);
        assert_eq!(vertex.sigma, sigma[pixel]);
        let (u, v) = camera.project(vertex.point.map(f64::from));
        let off = (u - (pixel % 96) as f64).hypot(v - (pixel / 96) as f64);
        // Coordinates of ± 120 mm as f32 are exact to 4e-6 mm, 2e-6 px here.
        assert!(off < 1e-4, "pixel {pixel} is off by {off}");
        levels.insert(vertex.intensity);
    }
    // The part's brightness is 97 counts on one side and 127 on the other.
    assert!(levels.len() > 20, "{levels:?}");
}

#[test]
fn the_picture_shows_the_map_beside_its_scale() {
    let written = Written::new(&geometric().record());
    written.measure(&[]).succeeded();
    let picture = files::picture(&written.out().join("height.png"));
    assert_eq!(picture.channels, 3);
    assert!(
        (97..=96 + 200).contains(&picture.width),
        "{}",
        picture.width
    );
    assert!((96..=200).contains(&picture.height), "{}", picture.height);
    let colour = |x: usize, y: usize| {
        let at = 3 * (y * picture.width + x);
        picture.samples[at..at + 3].to_vec()
    };
    let map: BTreeSet<_> = (0..96 * 96).map(|i| colour(i % 96, i / 96)).collect();
    assert!(map.len() > 50, "{} colours", map.len());
    let scale: BTreeSet<_> = (0..picture.height)
        .flat_map(|y| (96..picture.width).map(move |x| (x, y)))
        .map(|(x, y)| colour(x, y))
        .collect();
    assert!(scale.len() > 30, "{} colours", scale.len());
    // The dark patch has one colour, different from the part's.
    assert_eq!(colour(8, 8), colour(12, 12));
    assert_ne!(colour(8, 8), colour(48, 48));
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    for scene in [
        geometric(),
        Scene::new(81.0, levels(&[1.0, 35.0 / 36.0, 5.0 / 6.0], 4)),
    ] {
        let written = Written::new(&scene.record());
        let outcome = |threads: &str| {
            written.measure(&["--threads", threads]).succeeded();
            let read = |name: &str| fs::read(written.out().join(name)).unwrap();
            let arrays = [
                "phase.npy",
                "height.npy",
                "sigma.npy",
                "cloud.ply",
                "height.png",
            ];
            let mut report = files::report(&written.out());
            report.as_object_mut().unwrap().remove("stage_us");
            (arrays.map(read), report)
        };
        let one = outcome("1");
        assert!(one == outcome("2"), "2 threads differ from 1");
        assert!(one == outcome("5"), "5 threads differ from 1");
    }
}

#[test]
fn of_two_patterns_the_vertical_one_is_the_phase_and_gives_the_height() {
    let recording = Scene {
        patterns: vec![
            PatternSpec::Horizontal { fringes: 36.0 },
            PatternSpec::Vertical { fringes: 49.0 },
        ],
        ..Scene::new(0.0, levels(&[0.019, 0.137, 1.0], 4))
    }
    .record();
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let mut names = WITH_HEIGHT.map(str::to_owned).to_vec();
    for name in ["mask", "modulation", "phase", "wrapped"] {
        names.extend([format!("{name}-0.npy"), format!("{name}-1.npy")]);
    }
    names.sort();
    assert_eq!(files::names(&written.out()), names);
    let read = |name: &str| fs::read(written.out().join(name)).unwrap();
    assert_eq!(read("phase.npy"), read("phase-1.npy"));
    let horizontal = files::array(&written.out().join("phase-0.npy")).elements;
    let twin = oracle::decode(&recording, 0);
    for (pixel, phase) in horizontal.iter().enumerate() {
        assert_eq!(phase.is_nan(), twin.phase[pixel].is_nan(), "{pixel}");
        // The error bound of the arctangent; 36 turns as f32 are exact to 2e-6.
        let bound = 2.5e-5 + 2e-6;
        assert!(phase.is_nan() || (f64::from(*phase) - twin.phase[pixel]).abs() < bound);
    }
}

/// Checks which files a measurement without geometry writes and which not.
fn check_no_height(written: &Written, run: &Run) {
    assert_eq!(files::names(&written.out()), WITHOUT_HEIGHT);
    let report = files::report(&written.out());
    let why = report["no_height"].as_str().expect("a reason");
    assert!(why.contains("model"), "{why}");
    assert!(run.stdout.contains(why), "{}", run.stdout);
    assert!(report["score"].is_null());
    assert!(report["resolved"].as_u64().unwrap() > 8000);
}

#[test]
fn a_recording_without_a_model_gives_the_phase_and_says_why_there_is_no_height() {
    for device in ["camera", "projector"] {
        let written = Written::new(&geometric().record());
        written.edit(|manifest| {
            manifest[device].as_object_mut().unwrap().remove("model");
        });
        let run = written.measure(&[]).succeeded();
        check_no_height(&written, &run);
        assert!(run.stdout.contains(device), "{}", run.stdout);
    }
    let mut recording = geometric().record();
    recording.camera_model = None;
    recording.projector.model = None;
    let written = Written::new(&recording);
    let run = written.measure(&[]).succeeded();
    check_no_height(&written, &run);
}

#[test]
fn three_shifts_without_stated_noise_give_no_sigma_and_say_why() {
    let written = Written::new(&Scene::new(49.0, levels(&[0.0192, 0.138, 1.0], 3)).record());
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert!(report["noise_counts"].is_null());
    assert!(report["no_sigma"].as_str().unwrap().contains("noise"));
    let sigma = files::array(&written.out().join("sigma.npy")).elements;
    assert!(sigma.iter().all(|sigma| sigma.is_nan()));
    assert!(report["resolved"].as_u64().unwrap() > 8000);
}

#[test]
fn json_prints_the_report_and_quiet_prints_nothing() {
    let written = Written::new(&geometric().record());
    let run = written.measure(&["--json"]).succeeded();
    let printed: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(printed, files::report(&written.out()));
    let run = written.measure(&["--quiet"]).succeeded();
    assert_eq!((run.stdout.as_str(), run.stderr.as_str()), ("", ""));
}

#[test]
fn results_replace_older_ones_and_leave_no_temporary_files() {
    let written = Written::new(&geometric().record());
    fs::create_dir_all(written.out()).unwrap();
    fs::write(written.out().join("height.npy"), "old").unwrap();
    fs::write(written.out().join("mine.txt"), "kept").unwrap();
    written.measure(&[]).succeeded();
    let mut names = WITH_HEIGHT.to_vec();
    names.push("mine.txt");
    names.sort_unstable();
    assert_eq!(files::names(&written.out()), names);
    assert_eq!(files::array(&written.out().join("height.npy")).rows, 96);
}

#[test]
fn results_that_a_measurement_has_not_are_not_left_from_the_one_before() {
    let written = Written::new(&geometric().record());
    written.measure(&[]).succeeded();
    // As after a recording of two patterns.
    for name in ["phase-0.npy", "phase-1.npy", "wrapped-0.npy", "mask-0.npy"] {
        fs::write(written.out().join(name), "old").unwrap();
    }
    written.edit(|manifest| {
        let camera = manifest["camera"].as_object_mut().unwrap();
        camera.remove("model");
    });
    let run = written.measure(&[]);
    check_no_height(&written, &run);
}

/// The distance of a phase from another on the short way round a turn.
fn turns_apart(a: f64, b: f64) -> f64 {
    let apart = a - b;
    (apart - apart.round()).abs()
}

#[test]
fn wrapped_phase_modulation_mask_and_picture_are_those_of_the_finest_level() {
    let mut recording = geometric().record();
    recording.camera_model = None;
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let twin = oracle::decode(&recording, 0);
    let array = |name: &str| files::array(&written.out().join(name)).elements;
    let (phase, wrapped) = (array("phase.npy"), array("wrapped.npy"));
    let modulation = array("modulation.npy");
    let mask = files::flags(&written.out().join("mask.npy"));
    let picture = files::picture(&written.out().join("picture.png"));
    assert_eq!(
        (picture.width, picture.height, picture.channels),
        (96, 96, 1)
    );
    let finest = oracle::levels_of(&recording, 0).pop().unwrap();
    let mut compared = 0;
    for pixel in 0..96 * 96 {
        let resolved = twin.reason[pixel] == Reason::Resolved;
        assert_eq!(mask[pixel] == 1, resolved, "pixel {pixel}");
        if !resolved {
            continue;
        }
        // Two errors of the arctangent, and those of f32.
        let bound = 5e-5 + 4e-6;
        let apart = turns_apart(f64::from(wrapped[pixel]), f64::from(phase[pixel]));
        assert!(apart < bound, "pixel {pixel}: {apart}");
        let samples = oracle::samples(&recording, &finest, pixel);
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        assert!((f64::from(picture.samples[pixel]) - mean).abs() <= 0.5);
        let fit = match samples.contains(&255.0) {
            true => oracle::demodulate_whole(&samples, &finest.shifts, 255.0).unwrap(),
            false => oracle::demodulate(&samples, &finest.shifts),
        };
        let error = f64::from(modulation[pixel]) - fit.modulation;
        assert!(error.abs() < 0.25, "pixel {pixel}: {error} counts");
        compared += 1;
    }
    assert!(compared > 7000, "{compared}");
}

#[test]
fn levels_that_need_a_map_and_have_none_give_the_wrapped_phase_and_name_the_remedy() {
    for frames in [
        levels(&[1.0, 35.0 / 36.0, 5.0 / 6.0], 4),
        levels(&[0.8, 1.0], 3),
        levels(&[1.0], 4),
    ] {
        let with_models = Scene::new(81.0, frames).record();
        let mut bare = with_models.clone();
        bare.projector.model = None;
        let written = Written::new(&bare);
        let run = written.measure(&[]).succeeded();
        let names: Vec<_> = WITHOUT_HEIGHT
            .into_iter()
            .filter(|name| *name != "phase.npy")
            .collect();
        assert_eq!(files::names(&written.out()), names);
        let report = files::report(&written.out());
        let why = report["no_phase"].as_str().expect("a reason");
        for word in ["no model of the projector", "recipe"] {
            assert!(why.contains(word) && run.stdout.contains(word), "{why}");
        }
        let absolute = oracle::decode(&with_models, 0);
        let wrapped = files::array(&written.out().join("wrapped.npy")).elements;
        let mask = files::flags(&written.out().join("mask.npy"));
        let mut compared = 0;
        for (pixel, &phase) in wrapped.iter().enumerate() {
            assert_eq!(mask[pixel] == 1, !phase.is_nan());
            if absolute.reason[pixel] == Reason::Resolved {
                let apart = turns_apart(f64::from(phase), absolute.phase[pixel]);
                // About a map all levels are averaged, so this is the noise of one: σ 5e-3 turn.
                assert!(apart < 0.05, "pixel {pixel}: {apart}");
                compared += 1;
            }
        }
        assert!(compared > 6000, "{compared}");
    }
}
