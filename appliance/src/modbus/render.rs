//! The register map as text: CSV and JSON for the command `registers` and the README, and lists of
//! tags, one for each element and each named bit, for tools that import them.
//!
//! Names of tags are made of block, row, number of the element (for gauges the slot) and bit, such as
//! `GAUGES_VALUE_VALUE_17` and `GAUGES_DECISION_17_ABSENT`. They have only A–Z, 0–9 and _, and depend
//! on the map alone, so that a program that uses them fits every recipe; what a slot measures is in the
//! description.
//!
//! Sources of `kepware`: the columns as KEPServerEX documents its CSV import and export (kepware.com,
//! *CSV Import/Export*: Tag Name to Description, client access RO or R/W, blank means the default) and
//! exports them, with Negate Value last. Addresses are those of its driver *Modbus TCP/IP Ethernet*:
//! 400001 holding, 300001 input registers, `.b` a bit from 0 on (*zero-based bit addressing*, the
//! default), `.nH` a text of n bytes, the first in the high byte. The driver's default *first word low*
//! is `modbus.word_order = "swapped"`.

use super::map::{Block, Kind, Register, VERSION, registers};
use crate::station::control;
use crate::station::gauge::decision;
use crate::station::health::power;
use crate::station::result::flag;
use crate::station::snapshot::{status, warning};
use std::borrow::Cow;
use std::fmt::Write as _;

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

/// The names of the bits of a row, from bit 0 on; rows by slot have more bits, one per slot.
const BITS: [(&str, &[&str]); 9] = [
    ("CONTROL", control::NAMES),
    ("STATUS", status::NAMES),
    ("WARNING", warning::NAMES),
    ("FLAGS", flag::NAMES),
    ("GAUGE_DECISION", decision::NAMES),
    ("DECISION", decision::NAMES),
    ("POWER", power::NAMES),
    (
        "PROJECTOR_FAULT",
        &[
            "MICROMIRRORS",
            "LED",
            "SEQUENCE",
            "SUPPLY_VOLTAGE",
            "TIMING",
            "CONFIGURATION",
            "WATCHDOG",
            "FLASH",
        ],
    ),
    // Numbers of recipes, without names.
    ("STORED_RECIPES", &[]),
];

/// A gauge of a recipe, for the descriptions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotName {
    /// 1 to 64.
    pub slot: u16,
    /// The gauge's name.
    pub name: String,
    /// The symbol of its unit, empty for shares.
    pub unit: &'static str,
}

/// An element of the map, or one of its bits.
struct Tag<'a> {
    name: String,
    block: Block,
    row: Register,
    /// 0-based PDU address.
    address: u16,
    bit: Option<u16>,
    description: String,
    unit: &'a str,
}

/// How a slot is described.
fn described(slot: u16, names: &[SlotName]) -> (String, &str) {
    let own = names.iter().find(|own| own.slot == slot);
    own.map_or((format!("slot {slot}"), ""), |own| {
        let unit = match own.unit {
            "" => String::new(),
            unit => format!(" [{unit}]"),
        };
        (format!("slot {slot}, {}{unit}", own.name), own.unit)
    })
}

