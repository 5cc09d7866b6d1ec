//! The shared recordings beside the project, if they are there: they can be opened and have the
//! contents in their README.

use hal::replay::recording::PatternSpec;
use tests::shared;

#[test]
fn every_shared_recording_opens() {
    for (name, size, frames, patterns) in [
        ("slstudio-board2", (1688, 1352), 12, 2),
        ("slstudio-skull", (1688, 1352), 6, 1),
        ("study-cone-adaptive", (256, 256), 12, 1),
        ("study-sphere-fixed81", (256, 256), 12, 1),
        ("study-spline-dense121", (256, 256), 12, 1),
    ] {
        let Some((_, recording)) = shared::recording(name) else {
            return;
        };
        assert_eq!((recording.width, recording.height), size, "{name}");
        assert_eq!(recording.frames.len(), frames, "{name}");
        assert_eq!(recording.patterns.len(), patterns, "{name}");
        assert!(
            recording.camera_model.is_some() && recording.projector.model.is_some(),
            "{name}"
        );
        let rendered = name.starts_with("study");
        assert_eq!(recording.truth_height.is_some(), rendered, "{name}");
        assert_eq!(recording.truth_class.is_some(), rendered, "{name}");
    }
    let (_, cone) = shared::recording("study-cone-adaptive").unwrap();
    assert!(matches!(
        cone.patterns[0],
        PatternSpec::File {
            rows: 768,
            columns: 1024,
            ..
        }
    ));
}
