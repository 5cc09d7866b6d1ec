//! The scene of a replay head: the index of the pattern in view selects the recorded frame.

use std::time::Duration;

use super::recording::Recording;
use crate::error::Error;
use crate::frame::{Frame, FrameFormat};
use crate::head::Head;
use crate::projector::Raster;
use crate::units::Timestamp;
use crate::virtual_head::{self, Mechanics, Scene};

/// Refresh period of the replayed projector, 60 Hz.
const REFRESH: Duration = Duration::from_nanos(16_666_667);
/// Exposure of the replayed camera, refreshes.
const EXPOSURE_REFRESHES: u32 = 2;

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
    for (index, other) in recordings.iter().enumerate() {
        if describe(other) != describe(first) {
            return Err(Error::unsupported(
                format!(
                    "replaying recording {index} with {} after recording 0 with {}",
                    describe(other),
                    describe(first)
                ),
                "replay recordings of one head and one kind of sequence together",
            ));
        }
        let mut pairs = other.frames.iter().zip(&first.frames);
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
        seen: &[(Option<usize>, f32)],
        timestamp: Timestamp,
        count: u64,
    ) -> Result<Frame, Error> {
        let index = match seen {
            [(Some(index), _)] if *index < self.played.len() => *index,
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
