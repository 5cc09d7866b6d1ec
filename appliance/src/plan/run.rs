//! One sequence of a recipe made ready to run.

use super::golden;
use crate::recipe::archive::Arrays;
use crate::recipe::{AlignmentKind, RecipeFile, SequenceKind};
use algo::geometry::Triangulator;
use algo::inspect::{Gauge, Parts, Production};
use algo::pattern::Sequence;
use algo::phase::Decoder;
use algo::pipeline::Rises;
use std::ops::Range;
use std::sync::Arc;

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    pub sequence: Sequence,
    /// Which of the plan's rasters its frames show.
    pub indices: Vec<usize>,
    pub production: Production,
}

/// What all runs of a recipe share.
pub(super) struct Shared<'a> {
    pub file: &'a RecipeFile,
    pub arrays: &'a Arrays,
    pub triangulator: Arc<Triangulator>,
    pub rises: Arc<Rises>,
    pub gauges: Vec<Gauge>,
    pub window: Vec<Range<usize>>,
}

/// The sequences that a part is measured with in turn, as places in the recipe's list: the one for production, and behind
/// it those that unwrap further, until one is good enough.
pub(super) fn chain(file: &RecipeFile) -> Vec<usize> {
    let mut chain: Vec<usize> = Vec::new();
    for at in file.production..file.sequences.len() {
        let sequence = &file.sequences[at];
        // A set of frames tells by its number which sequence it is of.
        let further = chain.iter().all(|&before| {
            let before = &file.sequences[before];
            before.kind != sequence.kind && before.frames.len() < sequence.frames.len()
        });
        if further {
            chain.push(at);
        }
    }
    chain
}

impl Run {
    /// The sequence at a place in the recipe's list. `frames` are those of all runs; those of this one are added.
    pub fn new(
        shared: &Shared<'_>,
        at: usize,
        frames: &mut Vec<(f64, f64)>,
    ) -> Result<Self, String> {
        let file = shared.file;
        let sequence = &file.sequences[at];
        let own: Vec<_> = sequence.frames.iter().map(|&[r, s]| (r, s)).collect();
        let levels = Sequence::from_frames(&own).map_err(|error| error.to_string())?;
        let range = shared.triangulator.function().range();
        let decoder = Decoder::new(&levels, range, file.camera.bit_depth)
            .map_err(|error| error.to_string())?;
        let indices = own.into_iter().map(|frame| {
            let shown = frames.iter().position(|known| *known == frame);
            shown.unwrap_or_else(|| {
                frames.push(frame);
                frames.len() - 1
            })
        });
        let indices = indices.collect();
        let production = Production::new(Parts {
            taught: golden::taught(file, shared.arrays, &decoder),
            map: golden::safe_map(shared.arrays, sequence.kind),
            decoder,
            triangulator: Arc::clone(&shared.triangulator),
            rises: Arc::clone(&shared.rises),
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise_counts: file.noise_counts,
            aligned: file.alignment == AlignmentKind::Rigid,
        });
        Ok(Self {
            kind: sequence.kind,
            sequence: levels,
            indices,
            production: production.map_err(|error| error.to_string())?,
        })
    }
}
