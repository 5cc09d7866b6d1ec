//! The recordings of failed parts: a folder with a quota, the oldest go first.

use crate::calibration::Calibration;
use crate::plan::Plan;
use crate::recipe::PatternFile;
use crate::station::{ResultRecord, Verdict};
use hal::frame::Frame;
use hal::replay::Recording;
use hal::replay::recorder::{self, RecorderError};
use hal::replay::recording::{PatternSpec, RecipeReference, RecordedFrame, RecordedProjector};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

/// A part that did not pass, and what it was judged by.
#[derive(Debug)]
pub struct FailedPart {
    /// The result.
    pub record: Arc<ResultRecord>,
    /// The frames that it was judged by.
    pub frames: Vec<Frame>,
    /// What judged it.
    pub plan: Arc<Plan>,
    /// The head's calibration.
    pub calibration: Calibration,
}

impl FailedPart {
    /// Writes the frames as the new folder `folder`.
    ///
    /// # Errors
    /// [`RecorderError`]; nothing of it is left then.
    pub fn write(&self, folder: &Path) -> Result<(), RecorderError> {
        recorder::write(&recording(self), folder)
    }
}

/// The folder.
#[derive(Debug)]
pub(super) struct Recordings {
    folder: PathBuf,
    /// Name and bytes, oldest first.
    kept: VecDeque<(String, u64)>,
    quota: u64,
}

impl Recordings {
    /// Opens the folder and removes what a kill left half written. `quota` in bytes.
    ///
    /// # Errors
    /// Whatever the file system answers.
    pub(super) fn open(folder: &Path, quota: u64) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let mut kept = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with('.') && name.contains(".partial-") {
                fs::remove_dir_all(entry.path())?;
            } else if seq_of(&name).is_some() {
                kept.push((name, bytes_in(&entry.path())));
            }
        }
        kept.sort();
        Ok(Self {
            folder: folder.to_path_buf(),
            kept: kept.into(),
            quota,
        })
    }

    /// The names of the recordings, oldest first.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.kept.iter().map(|(name, _)| name.as_str())
    }

    /// Writes the frames of a failed part; answers with the recording's name.
    ///
    /// # Errors
    /// [`RecorderError`]; nothing of it is left then.
    pub(super) fn keep(&mut self, part: &FailedPart) -> Result<String, RecorderError> {
        let name = name_of(&part.record);
        let folder = self.folder.join(&name);
        part.write(&folder)?;
        self.kept.push_back((name.clone(), bytes_in(&folder)));
        Ok(name)
    }

    /// Removes the oldest recording while all together are over the quota; answers with its name.
    pub(super) fn over_quota(&mut self) -> Option<String> {
        let all: u64 = self.kept.iter().map(|(_, bytes)| bytes).sum();
        if all > self.quota {
            self.remove_oldest()
        } else {
            None
        }
    }

    /// Removes the oldest recording; answers with its name.
    pub(super) fn remove_oldest(&mut self) -> Option<String> {
        let (name, _) = self.kept.pop_front()?;
        // Whatever stays of it is counted again at the next start.
        let _ = fs::remove_dir_all(self.folder.join(&name));
        Some(name)
    }
}

/// `0000000042-0003-fail`: SEQ, recipe, verdict. In the order of their names they are in the order of their SEQs.
fn name_of(record: &ResultRecord) -> String {
    let verdict = match record.verdict {
        Verdict::Fail => "fail",
        _ => "invalid",
    };
    format!("{:010}-{:04}-{verdict}", record.seq, record.recipe)
}

/// The SEQ in a recording's name.
pub(super) fn seq_of(name: &str) -> Option<u32> {
    let (seq, _) = name.split_once('-')?;
    if seq.len() == 10 {
        seq.parse().ok()
    } else {
        None
    }
}

/// Bytes of all files below a folder; what cannot be read counts nothing.
fn bytes_in(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(found) if found.is_dir() => bytes_in(&entry.path()),
            Ok(found) => found.len(),
            Err(_) => 0,
        })
        .sum()
}

fn recording(part: &FailedPart) -> Recording {
    let FailedPart {
        record,
        frames,
        plan,
        calibration,
    } = part;
    let file = plan.file();
    let (width, height, bit_depth) = calibration.camera;
    let shown = plan.shown(frames.len());
    let steps = shown.iter().zip(frames);
    Recording {
        width,
        height,
        bit_depth,
        description: format!(
            "result {}, recipe {}, {}",
            record.seq,
            record.recipe,
            record.verdict.word()
        ),
        source: "kept by fringed".into(),
        camera_model: Some(calibration.camera_model.clone()),
        noise_counts: Some(calibration.noise_counts),
        projector: RecordedProjector {
            width: calibration.projector.0,
            height: calibration.projector.1,
            model: Some(calibration.projector_model.clone()),
        },
        patterns: vec![pattern(plan)],
        frames: steps
            .map(|(&(ratio, shift_turns), frame)| RecordedFrame {
                ratio,
                shift_turns,
                pattern: 0,
                timestamp_ns: Some(frame.timestamp().0),
                frame: frame.clone(),
            })
            .collect(),
        range_mm: Some(file.range_mm),
        exposure_us: file.exposure_us,
        part_id: Some(record.part_id.to_string()),
        recipe: Some(RecipeReference {
            number: u32::from(file.number),
            fingerprint: file.fingerprint.clone(),
        }),
        truth_height: None,
        truth_class: None,
    }
}

fn pattern(plan: &Plan) -> PatternSpec {
    match plan.file().pattern {
        PatternFile::Vertical { fringes } => PatternSpec::Vertical { fringes },
        PatternFile::Horizontal { fringes } => PatternSpec::Horizontal { fringes },
        PatternFile::File => {
            let function = plan.production().triangulator().function();
            let (rows, columns) = (function.rows(), function.columns());
            let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
            PatternSpec::File {
                rows,
                columns,
                turns: pixels
                    .map(|(column, row)| function.at_pixel(column, row))
                    .collect(),
            }
        }
    }
}
