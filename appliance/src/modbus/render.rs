//! The register map as CSV and JSON, for the `registers` command and the README.

use std::fmt::Write as _;

use super::map::{Block, Kind, Register, VERSION, registers};

fn type_text(row: &Register) -> String {
    match (row.kind, row.items) {
        (Kind::Ascii, registers) => format!("ascii {}", 2 * registers),
        (kind, 1) => kind.word().to_owned(),
        (kind, items) => format!("{} x {items}", kind.word()),
    }
}

/// The reference number of the older notation; read-only blocks answer as input registers too.
pub(super) fn reference(block: &Block, row: &Register) -> u32 {
    let first = if block.writable { 400_001 } else { 300_001 };
    first + u32::from(row.address)
}

pub(super) fn access(block: &Block) -> &'static str {
    if block.writable { "read/write" } else { "read" }
}

/// MAP_VERSION as people write it.
fn version() -> String {
    format!("{}.{}", VERSION >> 8, VERSION & 0xFF)
}

/// The map as CSV: one header line, one line per row. `reference` is the 3xxxxx/4xxxxx notation of
/// the PDU address.
pub fn registers_csv() -> String {
    let mut csv =
        String::from("address,reference,name,type,registers,access,block,served,meaning\n");
    for (block, row) in registers() {
        let (address, name, count, kind) = (row.address, row.name, row.count(), type_text(&row));
        let reference = reference(&block, &row);
        let served = if block.served { "yes" } else { "later" };
        // Writing into a String cannot fail.
        let _ = writeln!(
            csv,
            "{address},{reference},{name},{kind},{count},{},{},{served},\"{}\"",
            access(&block),
            block.name,
            row.meaning.replace('"', "\"\""),
        );
    }
    csv
}

/// The map as JSON: `{"format", "version", "registers": [{"address", "reference", "name", "type",
/// "registers", "access", "block", "served", "meaning"}]}`.
pub fn registers_json() -> serde_json::Value {
    let rows: Vec<_> = registers()
        .map(|(block, row)| {
            serde_json::json!({
                "address": row.address,
                "reference": reference(&block, &row),
                "name": row.name,
                "type": type_text(&row),
                "registers": row.count(),
                "access": access(&block),
                "block": block.name,
                "served": block.served,
                "meaning": row.meaning,
            })
        })
        .collect();
    serde_json::json!({ "format": "fringed-registers", "version": version(), "registers": rows })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_and_json_hold_every_row_of_the_map() {
        let rows = registers().count();
        let csv = registers_csv();
        assert_eq!(csv.lines().count(), rows + 1);
        assert!(
            csv.contains("\n112,300113,RESULT_SEQ,u32,2,read,STATUS,yes,"),
            "{csv}"
        );
        assert!(
            csv.contains("\n8,400009,PART_NUMBER,ascii 32,16,read/write,CONTROL,yes,"),
            "{csv}"
        );
        assert_eq!(
            registers_json()["registers"].as_array().map(Vec::len),
            Some(rows)
        );
    }
}
