//! Damaged recordings give a result or an error, never a panic.
//!
//! The random numbers are seeded: a failing case prints its number, and the same number gives the
//! same damage again.

use crate::written::{Written, geometric};
use appliance::measure::measure;
use hal::replay::Recording;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use tests::files;
use tests::random::Random;
use tests::render::{Scene, levels, small_recording};

const SEED: u64 = 20_260_401;
/// Cases of each kind of damage.
const BYTE_CASES: u64 = 450;
const NUMBER_CASES: u64 = 900;

/// Replacements for a number of the manifest: the ends of every type, and values beyond them.
const NUMBERS: [&str; 28] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "0.5",
    "1e-6",
    "1e-300",
    "-1e-300",
    "5e-324",
    "1e-9",
    "1e3",
    "1e6",
    "1e9",
    "1e15",
    "1e18",
    "1e19",
    "1e100",
    "1e300",
    "-1e300",
    "1.7976931348623157e308",
    "255",
    "16384",
    "4294967295",
    "18446744073709551615",
    "-9223372036854775808",
    "0.9999999999",
];

/// Ratios of a geometric, a dense and a single sequence.
const FORMS: [&[f64]; 3] = [&[0.03, 0.2, 1.0], &[1.0, 35.0 / 36.0, 5.0 / 6.0], &[1.0]];

/// Whether a folder can be opened and measured without a panic; the result does not matter.
fn survives(case: u64, folder: &Path, damage: &str) -> bool {
    outcome(folder).unwrap_or_else(|| panic!("case {case} panicked: {damage}"))
}

/// Whether a folder could be measured; `None` if the program panicked.
fn outcome(folder: &Path) -> Option<bool> {
    let outcome = catch_unwind(|| match Recording::open(folder) {
        Ok(recording) => measure(&recording, folder).is_ok(),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    });
    outcome.ok()
}

fn every_file(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![folder.join("recording.json")];
    for part in ["frames", "pattern", "truth"] {
        let part = folder.join(part);
        all.extend(files::names(&part).iter().map(|name| part.join(name)));
    }
    all
}

#[test]
fn damaged_bytes_never_panic() {
    let mut random = Random::new(SEED);
    let mut measured = 0;
    for ratios in FORMS {
        let written = Written::new(&small_recording(8, ratios));
        let all = every_file(&written.recording());
        assert!(all.len() > 9, "{all:?}");
        for case in 0..BYTE_CASES / 3 {
            // Half of the cases damage the manifest.
            let path = match random.below(2) {
                0 => &all[0],
                _ => &all[random.below(all.len())],
            };
            let whole = fs::read(path).unwrap();
            let mut bytes = whole.clone();
            match random.below(8) {
                0 => bytes.truncate(random.below(bytes.len())),
                1 => bytes.extend((0..random.below(50)).map(|_| random.bits() as u8)),
                _ => {
                    for _ in 0..=random.below(6) {
                        let at = random.below(bytes.len());
                        bytes[at] = match random.below(3) {
                            0 => bytes[at] ^ (1 << random.below(8)),
                            // Digits and characters of JSON.
                            1 => b"0123456789eE+-.,:{}[]\"x"[random.below(23)],
                            _ => random.bits() as u8,
                        };
                    }
                }
            }
            fs::write(path, &bytes).unwrap();
            let damage = format!("{ratios:?}, {}", path.display());
            measured += usize::from(survives(case, &written.recording(), &damage));
            fs::write(path, &whole).unwrap();
        }
    }
    println!("{measured} of {BYTE_CASES} damaged recordings could be measured");
    assert!(measured > 5, "the damage is not subtle enough: {measured}");
}

/// The places of the numbers in a JSON text.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let digit = |b: u8| b.is_ascii_digit() || b"+-.eE".contains(&b);
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start_of_one = bytes[at].is_ascii_digit() || bytes[at] == b'-';
        if start_of_one && matches!(bytes[at - 1], b' ' | b'\n' | b'[' | b':' | b',') {
            let start = at;
            while digit(bytes[at]) {
                at += 1;
            }
            found.push(start..at);
        }
        at += 1;
    }
    found
}

fn is_ratio(text: &str, place: &std::ops::Range<usize>) -> bool {
    text[..place.start].ends_with("\"ratio\": ")
}

#[test]
fn ratios_of_any_size_never_panic() {
    let mut panicked = Vec::new();
    for ratios in FORMS {
        let written = Written::new(&small_recording(8, ratios));
        let whole = fs::read_to_string(written.manifest()).unwrap();
        let places = numbers(&whole);
        for number in NUMBERS {
            for old in ratios {
                let old = format!("{old:?}");
                let mut text = whole.clone();
                for place in places.iter().rev() {
                    if is_ratio(&whole, place) && whole[place.clone()] == old {
                        text.replace_range(place.clone(), number);
                    }
                }
                assert!(text != whole || number == "1", "{old}");
                fs::write(written.manifest(), text).unwrap();
                if outcome(&written.recording()).is_none() {
                    panicked.push(format!("{ratios:?} with {number} for {old}"));
                }
            }
        }
    }
    assert!(panicked.is_empty(), "{panicked:#?}");
}

#[test]
fn extreme_numbers_never_panic() {
    let mut random = Random::new(SEED + 1);
    let mut measured = 0;
    for ratios in FORMS {
        let written = Written::new(&small_recording(8, ratios));
        let whole = fs::read_to_string(written.manifest()).unwrap();
        // Another test is for ratios.
        let mut places = numbers(&whole);
        places.retain(|place| !is_ratio(&whole, place));
        assert!(places.len() > 50, "{}", places.len());
        for case in 0..NUMBER_CASES / 3 {
            let mut text = whole.clone();
            let mut damage = format!("{ratios:?}");
            let place = places[random.below(places.len())].clone();
            let number = NUMBERS[random.below(NUMBERS.len())];
            let old = whole[place.clone()].to_owned();
            // Everywhere that the same number occurs (a ratio occurs with each of its frames), or
            // once.
            if random.below(2) == 0 {
                for place in places.iter().rev().filter(|p| whole[(*p).clone()] == old) {
                    text.replace_range(place.clone(), number);
                }
                damage += &format!(", every {old} is {number}");
            } else {
                let line = whole[..place.start].lines().count();
                text.replace_range(place, number);
                damage += &format!(", {old} is {number} in line {line}");
            }
            fs::write(written.manifest(), text).unwrap();
            measured += usize::from(survives(case, &written.recording(), &damage));
        }
    }
    println!("{measured} of {NUMBER_CASES} recordings with an extreme number could be measured");
    assert!(measured > 20, "{measured}");
}

#[test]
fn frames_of_any_content_never_panic() {
    let mut random = Random::new(SEED + 2);
    for bit_depth in [8, 10, 12, 16] {
        for frames in [
            geometric().frames,
            levels(&[1.0, 35.0 / 36.0, 5.0 / 6.0], 3),
            levels(&[0.8, 1.0], 5),
            levels(&[0.3], 8),
        ] {
            // Noise over the full scale, then all black and all white.
            for noise in [3.0, 0.0] {
                let scene = Scene {
                    size: 24,
                    bit_depth,
                    projector: (64, 48),
                    noise,
                    seed: random.bits(),
                    ..Scene::new(40.0, frames.clone())
                };
                let recording = scene.record();
                let outcome = catch_unwind(AssertUnwindSafe(|| {
                    measure(&recording, Path::new("noise")).is_ok()
                }));
                assert!(outcome.unwrap_or(false), "{bit_depth} bit, {frames:?}");
            }
        }
    }
}
