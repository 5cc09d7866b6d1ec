//! Tests with small recordings: written, opened, played, and damaged in every way that format 1
//! forbids.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::recording::{PatternSpec, RecordedCode, RecordedFrame, RecordedProjector, Recording};
use super::{RecordingError, head, recorder};
use crate::contract::check_head;
use crate::error::ErrorKind;
use crate::frame::{Frame, FrameFormat, Pixels, Samples};
use crate::model::{DeviceModel, PlaneModel};
use crate::projector::Raster;
use crate::units::Timestamp;

fn model() -> DeviceModel {
    DeviceModel {
        fx: 10.0,
        fy: 10.5,
        cx: 3.5,
        cy: 2.5,
        distortion: [0.1, -0.2, 1e-4, 2e-4, 0.0],
        rotation: [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0],
        translation_mm: [0.0, 0.0, 600.0],
    }
}

/// Two patterns, two levels of 3 and 4 shifts; the frames are seeded noise.
fn small(bit_depth: u8, seed: u64) -> Recording {
    let format = FrameFormat::packed(8, 6, bit_depth);
    let mut random = SplitMix64::seed_from_u64(seed);
    let mut frames = Vec::new();
    for (pattern, ratio, shifts) in [(0, 0.25, 3), (1, 1.0, 4)] {
        for shift in 0..shifts {
            let mut pixels = Pixels::zeroed(&format);
            match &mut pixels {
                Pixels::Eight(samples) => random.fill_bytes(samples),
                Pixels::Sixteen(samples) => samples.fill_with(|| {
                    (random.next_u32() % (u32::from(format.full_scale()) + 1)) as u16
                }),
            }
            let count = frames.len() as u64;
            frames.push(RecordedFrame {
                ratio,
                shift_turns: f64::from(shift) / f64::from(shifts) - 0.3,
                harmonics: Vec::new(),
                pattern,
                timestamp_ns: Some(1000 * count),
                frame: Frame::new(format, Arc::new(pixels), Timestamp(1000 * count), count)
                    .unwrap(),
            });
        }
    }
    Recording {
        width: 8,
        height: 6,
        bit_depth,
        description: "seeded noise".into(),
        notes: Vec::new(),
        source: "this test".into(),
        camera_model: Some(model()),
        noise_counts: Some(3.7),
        projector: RecordedProjector {
            width: 5,
            height: 4,
            model: Some(model()),
            plane: Some(PlaneModel {
                xi: [0.5; 28],
                eta: [-0.25; 28],
            }),
        },
        patterns: vec![
            PatternSpec::Vertical { fringes: 16.0 },
            PatternSpec::File {
                rows: 4,
                columns: 5,
                turns: (0..20).map(|i| f64::from(i) * 0.1).collect(),
            },
        ],
        frames,
        codes: Vec::new(),
        white: None,
        black: None,
        range_mm: Some([-20.0, 30.5]),
        exposure_us: Some(33_333.0),
        part_id: Some("A-1".into()),
        recipe: None,
        truth_height: Some(
            (0..48)
                .map(|i| if i == 7 { f32::NAN } else { i as f32 })
                .collect(),
        ),
        truth_class: Some(vec![2; 48]),
    }
}

/// [`small`] with a Gray code of three bits over the 5 columns, and pictures under white and black.
fn coded(bit_depth: u8, inverse: bool) -> Recording {
    let mut recording = small(bit_depth, 3);
    let frame = |at: usize| {
        let frame = &small(bit_depth, 4 + at as u64).frames[0].frame;
        let pixels = match frame.samples() {
            Samples::Eight(samples) => Pixels::Eight(samples.to_vec()),
            Samples::Sixteen(samples) => Pixels::Sixteen(samples.to_vec()),
        };
        Frame::new(frame.format(), Arc::new(pixels), Timestamp(0), 0).unwrap()
    };
    recording.codes = vec![RecordedCode {
        pattern: 0,
        cell_px: 1.0,
        offset_px: 0.0,
        binary: false,
        inverted: false,
        bits: (0..3).map(frame).collect(),
        inverse: (3..if inverse { 6 } else { 3 }).map(frame).collect(),
    }];
    recording.white = Some(frame(6));
    recording.black = Some(frame(7));
    recording
}

