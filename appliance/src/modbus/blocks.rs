//! From a snapshot to the 16-bit words of each block.

use super::encode::Words;
use super::map::{BLOCKS, Block, Source};
use crate::config::WordOrder;
use crate::station::Snapshot;

/// The words of a block, `block.last - block.first + 1` of them; zeros for a block that is not
/// of the map.
pub fn block_words(snapshot: &Snapshot, block: &Block, order: WordOrder) -> Vec<u16> {
    let mut words = Words {
        first: block.first,
        words: vec![0; usize::from(block.last - block.first) + 1],
        order,
    };
    let mut blocks = BLOCKS.iter();
    if let Some((_, rows, source)) = blocks.find(|(own, ..)| own == block) {
        // Rows are written at the addresses of their layout.
        words.first = rows[0].address;
        // Without a result the block shows an empty one, all of whose slots are.
        match source {
            Source::Now(put) => put(&mut words, snapshot),
            Source::Newest(put) => put(&mut words, &snapshot.result.clone().unwrap_or_default()),
            Source::Oldest(put) => put(&mut words, &snapshot.oldest.clone().unwrap_or_default()),
        }
    }
    words.words
}
