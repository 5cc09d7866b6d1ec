//! Promises of the head: each frame that it returns shows the pattern that the frame names,
//! whatever the devices do.

mod aside;
mod exposures;
mod schedules;
mod sequences;
mod streaming;
mod watching;

use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::frame::{Pixels, Samples};
use crate::projector::Raster;
use crate::virtual_head::{self, Faults, FreeRunning, InView, Mechanics, Scene};

/// A camera that runs by itself, with this period, and from its start to its first exposure `phase`.
fn free_running(period: Duration, phase: Duration) -> Option<FreeRunning> {
    Some(FreeRunning { period, phase })
}

const REFRESH: Duration = Duration::from_micros(16_667);
const TIMEOUT: Duration = Duration::from_millis(500);
const SHARES: f32 = 65535.0;
/// How much longer than planned an exposure may be, plus the rounding of a label.
const HALF_A_PERCENT: f32 = 0.005 + 1.0 / SHARES;

/// A scene whose samples state which pattern a frame shows, how much of others, and how much too
/// long it was exposed.
///
/// They are computed from the light alone, so they judge the sequencer independently of its stamps
/// and counts.
#[derive(Default)]
struct Labels {
    loaded: usize,
    /// Receives a message for each exposure.
    exposed: Option<mpsc::Sender<()>>,
}

const FORMAT: FrameFormat = FrameFormat {
    width: 3,
    height: 1,
    stride: 3,
    bit_depth: 16,
};

impl Scene for Labels {
    fn format(&self) -> FrameFormat {
        FORMAT
    }

    fn projector_size(&self) -> (u32, u32) {
        (1, 1)
    }

    fn load(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        self.loaded = kept + rasters.len();
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
        if let Some(exposed) = &self.exposed {
            exposed.send(()).unwrap();
        }
        let longest = seen.iter().max_by(|a, b| a.share.total_cmp(&b.share));
        let InView { pattern, share } = *longest.unwrap();
        let label = pattern.map_or(0, |index| index as u16 + 1);
        let sum: f32 = seen.iter().map(|seen| seen.share).sum();
        // The cast saturates at a share of 1, which is enough.
        let sample = |share: f32| (share * SHARES).round() as u16;
        let pixels = Pixels::Sixteen(vec![label, sample(sum - share), sample(sum - 1.0)]);
        Frame::new(FORMAT, Arc::new(pixels), timestamp, count)
    }
}

/// What the samples of a frame state.
#[derive(Debug, PartialEq)]
struct Label {
    /// The pattern that it shows.
    shown: Option<usize>,
    /// The share of the planned exposure for which it shows other patterns.
    others: f32,
    /// How much too long its exposure was, as a share of the planned exposure.
    longer: f32,
}

fn label(frame: &Frame) -> Label {
    match frame.samples() {
        Samples::Sixteen(&[label, others, longer]) => Label {
            shown: usize::from(label).checked_sub(1),
            others: f32::from(others) / SHARES,
            longer: f32::from(longer) / SHARES,
        },
        other => panic!("{other:?}"),
    }
}

/// A head in front of a `Labels` scene, with so many patterns loaded.
pub(super) fn labelled(mechanics: Mechanics, patterns: usize) -> Head {
    in_front_of(Labels::default(), mechanics, patterns)
}

fn in_front_of(labels: Labels, mechanics: Mechanics, patterns: usize) -> Head {
    let (mut head, _) = virtual_head::head(labels, mechanics);
    head.load(vec![Raster::uniform(1, 1, 0).unwrap(); patterns])
        .unwrap();
    head
}

pub(super) fn plain() -> Mechanics {
    Mechanics::plain(REFRESH, 1)
}

/// The index and label of each frame of a sequence, and the result of the sequence.
type Taken = (Vec<(usize, Label)>, Result<Exposure, Error>);

fn take(head: &mut Head, indices: &[usize]) -> Taken {
    let mut frames = Vec::new();
    let result = head.acquire(indices, TIMEOUT, &mut |index, frame| {
        frames.push((index, label(&frame)));
    });
    (frames, result)
}
