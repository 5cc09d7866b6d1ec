//! The manifest of a recording that is to be written, and the names of its files.

use super::manifest::{
    CameraEntry, CodeEntry, FORMAT, FrameEntry, Manifest, PatternEntries, PatternEntry, VERSION,
};
use super::recording::{PatternSpec, RecordedCode, Recording};
use crate::frame::Frame;

/// The names of the files of frames.
#[derive(Clone, Copy)]
pub(super) enum Names {
    /// By the level and shift, or the bit, that the frame shows: the names of a recording.
    Kinds,
    /// By the frame's `count`.
    Counts,
}

impl Names {
    fn file(self, frame: &Frame, kind: impl FnOnce() -> String) -> String {
        match self {
            Self::Kinds => format!("frames/{}.png", kind()),
            Self::Counts => format!("frames/{:03}.png", frame.count()),
        }
    }

    fn frames<'a>(
        self,
        frames: impl Iterator<Item = &'a Frame>,
        kind: impl Fn(usize) -> String,
    ) -> Vec<(String, &'a Frame)> {
        let named = |(at, frame)| (self.file(frame, || kind(at)), frame);
        frames.enumerate().map(named).collect()
    }

    fn levels(self, recording: &Recording) -> Vec<(String, &Frame)> {
        let frames = recording.frames.iter().map(|recorded| &recorded.frame);
        self.frames(frames, |index| format!("{index:03}"))
    }

    fn bits(self, code: &RecordedCode) -> Vec<(String, &Frame)> {
        let pattern = code.pattern;
        self.frames(code.bits.iter(), |bit| format!("code-{pattern}-{bit:02}"))
    }

    fn inverse(self, code: &RecordedCode) -> Vec<(String, &Frame)> {
        let pattern = code.pattern;
        self.frames(code.inverse.iter(), |bit| {
            format!("code-{pattern}-{bit:02}-inverse")
        })
    }

    fn uniform<'a>(self, frame: &'a Option<Frame>, kind: &str) -> Option<(String, &'a Frame)> {
        let frame = frame.as_ref()?;
        Some((self.file(frame, || kind.to_owned()), frame))
    }

    fn white(self, recording: &Recording) -> Option<(String, &Frame)> {
        self.uniform(&recording.white, "white")
    }

    fn black(self, recording: &Recording) -> Option<(String, &Frame)> {
        self.uniform(&recording.black, "black")
    }
}

/// All frames of a recording with their files: those of its levels first, in their order.
pub(super) fn pictures(recording: &Recording) -> Vec<(String, &Frame)> {
    let names = Names::Kinds;
    let mut all = names.levels(recording);
    for code in &recording.codes {
        all.extend(names.bits(code));
        all.extend(names.inverse(code));
    }
    all.extend(names.white(recording));
    all.extend(names.black(recording));
    all
}

/// File name of a pattern: the format's name for the first pattern from a file, a numbered name for
/// the second.
pub(super) fn phase_file(patterns: &[PatternSpec], index: usize) -> String {
    let first = patterns
        .iter()
        .position(|pattern| matches!(pattern, PatternSpec::File { .. }));
    if first == Some(index) {
        "pattern/phase.npy".to_owned()
    } else {
        format!("pattern/phase-{index}.npy")
    }
}

pub(super) fn manifest_of(recording: &Recording, names: Names) -> Manifest {
    let pattern = |(index, pattern): (usize, &PatternSpec)| match pattern {
        PatternSpec::Vertical { fringes } => PatternEntry::Vertical { fringes: *fringes },
        PatternSpec::Horizontal { fringes } => PatternEntry::Horizontal { fringes: *fringes },
        PatternSpec::File { .. } => PatternEntry::File {
            file: phase_file(&recording.patterns, index),
        },
    };
    let files = |named: Vec<(String, &Frame)>| -> Vec<String> {
        named.into_iter().map(|(file, _)| file).collect()
    };
    let level_files = files(names.levels(recording));
    let frames = recording
        .frames
        .iter()
        .zip(level_files)
        .map(|(frame, file)| FrameEntry {
            file,
            ratio: frame.ratio,
            shift_turns: frame.shift_turns,
            timestamp_ns: frame.timestamp_ns,
            pattern: frame.pattern,
            harmonics: frame.harmonics.clone(),
        });
    let codes = recording.codes.iter().map(|code| CodeEntry {
        pattern: code.pattern,
        cell_px: code.cell_px,
        offset_px: code.offset_px,
        binary: code.binary,
        inverted: code.inverted,
        bits: files(names.bits(code)),
        inverse: files(names.inverse(code)),
    });
    let manifest = Manifest {
        format: FORMAT.to_owned(),
        version: VERSION,
        description: recording.description.clone(),
        notes: recording.notes.clone(),
        source: recording.source.clone(),
        camera: CameraEntry {
            width: recording.width,
            height: recording.height,
            bit_depth: recording.bit_depth,
            model: recording.camera_model.clone(),
            noise_counts: recording.noise_counts,
        },
        projector: recording.projector.clone(),
        pattern: PatternEntries(recording.patterns.iter().enumerate().map(pattern).collect()),
        frames: frames.collect(),
        codes: codes.collect(),
        white: names.white(recording).map(|(file, _)| file),
        black: names.black(recording).map(|(file, _)| file),
        range_mm: recording.range_mm,
        exposure_us: recording.exposure_us,
        part_id: recording.part_id.clone(),
        recipe: recording.recipe.clone(),
    };
    Manifest {
        version: manifest.least_version(),
        ..manifest
    }
}
