//! What other heads can project from us, and pictures of a head that is not calibrated.

use super::scene::png_of;
use crate::station_plc::Place;
use crate::written::{FRINGED_LAB, laboratory, program};
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::files;

/// What a camera sees that looks straight at each projector pixel, without ever being at full
/// scale.
fn photograph(from: &Path, to: &Path) {
    let picture = files::picture(from);
    let samples: Vec<u8> = picture
        .samples
        .iter()
        .map(|g| (20 + g * 200 / 255) as u8)
        .collect();
    let file = fs::File::create(to).unwrap();
    let mut encoder = png::Encoder::new(file, picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&samples).unwrap();
}

/// Options of `patterns`, the number of pictures, and the phase in turns that each projector pixel
/// has then.
type Case<'a> = (&'a [&'a str], usize, &'a dyn Fn(usize) -> f64);

#[test]
fn written_patterns_make_a_recording_when_their_frames_are_filled_in() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    // An adaptive pattern: its phase is not proportional to the column.
    let curved: Vec<f64> = (0..64 * 48)
        .map(|at| {
            let column = f64::from(at % 64);
            column / 16.0 + (column / 20.0).sin() / 4.0
        })
        .collect();
    fs::write(path("phase.npy"), hal::npy::write(64, &curved)).unwrap();
    let phase = path("phase.npy");
    let straight = |at: usize| 4.0 * (at % 64) as f64 / 64.0;
    let fixed = ["--fringes", "0.9,4"];
    let code = [
        "--fringes",
        "4",
        "--gray",
        "3",
        "--gray-cell",
        "8",
        "--order",
        "white,gray,sine,black",
    ];
    let adaptive = ["--fringes", "0.2,1", "--pattern", phase.to_str().unwrap()];
    let cases: [Case<'_>; 3] = [
        (&fixed, 8, &straight),
        (&code, 9, &straight),
        (&adaptive, 8, &|at| curved[at]),
    ];
    for (at, (options, count, expected)) in cases.into_iter().enumerate() {
        let folder = path(&format!("patterns-{at}"));
        let size = ["--projector", "64x48", "--camera", "64x48"];
        let arguments = [&["patterns", folder.to_str().unwrap()][..], &size, options].concat();
        laboratory().run(&arguments).succeeded();
        let shown = files::names(&folder.join("show"));
        assert_eq!(shown.len(), count);
        let unfilled = program().measure(&folder, &path("none"), &[]);
        assert_eq!(unfilled.code, 65, "{}", unfilled.stderr);
        assert!(
            unfilled.stderr.contains("the file is missing"),
            "{}",
            unfilled.stderr
        );
        for name in shown {
            photograph(
                &folder.join("show").join(&name),
                &folder.join("frames").join(&name),
            );
        }
        let out = path(&format!("out-{at}"));
        program().measure(&folder, &out, &[]).succeeded();
        let phase = files::array(&out.join("phase.npy")).elements;
        for (pixel, &turns) in phase.iter().enumerate() {
            let error = f64::from(turns) - expected(pixel);
            // Rounding to 8 bits twice: 0.4 counts RMS of 100.
            assert!(
                error.abs() < 0.01,
                "case {at}, pixel {pixel}: {turns} {error}"
            );
        }
        let again = laboratory().run(&arguments);
        assert_eq!(again.code, 73, "{}", again.stderr);
    }
}

#[test]
fn a_head_that_is_not_calibrated_takes_recordings_without_models_of_each_pose() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    // A calibration that cannot be read is as good as none.
    fs::create_dir_all(place.path("state/calibration")).unwrap();
    fs::write(place.path("state/calibration/calibration.json"), "{").unwrap();
    let record = place.path("recorded");
    let run = program().run(&[
        "record",
        record.to_str().unwrap(),
        "--config",
        config.to_str().unwrap(),
    ]);
    assert_eq!(run.code, 65, "{}", run.stderr);
    let taken = place.path("taken");
    let mut capture = Command::new(FRINGED_LAB)
        .args([
            "capture",
            taken.to_str().unwrap(),
            "--config",
            config.to_str().unwrap(),
        ])
        .args(["--poses", "2", "--levels", "2", "--fringes", "20"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    capture.stdin.take().unwrap().write_all(b"\n\n").unwrap();
    let output = capture.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(files::names(&taken), ["pose-01", "pose-02"]);
    let pose = taken.join("pose-02");
    let manifest = fs::read_to_string(pose.join("recording.json")).unwrap();
    assert!(!manifest.contains("\"model\"") && manifest.contains("frames/white.png"));
    let out = place.path("out");
    let run = program().measure(&pose, &out, &[]).succeeded();
    assert!(
        run.stdout.contains("no model of camera and projector"),
        "{}",
        run.stdout
    );
    let report = files::report(&out);
    assert!(report["resolved"].as_u64().unwrap() > 3000, "{report}");
    for name in ["phase-0.npy", "phase-1.npy", "wrapped-1.npy"] {
        assert!(out.join(name).exists(), "{name}");
    }
}

#[test]
fn pictures_alone_are_taken_and_what_cannot_be_shown_is_refused() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    let capture = |folder: &str, patterns: &str| {
        let folder = place.path(folder);
        laboratory().run(&[
            "capture",
            folder.to_str().unwrap(),
            "--config",
            config.to_str().unwrap(),
            "--patterns",
            patterns,
        ])
    };
    capture("pictures", "white,black").succeeded();
    assert_eq!(files::names(&place.path("pictures")), ["frames"]);
    let mean = |name: &str| {
        let samples = files::picture(&place.path("pictures/frames").join(name)).samples;
        samples.iter().map(|&sample| f64::from(sample)).sum::<f64>() / samples.len() as f64
    };
    assert!(mean("white.png") > mean("black.png") + 10.0);
    let again = capture("pictures", "white");
    assert_eq!(again.code, 73, "{}", again.stderr);
    let odd = place.path("odd.png");
    fs::write(&odd, png_of(3, 2)).unwrap();
    let run = capture("odd", odd.to_str().unwrap());
    assert_eq!(run.code, 65, "{}", run.stderr);
    assert!(run.stderr.contains("3×2 pixels"), "{}", run.stderr);
    let run = capture("none", "/none.png");
    assert_eq!(run.code, 66, "{}", run.stderr);
    assert_eq!(capture("word", "grey").code, 64);
}
