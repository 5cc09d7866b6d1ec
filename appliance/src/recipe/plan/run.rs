//! One sequence of a recipe, ready to judge parts.

use super::golden;
use crate::recipe::archive::Arrays;
use crate::recipe::{RecipeSequence, SequenceKind};
use algo::geometry::Triangulator;
use algo::inspect::{Gauge, Parts, Production};
use algo::pattern::{PhaseRange, Shot};
use algo::phase::{Arrived, Decoder};
use algo::pipeline::HeightCubics;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// A sequence that the part can be measured with.
#[derive(Debug)]
pub(super) struct Run {
    pub kind: SequenceKind,
    /// Which of the plan's rasters its frames show.
    pub indices: Vec<usize>,
    pub production: Production,
    /// Memory for the levels that are decoded on arrival, allocated by the first cycle.
    pub arrived: Mutex<Option<Arrived>>,
    /// Bytes of its maps.
    pub bytes: usize,
}

/// What all runs of a recipe share.
pub(super) struct Shared {
    pub aligned: bool,
    pub triangulator: Arc<Triangulator>,
    pub cubics: Arc<HeightCubics>,
    pub gauges: Vec<Gauge>,
    pub window: Vec<Range<usize>>,
}

/// Prepares a sequence of the recipe, for phases of `range`, and returns what joins it with what all sequences share: the recipe's
/// arrays are dropped in between. `rasters` are what all runs show; what only this one shows is added. `fundamental` is that of the
/// waveform that golden's modulation was measured with.
pub(super) fn prepare(
    sequence: RecipeSequence,
    (noise_counts, fundamental): (f64, f64),
    arrays: &Arrays,
    (range, bit_depth): (PhaseRange, u8),
    rasters: &mut Vec<Shot>,
) -> Result<impl FnOnce(&Shared) -> Result<Run, String> + use<>, String> {
    let brighter = sequence.fundamental() / fundamental;
    let RecipeSequence {
        kind,
        shots,
        levels,
    } = sequence;
    let decoder = Decoder::new(&levels, range, bit_depth).map_err(|error| error.to_string())?;
    let indices = shots.into_iter().map(|shot| {
        let shown = rasters.iter().position(|known| *known == shot);
        shown.unwrap_or_else(|| {
            rasters.push(shot);
            rasters.len() - 1
        })
    });
    let indices: Vec<usize> = indices.collect();
    let taught = golden::taught(noise_counts / brighter, arrays, &decoder);
    let map = golden::safe_map(arrays, kind);
    Ok(move |shared: &Shared| {
        let bytes = size_of_val(map.as_deref().unwrap_or(&[])) + taught.bytes();
        let production = Production::new(Parts {
            decoder,
            triangulator: Arc::clone(&shared.triangulator),
            cubics: Arc::clone(&shared.cubics),
            map,
            taught,
            gauges: shared.gauges.clone(),
            window: shared.window.clone(),
            noise_counts,
            aligned: shared.aligned,
        });
        Ok(Run {
            kind,
            indices,
            bytes,
            production: production.map_err(|error| error.to_string())?,
            arrived: Mutex::new(None),
        })
    })
}
