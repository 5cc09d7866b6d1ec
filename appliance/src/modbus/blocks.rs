//! The registers with their present values: the words of each block for a PLC, and texts for the page.

use super::encode::Words;
use super::map::{BLOCKS, Block, CONTROL, Kind, Register, Source, registers};
use crate::config::WordOrder;
use crate::station::Snapshot;
use serde_json::{Value, json};

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

/// `{"registers": [{"address", "name", "type", "block", "served", "values", "meaning"}]}`; `values`
/// has one text per item, decoded from the words in their normal order.
pub fn live(snapshot: &Snapshot) -> Value {
    let mut words = (CONTROL, block_words(snapshot, &CONTROL, WordOrder::Normal));
    let rows: Vec<Value> = registers()
        .map(|(block, row)| {
            if words.0 != block {
                words = (block, block_words(snapshot, &block, WordOrder::Normal));
            }
            let first = usize::from(row.address - block.first);
            let own = words
                .1
                .get(first..first + usize::from(row.count()))
                .unwrap_or_default();
            json!({
                "address": row.address,
                "name": row.name,
                "type": row.kind.word(),
                "block": block.name,
                "served": block.served,
                "values": values(&row, own),
                "meaning": row.meaning,
            })
        })
        .collect();
    json!({ "registers": rows })
}

fn values(row: &Register, words: &[u16]) -> Vec<String> {
    if row.kind == Kind::Ascii {
        return vec![ascii(words)];
    }
    let items = words.chunks_exact(usize::from(row.kind.width()));
    items.map(|item| text(row.kind, item)).collect()
}

fn ascii(words: &[u16]) -> String {
    let bytes = words.iter().flat_map(|word| word.to_be_bytes());
    let text: Vec<u8> = bytes.take_while(|byte| *byte != 0).collect();
    String::from_utf8_lossy(&text).into_owned()
}

fn text(kind: Kind, words: &[u16]) -> String {
    if kind == Kind::Text {
        return ascii(words);
    }
    let wide = words
        .iter()
        .fold(0_u64, |wide, word| wide << 16 | u64::from(*word));
    let low = wide as u32;
    match kind {
        Kind::Bits => format!("{wide:#06x}"),
        Kind::U16 | Kind::U32 | Kind::U64 | Kind::Ascii | Kind::Text => wide.to_string(),
        Kind::I16 => (wide as u16).cast_signed().to_string(),
        Kind::I32 => low.cast_signed().to_string(),
        Kind::F32 => f32::from_bits(low).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modbus::map::registers;

    #[test]
    fn words_read_as_what_the_table_says_they_are() {
        assert_eq!(text(Kind::I16, &[0xFFFF]), "-1");
        assert_eq!(text(Kind::I32, &[0x8000, 0]), "-2147483648");
        assert_eq!(text(Kind::U32, &[1, 2]), "65538");
        assert_eq!(text(Kind::F32, &[0x42F6, 0xE979]), "123.456");
        assert_eq!(text(Kind::F32, &[0x7FC0, 0]), "NaN");
        assert_eq!(text(Kind::Bits, &[0x8001]), "0x8001");
        let part_number = registers()
            .find(|(_, row)| row.name == "PART_NUMBER")
            .unwrap()
            .1;
        assert_eq!(values(&part_number, &[0x4142, 0x4300, 0x4444]), ["ABC"]);
    }
}