fn written(folder: &Path, recording: &Recording) -> std::path::PathBuf {
    let path = folder.join("r");
    recorder::write(recording, &path).unwrap();
    path
}

#[test]
fn a_recording_that_was_written_opens_as_the_same() {
    let plain = [8, 10, 12, 16].map(|bit_depth| (small(bit_depth, 1), 1));
    let mut moved = coded(8, false);
    (moved.codes[0].offset_px, moved.codes[0].inverted) = (2.5, true);
    let mut noted = small(8, 1);
    noted.notes = vec!["the light was off".into()];
    let later = [
        (coded(8, true), 2),
        (coded(12, false), 2),
        (moved, 3),
        (noted, 3),
    ];
    for (before, version) in plain.into_iter().chain(later) {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path(), &before);
        let after = Recording::open(&path).unwrap();
        // NaN is not equal to itself, so the truth is compared by its bits and the rest by its
        // text.
        let bits = |r: &Recording| -> Vec<u32> {
            r.truth_height
                .as_ref()
                .unwrap()
                .iter()
                .map(|mm| mm.to_bits())
                .collect()
        };
        assert_eq!(bits(&before), bits(&after));
        let manifest = fs::read_to_string(path.join("recording.json")).unwrap();
        let line = format!("\"version\": {version},");
        assert!(manifest.contains(&line), "older programs read version 1");
        assert_eq!(format!("{before:?}"), format!("{after:?}"));
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "no temporary folder stays behind"
        );
    }
}

#[test]
fn an_existing_folder_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &small(8, 1));
    assert!(matches!(
        recorder::write(&small(8, 2), &path),
        Err(recorder::RecorderError::Exists { .. })
    ));
}

#[test]
fn a_recording_that_could_not_be_opened_again_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r");
    let mut uneven = small(8, 1);
    uneven.frames[0].shift_turns = 0.1;
    let mut shallow = small(12, 1);
    shallow.bit_depth = 10;
    let mut cut = small(8, 1);
    cut.truth_class = Some(vec![0; 3]);
    for bad in [uneven, shallow, cut] {
        assert!(matches!(
            recorder::write(&bad, &path),
            Err(recorder::RecorderError::Content { .. })
        ));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

/// Opens a recording after `damage` was done to its folder.
fn damaged(bit_depth: u8, damage: impl FnOnce(&Path)) -> RecordingError {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &small(bit_depth, 1));
    damage(&path);
    Recording::open(&path).unwrap_err()
}