/// The tags of the whole map, by address; the bits of an element follow it.
fn tags(names: &[SlotName]) -> Vec<Tag<'_>> {
    let mut tags = Vec::new();
    for (block, row) in registers() {
        let base = format!("{}_{}", block.name, row.name);
        let by_slot = row.items > 1 && (base.contains("GAUGES_") || row.name.starts_with("GAUGE_"));
        // One bit per slot in each of the registers.
        let of_slots = by_slot && row.kind == Kind::Bits && row.items == 4;
        let (items, width) = match row.kind {
            Kind::Ascii => (1, row.items),
            kind => (row.items, kind.width()),
        };
        let mut put = |name, address, bit, description, unit| {
            tags.push(Tag {
                name,
                block,
                row,
                address,
                bit,
                description,
                unit,
            });
        };
        for number in 1..=items {
            let address = row.address + (number - 1) * width;
            let name = match items {
                1 => base.clone(),
                _ => format!("{base}_{number}"),
            };
            let (slot, unit) = match by_slot && !of_slots {
                true => described(number, names),
                false => (String::new(), ""),
            };
            let begin = if slot.is_empty() { "" } else { ": " };
            let meaning = format!("{slot}{begin}{}", row.meaning);
            let value = matches!(row.kind, Kind::F32);
            put(
                name.clone(),
                address,
                None,
                meaning,
                if value { unit } else { "" },
            );
            if of_slots {
                for bit in 0..16 {
                    let slot = 16 * (number - 1) + bit + 1;
                    let (words, _) = described(slot, names);
                    let description = format!("{words}: {}", row.name);
                    put(
                        format!("{base}_SLOT_{slot}"),
                        address,
                        Some(bit),
                        description,
                        "",
                    );
                }
            }
            let bits = BITS
                .iter()
                .find(|(of, _)| *of == row.name && row.kind == Kind::Bits);
            for (bit, of_bit) in (0..).zip(bits.map_or(&[][..], |(_, bits)| bits)) {
                let description = format!("{slot}{begin}{} bit {bit}", row.name);
                put(
                    format!("{name}_{of_bit}"),
                    address,
                    Some(bit),
                    description,
                    "",
                );
            }
        }
    }
    tags
}

