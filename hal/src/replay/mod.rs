//! The replay back-end: recordings in format 1 to 3 are read, written, and played as a head, whose
//! frames are selected by the index of the pattern in view.

mod check;
mod entries;
mod grey;
mod manifest;
pub mod recorder;
pub mod recording;

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::bounds::shortened;
use crate::error::Error;
use crate::frame::{Frame, FrameFormat};
use crate::head::Head;
use crate::projector::Raster;
use crate::units::Timestamp;
use crate::virtual_head::{self, InView, Mechanics, Scene};
pub use recording::Recording;

/// Refresh period of the replayed projector, 60 Hz.
const REFRESH: Duration = Duration::from_nanos(16_666_667);
/// Exposure of the replayed camera, refreshes.
const EXPOSURE_REFRESHES: u32 = 2;

/// A recording that cannot be opened. The message names the file and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// The named folder, or its `recording.json`, does not exist.
    #[error("open recording {}: no such {what}: name a folder that holds a recording.json", path.display())]
    Missing {
        /// What was looked for.
        path: PathBuf,
        /// "folder" or "recording.json".
        what: &'static str,
    },
    /// Something in the folder is wrong; this includes a missing file that the manifest names.
    #[error("open recording {}: {wrong}", path.display())]
    Content {
        /// The file that is wrong.
        path: PathBuf,
        /// What is wrong with it.
        wrong: Wrong,
    },
}

/// What is wrong with a file of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}: {remedy}")]
pub struct Wrong {
    /// What is wrong, with the numbers.
    problem: String,
    /// What to do about it.
    remedy: String,
}

impl RecordingError {
    /// Whether the recording does not exist at all, as opposed to having wrong content.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing { .. })
    }
}

impl Wrong {
    pub(crate) fn new(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            problem: shortened(&problem.into()),
            remedy: remedy.into(),
        }
    }

    /// This problem, naming the key of the manifest that is concerned.
    pub(crate) fn under(self, key: &str) -> Self {
        Self {
            problem: format!("{key}: {}", self.problem),
            ..self
        }
    }

    /// The error of opening the recording in which the file `path` is wrong.
    pub(crate) fn at(self, path: &Path) -> RecordingError {
        RecordingError::Content {
            path: path.to_path_buf(),
            wrong: self,
        }
    }
}

/// A head that plays `recordings` one after the other, then from the first again.
///
/// Pattern k gives recorded frame k, with the time and count of the replay. As many rasters must be
/// loaded as a recording has frames. When each frame of a recording was given at least once, the
/// next recording is played.
///
/// # Errors
/// `Unsupported` if there is no recording, or if they differ in camera format, projector size,
/// number of frames, or ratio and shift of a frame.
pub fn head(recordings: Vec<Recording>) -> Result<Head, Error> {
    let Some(first) = recordings.first() else {
        return Err(Error::unsupported(
            "replaying 0 recordings",
            "name at least one",
        ));
    };
    if first.frames.is_empty() {
        return Err(Error::unsupported(
            "replaying a recording of a Gray code without fringes",
            "name one with fringes",
        ));
    }
    let describe = |r: &Recording| {
        format!(
            "{} frames of {} under a {}×{} projector",
            r.frames.len(),
            r.format().describe(),
            r.projector.width,
            r.projector.height
        )
    };
    for (index, next) in recordings.iter().enumerate() {
        if describe(next) != describe(first) {
            return Err(Error::unsupported(
                format!(
                    "replaying recording {index} with {} after recording 0 with {}",
                    describe(next),
                    describe(first)
                ),
                "replay recordings of one head and one kind of sequence together",
            ));
        }
        let mut pairs = next.frames.iter().zip(&first.frames);
        let differs = pairs.position(|(a, b)| (a.ratio, a.shift_turns) != (b.ratio, b.shift_turns));
        if let Some(frame) = differs {
            return Err(Error::unsupported(
                format!(
                    "replaying recording {index}, whose frame {frame} shows another ratio or shift than that of recording 0"
                ),
                "replay recordings of one sequence together",
            ));
        }
    }
    let scene = Played {
        played: vec![false; first.frames.len()],
        recordings,
        current: 0,
        loaded: 0,
    };
    Ok(virtual_head::head(scene, Mechanics::plain(REFRESH, EXPOSURE_REFRESHES)).0)
}

struct Played {
    recordings: Vec<Recording>,
    current: usize,
    /// Which frames of the current recording were given.
    played: Vec<bool>,
    loaded: usize,
}

impl Scene for Played {
    fn format(&self) -> FrameFormat {
        self.recordings[self.current].format()
    }

    fn projector_size(&self) -> (u32, u32) {
        let projector = &self.recordings[self.current].projector;
        (projector.width, projector.height)
    }

    fn load(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        let recorded = self.played.len();
        let loaded = kept + rasters.len();
        if kept == recorded && loaded > recorded {
            return Err(Error::unsupported(
                "loading patterns beside those of a recording",
                "use a head that can show them",
            ));
        }
        if loaded != recorded {
            return Err(Error::protocol(
                format!("loading {loaded} rasters to replay {recorded} recorded frames"),
                format!("load {recorded} rasters, one per recorded frame"),
            ));
        }
        self.loaded = recorded;
        Ok(())
    }

    fn loaded(&self) -> usize {
        self.loaded
    }

    fn expose(
        &mut self,
        seen: &[InView],
        timestamp: Timestamp,
        count: u64,
    ) -> Result<Frame, Error> {
        let index = match seen {
            [
                InView {
                    pattern: Some(index),
                    ..
                },
            ] if *index < self.played.len() => *index,
            _ => {
                return Err(Error::protocol(
                    "replaying a frame with no pattern in view, or several",
                    "show a pattern before triggering; nothing else was recorded",
                ));
            }
        };
        let frame = self.recordings[self.current].frames[index]
            .frame
            .restamped(timestamp, count);
        self.played[index] = true;
        if self.played.iter().all(|played| *played) {
            self.played.fill(false);
            self.current = (self.current + 1) % self.recordings.len();
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests;