#[test]
fn every_wrong_manifest_is_refused_with_a_message_that_names_the_fault() {
    for (from, to, expected) in [
        (
            "\"version\": 1",
            "\"version\": 4, \"new\": 1",
            "version 4 is newer than this program reads (3): update fringed",
        ),
        ("\"version\": 1", "\"version\": \"1\"", "version"),
        ("fringed-recording", "other", "format is \"other\""),
        ("\"description\"", "\"remark\"", "unknown field `remark`"),
        (
            "\"fringes\": 16.0",
            "\"fringes\": 16.0, \"pitch\": 3",
            "unknown field `pitch`",
        ),
        ("\"fringes\": 16.0", "\"fringes\": 0.0", "0 fringes"),
        (
            "\"fringes\": 16.0",
            "\"fringes\": 1e999",
            "number out of range",
        ),
        ("\"vertical\"", "\"diagonal\"", "diagonal"),
        ("\"width\": 8", "\"width\": 0", "camera.width is 0"),
        (
            "\"width\": 8",
            "\"width\": 9",
            "expected 9×6 pixels, got 8×6",
        ),
        ("\"width\": 8", "\"width\": 8193", "camera.width is 8193"),
        (
            "\"width\": 5",
            "\"width\": 6",
            "expected the projector's 4 rows × 6 columns, got 4×5",
        ),
        (
            "\"bit_depth\": 8",
            "\"bit_depth\": 7",
            "camera.bit_depth is 7",
        ),
        (
            "\"bit_depth\": 8",
            "\"bit_depth\": 10",
            "expected a still grey picture of 16 bits",
        ),
        ("\"ratio\": 0.25", "\"ratio\": -0.25", "ratio is -0.25"),
        (
            "\"ratio\": 0.25",
            "\"ratio\": 0.26",
            "ratio 0.26 (pattern 0) has 1 frames",
        ),
        (
            "\"shift_turns\": -0.3",
            "\"shift_turns\": -0.30001",
            "not equally spaced",
        ),
        ("\"pattern\": 1\n", "\"pattern\": 2\n", "names pattern 2"),
        ("frames/000.png", "../000.png", "does not lie inside"),
        ("frames/000.png", "/000.png", "does not lie inside"),
        (
            "frames/000.png",
            "frames/none.png",
            "none.png: the file is missing",
        ),
        (
            "\"noise_counts\": 3.7",
            "\"noise_counts\": 0",
            "camera.noise_counts is 0",
        ),
        ("-20.0,", "40.0,", "range_mm is [40.0, 30.5]"),
        (
            "\"exposure_us\": 33333.0",
            "\"exposure_us\": -1",
            "exposure_us is -1",
        ),
    ] {
        let error = damaged(8, |path| {
            let file = path.join("recording.json");
            let text = fs::read_to_string(&file).unwrap();
            assert!(text.contains(from), "{from} in {text}");
            fs::write(&file, text.replacen(from, to, 1)).unwrap();
        });
        let message = error.to_string();
        assert!(message.contains(expected), "{to}: {message}");
        assert!(!error.is_missing(), "{message}");
    }
}

#[test]
fn every_wrong_code_is_refused_with_a_message_that_names_the_fault() {
    for (from, to, expected) in [
        ("\"cell_px\": 1.0", "\"cell_px\": 0.5", "cell_px is 0.5"),
        (
            "\"cell_px\": 1.0",
            "\"cell_px\": 1e999",
            "number out of range",
        ),
        (
            "\"cell_px\": 1.0",
            "\"cell_px\": 1.0, \"pattern\": 1",
            "codes names pattern 1",
        ),
        (
            "\"frames/code-0-00.png\",",
            "",
            "2 bits and 3 inverse pictures",
        ),
        (
            "\"frames/code-0-00.png\"",
            "\"../code-0-00.png\"",
            "does not lie inside",
        ),
        (
            "\"frames/black.png\"",
            "\"frames/none.png\"",
            "none.png: black: the file is missing",
        ),
        ("\"width\": 5", "\"width\": 9", "3 bits number 8 cells"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path(), &coded(8, true));
        let file = path.join("recording.json");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{from} in {text}");
        fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let message = Recording::open(&path).unwrap_err().to_string();
        assert!(message.contains(expected), "{to}: {message}");
    }
}

#[test]
fn every_wrong_file_is_refused_with_a_message_that_names_it() {
    let cut = |file: &'static str, keep: usize| {
        move |path: &Path| {
            let bytes = fs::read(path.join(file)).unwrap();
            fs::write(path.join(file), &bytes[..bytes.len() - keep]).unwrap();
        }
    };
    for (file, error) in [
        ("frames/001.png", damaged(8, cut("frames/001.png", 20))),
        ("frames/001.png", damaged(12, cut("frames/001.png", 8))),
        ("pattern/phase.npy", damaged(8, cut("pattern/phase.npy", 1))),
        ("truth/height.npy", damaged(8, cut("truth/height.npy", 4))),
        ("truth/class.npy", damaged(8, cut("truth/class.npy", 1))),
    ] {
        let message = error.to_string();
        assert!(message.contains(file), "{message}");
        assert!(!error.is_missing(), "{message}");
    }
}

#[test]
fn a_sample_above_the_full_scale_of_the_camera_is_refused() {
    let error = damaged(10, |path| {
        let file = path.join("recording.json");
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replace("\"bit_depth\": 10", "\"bit_depth\": 9")).unwrap();
    });
    assert!(
        error
            .to_string()
            .contains("a camera of 9 bits gives at most 511"),
        "{error}"
    );
}

