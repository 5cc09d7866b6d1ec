//! Inputs of the fuzz targets: small examples, inputs that once failed, and seeded damage to the
//! examples.

use algo::inspect::Measure;
use serde_json::json;
use std::collections::BTreeSet;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use tests::files;
use tests::fuzz::{TARGETS, Target};
use tests::random::Random;
use tests::shared::root;

const SEED: u64 = 20_261_122;
/// Damaged copies of each input.
const COPIES: usize = 4;
/// Largest total size of the examples, bytes.
const MOST: usize = 300_000;

fn folder(name: &str) -> PathBuf {
    root().join("tests/fuzz").join(name)
}

/// Names and contents of the inputs of a target; empty if the folder does not exist.
fn inputs(kind: &str, target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = folder(kind).join(target);
    let named = |name: &String| {
        (
            format!("{kind}/{target}/{name}"),
            fs::read(folder.join(name)).unwrap(),
        )
    };
    let stored = files::names(&folder).iter().map(named).collect();
    match (kind, target) {
        ("corpus", "edit") => [stored, edits()].concat(),
        _ => stored,
    }
}

/// Edits to a gauge of every kind: a new kind needs no example of its own.
fn edits() -> Vec<(String, Vec<u8>)> {
    let edit = |measures: &Measure| {
        let region = |name: &str, right: u32| json!({ "name": name, "polygon": [[0, 0], [right, 0], [right, 17], [0, 17]] });
        let from = match measures.facts().takes.len() {
            2 => "other",
            _ => "",
        };
        let edit = json!({
            "fingerprint": "",
            "regions": [region("frame", 23), region("other", 10)],
            "gauges": [{ "name": "one", "region": "frame", "from": from, "measures": measures, "high": 0.5 }],
        });
        (format!("{measures:?}"), edit.to_string().into_bytes())
    };
    Measure::examples().iter().map(edit).collect()
}

fn fails(target: Target, bytes: &[u8]) -> bool {
    catch_unwind(AssertUnwindSafe(|| target(bytes))).is_err()
}

#[test]
fn no_example_and_no_input_that_once_failed_fails_its_target() {
    let mut failed = Vec::new();
    let mut bytes = 0;
    for (name, target) in TARGETS {
        let examples = inputs("corpus", name);
        assert!(!examples.is_empty(), "{name} has no examples");
        bytes += examples.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
        for (input, bytes) in examples.into_iter().chain(inputs("failed", name)) {
            if fails(target, &bytes) {
                failed.push(input);
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(bytes <= MOST, "{bytes} bytes of examples");
}

#[test]
fn every_folder_of_inputs_has_its_target() {
    let targets: BTreeSet<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    for kind in ["corpus", "failed"] {
        for name in files::names(&folder(kind)) {
            assert!(
                targets.contains(name.as_str()),
                "{kind}/{name} has no target"
            );
        }
    }
}

/// A copy with bits changed, or bytes removed, repeated or inserted.
fn damaged(random: &mut Random, whole: &[u8]) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(3) {
        let at = random.below(bytes.len());
        match random.below(5) {
            0 => bytes.truncate(at),
            1 => bytes.extend_from_within(at..),
            2 => drop(bytes.drain(at..bytes.len().min(at + 1 + random.below(8)))),
            3 => bytes.splice(at..at, [0xFF; 4]).for_each(drop),
            _ if bytes.is_empty() => bytes.push(0),
            _ => bytes[at] ^= 1 << random.below(8),
        }
    }
    bytes
}

#[test]
fn damaged_examples_do_not_fail_their_target() {
    let mut random = Random::new(SEED);
    let mut failed = Vec::new();
    for (name, target) in TARGETS {
        for (input, whole) in inputs("corpus", name) {
            for copy in 0..COPIES {
                let bytes = damaged(&mut random, &whole);
                if fails(target, &bytes) {
                    failed.push(format!("copy {copy} of {input}: {bytes:?}"));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
