//! One sequence of a recipe made ready to run.

use super::golden;
use crate::recipe::archive::Arrays;
use crate::recipe::{AlignmentKind, RecipeFile, SequenceFile, SequenceKind};
use algo::geometry::Triangulator;
use algo::inspect::{Gauge, Parts, Production, Taught};
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::{Arrived, Decoder};
use algo::pipeline::Rises;
use algo::units::AbsolutePhase;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    pub sequence: Sequence,
    /// Which of the plan's rasters its frames show.
    pub indices: Vec<usize>,
    pub production: Production,
    /// Room for the levels that are decoded on arrival, since there first were some.
    pub arrived: Mutex<Option<Arrived>>,
    /// Bytes of its maps.
    pub bytes: usize,
}

/// A sequence of a recipe before it is known how phases become heights.
pub(super) struct Unjoined {
    kind: SequenceKind,
    sequence: Sequence,
    indices: Vec<usize>,
    decoder: Decoder,
    taught: Taught,
    map: Option<Vec<AbsolutePhase>>,
}

/// What all runs of a recipe share.
pub(super) struct Shared<'a> {
    pub file: &'a RecipeFile,
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
        let kind = |at: usize| file.sequences[at].kind;
        if chain.last().is_none_or(|&before| kind(before) < kind(at)) {
            chain.push(at);
        }
    }
    chain
}

impl Unjoined {
    /// A sequence of the recipe, for phases of `range`. `shots` are those of all runs; those of this one are added.
    pub fn new(
        file: &RecipeFile,
        arrays: &Arrays,
        range: PhaseRange,
        (SequenceFile { kind, frames, .. }, sequence): (&SequenceFile, Sequence),
        shots: &mut Vec<Shot>,
    ) -> Result<Self, String> {
        let decoder = Decoder::new(&sequence, range, file.camera.bit_depth)
            .map_err(|error| error.to_string())?;
        let indices = frames.iter().map(|shot| {
            let shown = shots.iter().position(|known| known == shot);
            shown.unwrap_or_else(|| {
                shots.push(*shot);
                shots.len() - 1
            })
        });
        Ok(Self {
            kind: *kind,
            indices: indices.collect(),
            sequence,
            taught: golden::taught(file, arrays, &decoder),
            map: golden::safe_map(arrays, *kind),
            decoder,
        })
    }

    /// Joins it with what all have in common.
    pub fn join(self, shared: &Shared<'_>) -> Result<Run, String> {
        let file = shared.file;
        let map = size_of_val(self.map.as_deref().unwrap_or(&[]));
        let bytes = map + self.taught.bytes();
        let production = Production::new(Parts {
            decoder: self.decoder,
            triangulator: Arc::clone(&shared.triangulator),
            rises: Arc::clone(&shared.rises),
            map: self.map,
            taught: self.taught,
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise_counts: file.noise_counts,
            aligned: file.alignment == AlignmentKind::Rigid,
        });
        Ok(Run {
            kind: self.kind,
            sequence: self.sequence,
            indices: self.indices,
            bytes,
            production: production.map_err(|error| error.to_string())?,
            arrived: Mutex::new(None),
        })
    }
}
