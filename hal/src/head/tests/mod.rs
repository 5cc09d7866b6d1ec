//! Promises of the head: what is handed over is what was in view, whatever the devices do.

mod schedules;
mod sequences;

use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::frame::{Pixels, Samples};
use crate::virtual_head::{self, Faults, Mechanics, Scene};

const REFRESH: Duration = Duration::from_micros(16_667);
const TIMEOUT: Duration = Duration::from_millis(500);
const SHARES: f32 = 65535.0;
/// By as much an exposure may be too long, and the rounding of a label.
const HALF_A_PERCENT: f32 = 0.005 + 1.0 / SHARES;

/// A scene whose frames say in their samples which pattern they show, how much of others, and for how much too long.
///
/// That is told from the light alone, so it judges the sequencer without its stamps and counts.
#[derive(Default)]
struct Labels {
    loaded: usize,
    /// Is told of each exposure.
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

    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        self.loaded = rasters.len();
        Ok(())
    }

    fn loaded(&self) -> usize {
        self.loaded
    }

    fn expose(
        &mut self,
        seen: &[(Option<usize>, f32)],
        timestamp: Timestamp,
        sequence: u64,
    ) -> Result<Frame, Error> {
        if let Some(exposed) = &self.exposed {
            exposed.send(()).unwrap();
        }
        let (shown, share) = *seen.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        let label = shown.map_or(0, |index| index as u16 + 1);
        let sum: f32 = seen.iter().map(|(_, share)| share).sum();
        // Saturating: a share of more than all is all that needs to be told.
        let told = |share: f32| (share * SHARES).round() as u16;
        let pixels = Pixels::Sixteen(vec![label, told(sum - share), told(sum - 1.0)]);
        Frame::new(FORMAT, Arc::new(pixels), timestamp, sequence)
    }
}

/// What a frame says of itself.
#[derive(Debug, PartialEq)]
struct Label {
    /// The pattern that it shows.
    shown: Option<usize>,
    /// For which share of the planned exposure it shows others.
    others: f32,
    /// By which share its exposure was too long.
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

/// A head in front of labels, with so many patterns loaded.
pub(super) fn labelled(mechanics: Mechanics, patterns: usize) -> DynHead {
    in_front_of(Labels::default(), mechanics, patterns)
}

fn in_front_of(labels: Labels, mechanics: Mechanics, patterns: usize) -> DynHead {
    let (mut head, _) = virtual_head::head(labels, mechanics);
    head.load(vec![Raster::uniform(1, 1, 0).unwrap(); patterns])
        .unwrap();
    head
}

pub(super) fn plain() -> Mechanics {
    Mechanics::plain(REFRESH, 1)
}

/// The index and the label of each frame of a sequence, and how it went.
type Taken = (Vec<(usize, Label)>, Result<Exposure, Error>);

fn take(head: &mut DynHead, indices: &[usize]) -> Taken {
    let mut frames = Vec::new();
    let result = head.acquire(indices, TIMEOUT, &mut |index, frame| {
        frames.push((index, label(&frame)));
    });
    (frames, result)
}
