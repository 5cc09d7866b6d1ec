//! The declarations for controllers in Structured Text (IEC 61131-3).

use crate::written::program;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use tests::shared::{self, root};

fn document(name: &str) -> String {
    fs::read_to_string(root().join("docs").join(name)).unwrap()
}

/// Registers of a type of IEC 61131-3.
fn registers_of(kind: &str) -> u16 {
    if let Some((bounds, of)) = kind
        .strip_prefix("ARRAY [")
        .and_then(|rest| rest.split_once("] OF "))
    {
        let (first, last) = bounds.split_once("..").unwrap();
        let [first, last] = [first, last].map(|bound| bound.parse::<u16>().unwrap());
        return (last - first + 1) * registers_of(of);
    }
    match kind {
        "WORD" | "UINT" | "INT" => 1,
        "UDINT" | "DINT" | "REAL" => 2,
        _ => panic!("{kind}"),
    }
}

#[test]
fn the_declaration_in_structured_text_has_every_row_of_result_and_gauges_at_its_offset() {
    let text = document("plc/fringed.st");
    let map = program().run(&["registers", "--json"]).succeeded().stdout;
    let map: Value = serde_json::from_str(&map).unwrap();
    for (name, block, first, length) in [
        ("FRINGED_RESULT", "RESULT", 200, 120),
        ("FRINGED_GAUGES", "GAUGES", 1100, 84),
    ] {
        let (_, body) = text
            .split_once(&format!("TYPE {name} :\nSTRUCT\n"))
            .unwrap();
        let (body, _) = body.split_once("END_STRUCT").unwrap();
        let mut at = first;
        let mut declared = BTreeMap::new();
        for line in body.lines() {
            let (field, rest) = line.split_once(':').unwrap();
            let (kind, comment) = rest.split_once(';').unwrap();
            let said: String = comment.chars().filter(|c| c.is_ascii_digit()).collect();
            assert_eq!(said.parse(), Ok(at), "{line}");
            let registers = registers_of(kind.trim());
            // No controller pads what is aligned.
            let wide = ["DINT", "REAL"].iter().any(|of| kind.contains(of));
            assert!(!wide || at % 2 == 0, "{line}");
            // TIME is a type of the language.
            let name = field.trim().strip_suffix("_US").unwrap_or(field.trim());
            declared.insert(name.to_owned(), (at, registers));
            at += registers;
        }
        assert_eq!(at - first, length);
        for row in map["registers"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|row| row["block"] == block)
        {
            let number = |key: &str| u16::try_from(row[key].as_u64().unwrap()).unwrap();
            let own = declared.remove(row["name"].as_str().unwrap());
            assert_eq!(own, Some((number("address"), number("registers"))), "{row}");
        }
        assert!(
            declared.keys().all(|name| name.starts_with("RESERVED_")),
            "{declared:?}"
        );
    }
}

#[test]
fn shared_compiler_of_iec_61131_3_accepts_the_structured_text() {
    let Some(compiler) = shared::tool("matiec") else {
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let source = out.path().join("fringed.st");
    let text = [document("plc/fringed.st"), document("plc/verdict.st")].concat();
    fs::write(&source, text).unwrap();
    let run = std::process::Command::new(compiler.join("iec2c"))
        .args(["-I".as_ref(), compiler.join("lib").as_os_str()])
        .args(["-T".as_ref(), out.path().as_os_str()])
        .arg(&source)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
    assert!(out.path().join("POUS.c").is_file(), "{said}");
}
