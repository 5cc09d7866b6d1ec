//! Shared pictures of other programs' kinds, with the phase that is right.

use super::scene::{import, notes};
use crate::written::program;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tests::{files, shared};

/// Largest error of a phase that is right, turns.
const RIGHT: f64 = 0.02;

/// Pictures, and a place for a recording and results.
struct Case<'a> {
    pictures: &'a Path,
    projector: &'a str,
    place: TempDir,
}

impl<'a> Case<'a> {
    fn new(pictures: &'a Path, projector: &'a str) -> Self {
        Self {
            pictures,
            projector,
            place: tempfile::tempdir().unwrap(),
        }
    }

    /// What an import says with these options.
    fn said(&self, options: &str) -> Vec<String> {
        let recording = self.place.path().join("recording");
        let _ = fs::remove_dir_all(&recording);
        let options: Vec<&str> = options.split(' ').chain(["--json"]).collect();
        notes(&import(self.pictures, &recording, self.projector, &options).succeeded())
    }

    fn is_named(&self, options: &str, words: &str) {
        let said = self.said(options);
        assert!(
            said.iter().any(|note| note.contains(words)),
            "{options}: {said:?}"
        );
    }

    /// Shares of the pixels that have a phase, and of these that are right.
    fn measured(&self, phase: &str, expected: &Path) -> (f64, f64) {
        let out = self.place.path().join("out");
        let recording = self.place.path().join("recording");
        program().measure(&recording, &out, &[]).succeeded();
        let found = files::array(&out.join(phase)).elements;
        let expected = files::array(expected).elements;
        let pairs = || {
            found
                .iter()
                .zip(&expected)
                .filter(|(found, _)| !found.is_nan())
        };
        let right = pairs()
            .filter(|(a, b)| f64::from((*a - *b).abs()) <= RIGHT)
            .count() as f64;
        let known = pairs().count() as f64;
        (known / found.len() as f64, right / known)
    }

    /// Imports without a finding, and every phase is right.
    fn is_right(&self, options: &str, phase: &str, expected: &Path, share: f64) {
        assert_eq!(self.said(options), [""; 0], "{options}");
        let (known, right) = self.measured(phase, expected);
        assert!(known > share && right == 1.0, "{options}: {known} {right}");
    }
}

#[test]
fn shared_codes_are_right_or_named_with_what_they_are() {
    if let Some(folder) = shared::case("01-gray-half-cell-offset") {
        let (frames, expected) = (folder.join("frames"), folder.join("expected_phase.npy"));
        let case = Case::new(&frames, "640x400");
        let stated = "--fringes 32 --steps 4 --convention cos --first-shift 0.5 --gray 5";
        case.is_named(stated, "--gray-offset 10");
        case.is_right(
            &format!("{stated} --gray-offset 10"),
            "phase.npy",
            &expected,
            0.9,
        );
    }
    if let Some(folder) = shared::case("02-gray-first-shift") {
        let (frames, expected) = (folder.join("frames"), folder.join("expected_phase.npy"));
        let case = Case::new(&frames, "640x400");
        let code = "--fringes 32 --steps 4 --gray 6 --gray-cell 10";
        for stated in ["", " --convention cos", " --convention cos --shift -"] {
            case.is_named(
                &format!("{code}{stated}"),
                "--convention cos --shift + --first-shift 0.5",
            );
        }
        let right = format!("{code} --convention cos --first-shift 0.5");
        case.is_right(&right, "phase.npy", &expected, 0.99);
    }
    if let Some(folder) = shared::case("03-gray-cell-two-widths") {
        let frames = folder.join("frames");
        let case = Case::new(&frames, "640x400");
        let code = "--fringes 16 --steps 4 --direction both --gray 5,5 --gray-cell";
        case.is_named(&format!("{code} 20"), "--gray-cell 20,12.5");
        for (phase, expected) in [
            ("phase-0.npy", "expected_phase_0.npy"),
            ("phase-1.npy", "expected_phase_1.npy"),
        ] {
            case.is_right(
                &format!("{code} 20,12.5"),
                phase,
                &folder.join(expected),
                0.97,
            );
        }
    }
    if let Some(folder) = shared::case("12-gray-described-wrong") {
        let stated = "--fringes 32 --steps 4 --convention cos --first-shift 0.5 --gray 5";
        let lsb = folder.join("lsb");
        Case::new(&lsb, "640x400").is_named(stated, "--gray-order lsb");
        let wide = folder.join("cells-23-for-22.5");
        let rows = format!("{stated} --direction horizontal");
        Case::new(&wide, "1280x720").is_named(&rows, "--gray-cell 23");
    }
}

#[test]
fn shared_fringes_that_are_clipped_or_bent_are_named() {
    if let Some(folder) = shared::case("04-saturated-left-aligned-12-bit") {
        let frames = folder.join("frames");
        let case = Case::new(&frames, "640x400");
        case.is_named("--fringes 1,8,64 --steps 4", "at full scale");
        let expected = folder.join("expected_phase.npy");
        let (known, right) = case.measured("phase.npy", &expected);
        assert!(known > 0.9 && right == 1.0, "{known} {right}");
    }
    if let Some(folder) = shared::case("07-gamma-three-steps") {
        let frames = folder.join("frames");
        Case::new(&frames, "640x400").is_named("--fringes 1,8,64 --steps 3", "response");
    }
}

#[test]
fn shared_levels_whose_coarsest_has_some_fringes_are_right_about_a_map() {
    let Some(folder) = shared::case("50-coarsest-level-of-several-fringes") else {
        return;
    };
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let models = format!(
        "--camera-model {} --projector-model {} --unit mm",
        path("camera.yml"),
        path("projector.yml")
    );
    let frames = folder.join("frames");
    let case = Case::new(&frames, "640x400");
    let (recording, out) = (
        case.place.path().join("recording"),
        case.place.path().join("out"),
    );
    let expected = files::array(&folder.join("expected_height.npy")).elements;
    let map = path("about.npy");
    let with_map = ["--about", map.as_str()];
    for about in [&with_map[..0], &with_map] {
        let said = case.said(&format!("--fringes 8,64 --steps 4 {models}"));
        assert_eq!(said, [""; 0]);
        program().measure(&recording, &out, about).succeeded();
        let found = files::array(&out.join("height.npy")).elements;
        let pairs = found
            .iter()
            .zip(&expected)
            .filter(|(found, _)| !found.is_nan());
        let errors: Vec<f64> = pairs.map(|(a, b)| f64::from(a - b)).collect();
        assert!(errors.len() > found.len() * 9 / 10, "{}", errors.len());
        let rms =
            (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        assert!(rms < 0.03, "{about:?}: {rms} mm");
    }
    case.said(&format!("--name b64_ --fringes 64 --steps 4 {models}"));
    program().measure(&recording, &out, &[]).succeeded();
    assert!(files::report(&out)["ambiguous"].is_string());
}

#[test]
fn shared_fringes_without_a_common_factor_have_an_absolute_phase() {
    if let Some(folder) = shared::case("55-coprime-fringes") {
        let frames = folder.join("frames");
        let case = Case::new(&frames, "640x400");
        let expected = folder.join("expected_phase.npy");
        case.is_right("--fringes 13,7 --steps 4", "phase.npy", &expected, 0.99);
    }
}