#[cfg(unix)]
#[test]
fn a_frame_that_is_a_link_out_of_the_folder_is_refused() {
    let outside = tempfile::NamedTempFile::new().unwrap();
    let error = damaged(8, |path| {
        let file = path.join("frames/003.png");
        fs::copy(&file, outside.path()).unwrap();
        fs::remove_file(&file).unwrap();
        std::os::unix::fs::symlink(outside.path(), &file).unwrap();
    });
    assert!(
        error
            .to_string()
            .contains("003.png: the file is a link out of the folder"),
        "{error}"
    );
}

#[test]
fn a_recording_that_is_not_there_is_missing_and_nothing_else_is() {
    let folder = tempfile::tempdir().unwrap();
    assert!(
        Recording::open(&folder.path().join("none"))
            .unwrap_err()
            .is_missing()
    );
    assert!(
        Recording::open(folder.path()).unwrap_err().is_missing(),
        "no recording.json"
    );
    fs::write(folder.path().join("recording.json"), "{").unwrap();
    assert!(!Recording::open(folder.path()).unwrap_err().is_missing());
}

#[test]
fn no_damage_to_any_byte_makes_opening_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &small(12, 1));
    let mut random = SplitMix64::seed_from_u64(2024);
    let mut opened = 0;
    for file in [
        "recording.json",
        "frames/000.png",
        "pattern/phase.npy",
        "truth/height.npy",
        "truth/class.npy",
    ] {
        let file = path.join(file);
        let whole = fs::read(&file).unwrap();
        for _ in 0..1500 {
            let mut bytes = whole.clone();
            for _ in 0..=random.next_u32() % 3 {
                let at = random.next_u64() as usize % bytes.len();
                match random.next_u32() % 4 {
                    0 => bytes[at] = random.next_u32() as u8,
                    1 => bytes[at] ^= 1 << (random.next_u32() % 8),
                    2 => bytes.truncate(at.max(1)),
                    _ => bytes[at] = b"0123456789(){}[],:\"'-e\\"[random.next_u64() as usize % 23],
                }
            }
            fs::write(&file, &bytes).unwrap();
            opened += usize::from(Recording::open(&path).is_ok());
        }
        fs::write(&file, &whole).unwrap();
    }
    assert!(
        opened > 100,
        "some damage is to numbers only and opens: {opened}"
    );
}

#[test]
fn a_replay_head_keeps_the_contract() {
    check_head(&mut head(vec![small(8, 1), small(8, 2)]).unwrap(), 7).unwrap();
    check_head(&mut head(vec![small(12, 1)]).unwrap(), 7).unwrap();
}

#[test]
fn a_replay_head_gives_frame_k_for_pattern_k_and_the_recordings_in_turn() {
    let recordings = vec![small(8, 1), small(8, 2)];
    let mut head = head(recordings.clone()).unwrap();
    head.load(vec![Raster::uniform(5, 4, 0).unwrap(); 7])
        .unwrap();
    for turn in 0..5 {
        head.acquire(
            &[6, 0, 1, 2, 3, 4, 5],
            Duration::from_secs(1),
            &mut |index, frame| {
                let expected = &recordings[turn % 2].frames[index].frame;
                assert_eq!(
                    frame.samples(),
                    expected.samples(),
                    "turn {turn}, pattern {index}"
                );
                assert!(matches!(frame.samples(), Samples::Eight(_)));
            },
        )
        .unwrap();
    }
}

#[test]
fn a_replay_head_refuses_another_number_of_rasters_and_unlike_recordings() {
    let mut one = head(vec![small(8, 1)]).unwrap();
    let error = one
        .load(vec![Raster::uniform(5, 4, 0).unwrap(); 6])
        .unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Protocol);
    assert!(error.to_string().contains("6 rasters") && error.to_string().contains("7 recorded"));
    assert!(head(vec![]).is_err());
    assert!(head(vec![small(8, 1), small(12, 1)]).is_err());
    let mut other = small(8, 2);
    other.frames[1].shift_turns += 0.125;
    let refused = head(vec![small(8, 1), other]).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("frame 1"), "{refused}");
}
