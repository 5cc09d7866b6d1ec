//! How many refreshes a triggered camera needs for each pattern: the fewest at which no trigger is
//! lost.
//!
//! A camera that is still being read out loses a trigger without a sign, and its data sheet leaves
//! out its own delays. So triggers are fired at the spacing of a sequence and their frames are
//! counted. They are fired a little closer than the refreshes, because in a sequence a trigger may
//! come late and the next one on time.

use super::{PATIENCE, load_black_and_white, refreshes};
use hal::camera::Starts;
use hal::error::Error;
use hal::head::{Head, Showing, TOLERANCE};
use std::collections::BTreeSet;
use std::time::Duration;

/// Triggers that are fired at each spacing. If one in twenty is lost, that remains unnoticed once
/// in twenty measurements (0.95⁶⁰ = 0.046).
const TRIGGERS: u32 = 60;
/// By how much triggers are fired closer than the refreshes: as late as one may be in a plan of the
/// sequencer.
const CLOSER: Duration = Duration::from_nanos(TOLERANCE.as_nanos() as u64 / 2);
/// Spacings that are tried beyond the shortest that the camera states, refreshes.
const MORE: u32 = 3;

/// What became of triggers that were so many refreshes apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spaced {
    /// Refreshes from trigger to trigger.
    pub refreshes: u32,
    /// Triggers.
    pub triggers: usize,
    /// Frames.
    pub frames: usize,
}

impl Spaced {
    /// Whether each trigger gave a frame.
    pub fn none_lost(&self) -> bool {
        self.frames >= self.triggers
    }

    /// What was found, for people.
    pub fn words(&self) -> String {
        let Self {
            refreshes,
            triggers,
            frames,
        } = self;
        format!("{frames} frames for {triggers} triggers {refreshes} refreshes apart")
    }
}

/// Tries spacings from the shortest that the camera states on, until none of the triggers is lost.
/// The last one tried is the last of the result, which is empty for a camera that runs by itself. A
/// camera that the projector triggers takes one refresh in so many by itself.
///
/// # Errors
/// The error of a device.
pub fn pace(head: &mut Head) -> Result<Vec<Spaced>, Error> {
    let (camera, refresh) = (head.camera_timing(), head.refresh());
    let mut tried = Vec::new();
    if camera.starts == Starts::ByItself {
        return Ok(tried);
    }
    load_black_and_white(head)?;
    if camera.starts == Starts::ByProjector {
        return by_projector(head);
    }
    let least = refreshes(head, camera.period).clamp(1, 1000);
    for refreshes in least..=least + MORE {
        let showing = Showing {
            index: 0,
            refreshes: refreshes * TRIGGERS,
            settle: 0,
        };
        let spacing = (refresh * refreshes).saturating_sub(CLOSER);
        let seen = head.watch_spaced(&[showing], spacing, PATIENCE, &mut |_| ())?;
        // A frame that arrives twice is one frame.
        let frames: BTreeSet<u64> = seen.frames.iter().map(|frame| frame.count).collect();
        tried.push(Spaced {
            refreshes,
            triggers: seen.triggers.len(),
            frames: frames.len(),
        });
        if tried.last().is_some_and(Spaced::none_lost) {
            break;
        }
    }
    Ok(tried)
}

/// The largest distance of two frames of a camera that the projector triggers.
fn by_projector(head: &mut Head) -> Result<Vec<Spaced>, Error> {
    let refresh = head.refresh();
    let showing = Showing {
        index: 0,
        refreshes: MORE * TRIGGERS,
        settle: 0,
    };
    let frames = head.watch(&[showing], PATIENCE, &mut |_| ())?.frames;
    let apart = frames.windows(2).filter_map(|pair| {
        let [before, after] = pair else { return None };
        // A frame that was lost on its way says nothing of the camera.
        let next = after.count == before.count + 1;
        next.then(|| after.start.since(before.start).as_secs_f64() / refresh.as_secs_f64())
    });
    let largest = apart.fold(0.0, f64::max).round() as u32;
    Ok((largest > 0)
        .then_some(Spaced {
            refreshes: largest,
            triggers: frames.len(),
            frames: frames.len(),
        })
        .into_iter()
        .collect())
}
