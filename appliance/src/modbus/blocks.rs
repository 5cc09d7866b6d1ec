//! From a snapshot to the 16-bit words of each block.

use super::encode::Words;
use super::map::{self, Block};
use crate::config::WordOrder;
use crate::station::{ResultRecord, Snapshot};
use std::sync::Arc;

/// The words of a block, `block.last - block.first + 1` of them; zeros for a block that is not
/// served.
pub fn block_words(snapshot: &Snapshot, block: &Block, order: WordOrder) -> Vec<u16> {
    let mut words = Words {
        first: block.first,
        words: vec![0; usize::from(block.last - block.first) + 1],
        order,
    };
    // Without a result the block shows an empty one, all of whose gauges are invalid.
    let shown = |record: &Option<Arc<ResultRecord>>| record.clone().unwrap_or_default();
    match *block {
        map::CONTROL => map::control(&mut words, snapshot),
        map::STATUS => map::status(&mut words, snapshot),
        map::RESULT => map::result(&mut words, &shown(&snapshot.result)),
        map::OLDEST => {
            // The same layout: written at RESULT's addresses, read at its own.
            words.first = map::RESULT.first;
            map::result(&mut words, &shown(&snapshot.oldest));
        }
        map::GAUGE_DETAIL => map::gauge_detail(&mut words, &shown(&snapshot.result)),
        map::GAUGE_UNCERTAINTY => {
            map::gauge_uncertainty(&mut words, &shown(&snapshot.result));
        }
        map::HEALTH => map::health(&mut words, snapshot),
        map::RECIPE_DIRECTORY => map::recipe_directory(&mut words, snapshot),
        map::IDENTITY => map::identity(&mut words, snapshot),
        _ => {}
    }
    words.words
}
