//! From a snapshot to the 16-bit words of each block.

use super::encode::Words;
use super::map::{self, Block};
use crate::config::WordOrder;
use crate::station::Snapshot;

/// The words of a block, `block.last - block.first + 1` of them; zeros for a block that is not
/// served.
pub fn block_words(snapshot: &Snapshot, block: &Block, order: WordOrder) -> Vec<u16> {
    let layout = block.layout();
    let mut words = Words {
        first: layout.first,
        words: vec![0; usize::from(block.last - block.first) + 1],
        order,
    };
    // Without a result the block shows an empty one, all of whose slots are.
    let shown = match layout == *block {
        true => &snapshot.result,
        false => &snapshot.oldest,
    };
    let record = || shown.clone().unwrap_or_default();
    match layout {
        map::CONTROL => map::control(&mut words, snapshot),
        map::STATUS => map::status(&mut words, snapshot),
        map::RESULT => map::result(&mut words, &record()),
        map::GAUGE_DETAIL => map::gauge_detail(&mut words, &record()),
        map::GAUGE_UNCERTAINTY => map::gauge_uncertainty(&mut words, &record()),
        map::GAUGES => map::gauges(&mut words, &record()),
        map::GAUGES_VALUE => map::gauges_value(&mut words, &record()),
        map::GAUGES_STEPS => map::gauges_steps(&mut words, &record()),
        map::GAUGES_SIGMA => map::gauges_sigma(&mut words, &record()),
        map::GAUGES_U => map::gauges_u(&mut words, &record()),
        map::GAUGES_UNIT => map::gauges_unit(&mut words, &record()),
        map::GAUGES_LOW => map::gauges_low(&mut words, &record()),
        map::GAUGES_HIGH => map::gauges_high(&mut words, &record()),
        map::GAUGES_NAME => map::gauges_name(&mut words, &record()),
        map::HEALTH => map::health(&mut words, snapshot),
        map::RECIPE_DIRECTORY => map::recipe_directory(&mut words, snapshot),
        map::IDENTITY => map::identity(&mut words, snapshot),
        _ => {}
    }
    words.words
}
