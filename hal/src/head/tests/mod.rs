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

/// A scene whose frames say in their samples which pattern they show, and how much of others.
///
/// That is told from the light alone, so it judges the sequencer without its stamps and counts.
#[derive(Default)]
struct Labels {
    loaded: usize,
    /// Is told of each exposure.
    exposed: Option<mpsc::Sender<()>>,
}

const FORMAT: FrameFormat = FrameFormat {
    width: 2,
    height: 1,
    stride: 2,
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
        let others = ((1.0 - share) * SHARES).round() as u16;
        let pixels = Pixels::Sixteen(vec![label, others]);
        Frame::new(FORMAT, Arc::new(pixels), timestamp, sequence)
    }
}

/// The pattern that a frame shows, and for how much of its exposure it shows others.
fn label(frame: &Frame) -> (Option<usize>, f32) {
    match frame.samples() {
        Samples::Sixteen(&[label, others]) => (
            usize::from(label).checked_sub(1),
            f32::from(others) / SHARES,
        ),
        other => panic!("{other:?}"),
    }
}

/// A head in front of labels, with so many patterns loaded.
fn labelled(mechanics: Mechanics, patterns: usize) -> DynHead {
    in_front_of(Labels::default(), mechanics, patterns)
}

fn in_front_of(labels: Labels, mechanics: Mechanics, patterns: usize) -> DynHead {
    let (mut head, _) = virtual_head::head(labels, mechanics);
    head.load(vec![Raster::uniform(1, 1, 0).unwrap(); patterns])
        .unwrap();
    head
}

fn plain() -> Mechanics {
    Mechanics::plain(REFRESH, 1)
}

/// The label and the index of each frame of a sequence, and how it went.
type Taken = (Vec<(usize, Option<usize>, f32)>, Result<Exposure, Error>);

fn take(head: &mut DynHead, indices: &[usize]) -> Taken {
    let mut frames = Vec::new();
    let result = head.acquire(indices, TIMEOUT, &mut |index, frame| {
        let (shown, others) = label(&frame);
        frames.push((index, shown, others));
    });
    (frames, result)
}
