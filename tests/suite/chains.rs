//! Levels that are no geometric or dense sequence: two periods with a beat, three with a beat of
//! beats.

use crate::written::Written;
use hal::replay::Recording;
use tests::files;
use tests::oracle::{Pattern, Rig};
use tests::render::{Scene, levels};

/// A scene without spoilt patches, with ± 0.5 % noise: the order of two levels of 32 and 31 fringes
/// has 45 times the noise of one, σ = 45 · 0.0009 turn with 16 shifts.
fn scene(fringes: f64, ratios: &[f64], shifts: usize) -> Recording {
    let scene = Scene {
        patches: false,
        noise: 0.005,
        ..Scene::new(fringes, levels(ratios, shifts))
    };
    scene.record()
}

/// Pixels whose absolute phase was compared with the truth, and those of a wrong order.
fn orders(recording: &Recording, phase: &[f32]) -> (usize, usize) {
    let (rig, pattern) = (Rig::of(recording).unwrap(), Pattern::of(recording, 0));
    let truth = recording.truth_height.as_ref().unwrap();
    let (mut compared, mut wrong) = (0, 0);
    for (pixel, &turns) in phase.iter().enumerate() {
        let z = f64::from(truth[pixel]);
        if !turns.is_nan() && !z.is_nan() {
            let (u, v) = ((pixel % 96) as f64, (pixel / 96) as f64);
            compared += 1;
            wrong += usize::from((f64::from(turns) - rig.phase_at(&pattern, u, v, z)).abs() > 0.5);
        }
    }
    (compared, wrong)
}

#[test]
fn levels_with_a_chain_of_beats_give_absolute_phase_without_models_and_heights_with_them() {
    for (fringes, ratios, shifts) in [
        (32.0, vec![1.0, 31.0 / 32.0], 16),
        (35.0, vec![1.0, 32.0 / 35.0, 29.5 / 35.0], 8),
    ] {
        let recording = scene(fringes, &ratios, shifts);
        let mut bare = recording.clone();
        bare.camera_model = None;
        let written = Written::new(&bare);
        written.measure(&[]).succeeded();
        let report = files::report(&written.out());
        assert_eq!(report["kind"], "heterodyne", "{report}");
        assert!(report["chain"].as_array().unwrap().len() >= 2, "{report}");
        assert!(report["no_height"].is_string() && report["no_phase"].is_null());
        let phase = files::array(&written.out().join("phase.npy")).elements;
        let (compared, wrong) = orders(&recording, &phase);
        assert!(compared > 8000 && wrong == 0, "{compared} {wrong}");
    }
    // Not dense, because 1 - 29.5/35 is not the square of 1 - 32/35: heights come by the chain.
    let recording = scene(35.0, &[1.0, 32.0 / 35.0, 29.5 / 35.0], 8);
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert_eq!(report["kind"], "heterodyne");
    let score = &report["score"];
    assert_eq!(score["gross"], 0, "{score}");
    // Ratios and shifts as of a level of 8 shifts: predicted σ from the frames' own noise.
    let (rms, sigma) = (&score["rms_mm"], &report["sigma_mm"]);
    let share = rms.as_f64().unwrap() / sigma.as_f64().unwrap();
    assert!((0.85..1.15).contains(&share), "{rms} {sigma}");
}

#[test]
fn numbers_of_fringes_without_a_common_factor_give_absolute_phase() {
    let mut recording = scene(13.0, &[1.0, 7.0 / 13.0], 4);
    recording.camera_model = None;
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert_eq!(report["kind"], "heterodyne", "{report}");
    recording = scene(13.0, &[1.0, 7.0 / 13.0], 4);
    let phase = files::array(&written.out().join("phase.npy")).elements;
    let (compared, wrong) = orders(&recording, &phase);
    assert!(compared > 8000 && wrong == 0, "{compared} {wrong}");
}

#[test]
fn levels_whose_coarsest_has_some_fringes_are_unwrapped_about_the_reference_or_a_given_map() {
    let recording = scene(64.0, &[1.0, 0.0625], 4);
    let written = Written::new(&recording);
    written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    assert_eq!(report["map"], "reference");
    assert_eq!(report["kind"], "geometric");
    assert_eq!(report["score"]["gross"], 0, "{report}");
    assert!(report["ambiguous"].is_null(), "{report}");
    // About its own phase without models.
    let map = written.out().join("phase.npy");
    let known = files::array(&map).elements;
    let mut bare = recording;
    (bare.camera_model, bare.projector.model) = (None, None);
    let bare = Written::new(&bare);
    bare.measure(&["--about", map.to_str().unwrap()])
        .succeeded();
    assert_eq!(files::report(&bare.out())["map"], "given");
    let again = files::array(&bare.out().join("phase.npy")).elements;
    let pairs = known
        .iter()
        .zip(&again)
        .filter(|(known, _)| !known.is_nan());
    assert!(pairs.clone().count() > 8000);
    assert!(pairs.clone().all(|(known, again)| known == again));
}

#[test]
fn heights_that_are_ambiguous_about_the_reference_map_are_said() {
    let written = Written::new(&scene(64.0, &[1.0], 4));
    let run = written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    let words = report["ambiguous"].as_str().expect("an ambiguity");
    assert!(words.contains("a coarser level"), "{words}");
    assert!(run.stdout.contains(words), "{}", run.stdout);
}

#[test]
fn levels_without_a_chain_give_the_wrapped_phase_and_say_what_to_add() {
    let mut recording = scene(64.0, &[1.0, 60.0 / 64.0, 0.5], 4);
    // With models it would be unwrapped about the reference map.
    recording.projector.model = None;
    let written = Written::new(&recording);
    let run = written.measure(&[]).succeeded();
    let report = files::report(&written.out());
    let why = report["no_phase"].as_str().expect("a reason");
    assert!(why.contains("a coarser level"), "{why}");
    assert!(run.stdout.contains(why), "{}", run.stdout);
    assert!(!written.out().join("phase.npy").exists());
    assert!(written.out().join("wrapped.npy").exists());
}
