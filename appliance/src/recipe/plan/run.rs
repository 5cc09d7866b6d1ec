//! One sequence of a recipe, ready to judge parts.

use super::golden;
use crate::recipe::archive::Arrays;
use crate::recipe::{Conditions, RecipeSequence, SequenceKind};
use algo::geometry::Triangulator;
use algo::inspect::{Gauge, Parts, Production, Taught};
use algo::pattern::{PhaseRange, Sequence, Shot};
use algo::phase::{Arrived, Decoder};
use algo::pipeline::HeightCubics;
use algo::units::AbsolutePhase;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    pub levels: Sequence,
    /// Which of the plan's rasters its frames show.
    pub indices: Vec<usize>,
    pub production: Production,
    /// Memory for the levels that are decoded on arrival, allocated by the first cycle.
    pub arrived: Mutex<Option<Arrived>>,
    /// Bytes of its maps.
    pub bytes: usize,
}

/// A sequence of a recipe before it is joined with the geometry.
pub(super) struct Unjoined {
    kind: SequenceKind,
    levels: Sequence,
    indices: Vec<usize>,
    decoder: Decoder,
    taught: Taught,
    map: Option<Vec<AbsolutePhase>>,
}

/// What all runs of a recipe share.
pub(super) struct Shared<'a> {
    pub conditions: &'a Conditions,
    pub aligned: bool,
    pub triangulator: Arc<Triangulator>,
    pub cubics: Arc<HeightCubics>,
    pub gauges: Vec<Gauge>,
    pub window: Vec<Range<usize>>,
}

impl Unjoined {
    /// A sequence of the recipe, for phases of `range`. `rasters` are what all runs show; what only this one shows is added.
    pub fn new(
        sequence: RecipeSequence,
        conditions: &Conditions,
        arrays: &Arrays,
        range: PhaseRange,
        rasters: &mut Vec<Shot>,
    ) -> Result<Self, String> {
        let RecipeSequence {
            kind,
            shots,
            levels,
        } = sequence;
        let (_, _, bit_depth) = conditions.camera;
        let decoder = Decoder::new(&levels, range, bit_depth).map_err(|error| error.to_string())?;
        let indices = shots.into_iter().map(|shot| {
            let shown = rasters.iter().position(|known| *known == shot);
            shown.unwrap_or_else(|| {
                rasters.push(shot);
                rasters.len() - 1
            })
        });
        Ok(Self {
            kind,
            indices: indices.collect(),
            levels,
            taught: golden::taught(conditions.noise_counts, arrays, &decoder),
            map: golden::safe_map(arrays, kind),
            decoder,
        })
    }

    /// Joins it with what all sequences share.
    pub fn join(self, shared: &Shared<'_>) -> Result<Run, String> {
        let map = size_of_val(self.map.as_deref().unwrap_or(&[]));
        let bytes = map + self.taught.bytes();
        let production = Production::new(Parts {
            decoder: self.decoder,
            triangulator: Arc::clone(&shared.triangulator),
            cubics: Arc::clone(&shared.cubics),
            map: self.map,
            taught: self.taught,
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise_counts: shared.conditions.noise_counts,
            aligned: shared.aligned,
        });
        Ok(Run {
            kind: self.kind,
            levels: self.levels,
            indices: self.indices,
            bytes,
            production: production.map_err(|error| error.to_string())?,
            arrived: Mutex::new(None),
        })
    }
}