/// A cell of a CSV, quoted where RFC 4180 asks for it.
fn cell(text: &str) -> Cow<'_, str> {
    match text.contains([',', '"', '\r', '\n']) {
        true => quoted(text).into(),
        false => text.into(),
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// The type of a tag in words: `bool` for a bit.
fn kind(tag: &Tag<'_>) -> String {
    match (tag.bit, tag.row.kind) {
        (Some(_), _) => "bool".into(),
        (None, Kind::Ascii) => format!("ascii {}", 2 * tag.row.items),
        (None, kind) => kind.word().into(),
    }
}

/// The map as CSV after RFC 4180, one line per tag: `name,address,type,bit,access,description`. The
/// address is the PDU's, from 0; `bit` is empty for whole elements.
pub fn flat(names: &[SlotName]) -> String {
    let mut csv = String::from("name,address,type,bit,access,description\r\n");
    for tag in tags(names) {
        let bit = tag.bit.map_or(String::new(), |bit| bit.to_string());
        // Writing into a String cannot fail.
        let _ = write!(
            csv,
            "{},{},{},{bit},{},{}\r\n",
            tag.name,
            tag.address,
            kind(&tag),
            access(&tag.block),
            cell(&tag.description),
        );
    }
    csv
}

/// The same tags as the CSV that KEPServerEX imports.
pub fn kepware(names: &[SlotName]) -> String {
    let mut csv = String::from(
        "Tag Name,Address,Data Type,Respect Data Type,Client Access,Scan Rate,Scaling,Raw Low,Raw High,\
         Scaled Low,Scaled High,Scaled Data Type,Clamp Low,Clamp High,Eng Units,Description,Negate Value\r\n",
    );
    for tag in tags(names) {
        let own = Register {
            address: tag.address,
            ..tag.row
        };
        let bytes = 2 * match tag.row.kind {
            Kind::Ascii => tag.row.items,
            kind => kind.width(),
        };
        let (suffix, kind) = match (tag.bit, tag.row.kind) {
            (Some(bit), _) => (format!(".{bit}"), "Boolean"),
            (None, Kind::Ascii | Kind::Text) => (format!(".{bytes}H"), "String"),
            (None, Kind::Bits | Kind::U16) => (String::new(), "Word"),
            (None, Kind::I16) => (String::new(), "Short"),
            (None, Kind::U32) => (String::new(), "DWord"),
            (None, Kind::I32) => (String::new(), "Long"),
            (None, Kind::U64) => (String::new(), "QWord"),
            (None, Kind::F32) => (String::new(), "Float"),
        };
        let access = if tag.block.writable { "R/W" } else { "RO" };
        let _ = write!(
            csv,
            "\"{}\",\"{}{suffix}\",{kind},1,{access},100,,,,,,,,,{},{},\r\n",
            tag.name,
            reference(&tag.block, &own),
            quoted(tag.unit),
            quoted(&tag.description),
        );
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

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

    fn named() -> Vec<SlotName> {
        let name = "hole, \"left\"".into();
        let unit = "mm";
        vec![SlotName {
            slot: 17,
            name,
            unit,
        }]
    }

    #[test]
    fn every_element_and_named_bit_is_a_tag_with_a_name_of_its_own() {
        let tags = tags(&[]);
        let names: BTreeSet<&str> = tags.iter().map(|tag| &*tag.name).collect();
        assert_eq!(names.len(), tags.len());
        let plain = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
        assert!(names.iter().all(|name| name.chars().all(plain)));
        let elements = tags.iter().filter(|tag| tag.bit.is_none()).count();
        let items = registers().map(|(_, row)| match row.kind {
            Kind::Ascii => 1,
            _ => usize::from(row.items),
        });
        assert_eq!(elements, items.sum::<usize>());
        assert!(tags.len() > 900);
        for name in [
            "CONTROL_CONTROL_TRIGGER",
            "RESULT_GAUGE_DECISION_16_ABSENT",
            "GAUGES_PASS_SLOT_64",
            "OLDEST_GAUGES_VALUE_VALUE_64",
            "GAUGES_NAME_NAME_1",
        ] {
            assert!(names.contains(name), "{name}");
        }
    }

    #[test]
    fn every_row_of_bits_has_names_for_them() {
        for (block, row) in registers().filter(|(_, row)| row.kind == Kind::Bits) {
            let of_slots = row.items == 4;
            let named = BITS.iter().any(|(name, _)| *name == row.name);
            assert!(named != of_slots, "{} {}", block.name, row.name);
        }
    }

    #[test]
    fn a_gauge_of_the_recipe_is_in_the_description_and_nowhere_else() {
        let csv = flat(&named());
        let line =
            "GAUGES_VALUE_VALUE_17,1234,f32,,read,\"slot 17, hole, \"\"left\"\" [mm]: of each slot";
        assert!(csv.contains(&format!("\r\n{line}")), "{csv}");
        let bit =
            "GAUGES_FAILED_SLOT_17,1113,bool,0,read,\"slot 17, hole, \"\"left\"\" [mm]: FAILED\"";
        assert!(csv.contains(&format!("\r\n{bit}\r\n")), "{csv}");
        let name = |line: &str| line.split(',').next().map(str::to_owned);
        let names = |csv: &str| csv.lines().map(name).collect::<Vec<_>>();
        assert_eq!(names(&csv), names(&flat(&[])));
    }

    #[test]
    fn the_import_has_its_columns_and_as_many_rows() {
        let csv = kepware(&named());
        assert_eq!(csv.lines().count(), flat(&[]).lines().count());
        let head = csv.lines().next().unwrap();
        assert_eq!(head.split(',').count(), 17);
        for line in [
            "\"CONTROL_PART_NUMBER\",\"400009.32H\",String,1,R/W,100,,,,,,,,,\"\",\"recipe key, 32 characters\",",
            "\"STATUS_STATUS_READY\",\"300101.1\",Boolean,1,RO,100,,,,,,,,,\"\",\"STATUS bit 1\",",
            "\"GAUGES_NAME_NAME_2\",\"304019.32H\",String,1,RO,100,,,,,,,,,\"\",\"slot 2: of each slot, its first 32 characters\",",
        ] {
            assert!(csv.contains(&format!("\r\n{line}\r\n")), "{line}");
        }
        let value = "\"GAUGES_VALUE_VALUE_17\",\"301235\",Float,1,RO,100,,,,,,,,,\"mm\",\"slot 17, hole, \"\"left\"\" [mm]: ";
        assert!(csv.contains(value));
        assert!(csv.contains("\"RESULT_TIME\",\"300215\",QWord,"));
    }
}
