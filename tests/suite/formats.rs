//! The files that the program reads and writes are as documented.

use crate::station_plc::Place;
use crate::written::program;
use algo::inspect::Measure;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use tests::shared::root;

fn document(name: &str) -> String {
    fs::read_to_string(root().join("docs").join(name)).unwrap()
}

/// Members of a recipe, version 3. If this fails, do not change the test without a new version:
/// files of this one must stay readable.
const MEMBERS: [&str; 11] = [
    "recipe.json",
    "phase_function.npy",
    "golden_phase.npy",
    "golden_height.npy",
    "height_slope.npy",
    "height_curvature.npy",
    "valid.npy",
    "modulation.npy",
    "phase_reach.npy",
    "sequence_offset.npy",
    "golden_signal.npy",
];

/// Keys of `recipe.json`, version 3, in a taught recipe. Do not change these either.
const KEYS: [&str; 103] = [
    "alignment",
    "calibration",
    "camera",
    "camera.bit_depth",
    "camera.height",
    "camera.width",
    "comparison",
    "comparison.adaptive",
    "comparison.adaptive.coverage",
    "comparison.adaptive.frames",
    "comparison.adaptive.sigma_mm",
    "comparison.fixed",
    "comparison.fixed.coverage",
    "comparison.fixed.frames",
    "comparison.fixed.sigma_mm",
    "datums",
    "expansion_range_turns",
    "exposing",
    "exposing.exposure_us",
    "exposing.gain",
    "exposures",
    "features",
    "features.kind",
    "features.name",
    "features.region",
    "fingerprint",
    "format",
    "gauges",
    "gauges.high",
    "gauges.kind",
    "gauges.low",
    "gauges.name",
    "gauges.of",
    "gauges.slot",
    "gauges.smoothing_px",
    "golden_captures",
    "golden_offset_counts",
    "good_parts",
    "good_parts.beyond",
    "good_parts.dent_mm",
    "good_parts.displaced_mm",
    "good_parts.displaced_scatter_mm",
    "good_parts.largest_mm",
    "good_parts.least_weight",
    "good_parts.left_out",
    "good_parts.limit_mm",
    "good_parts.scatter_mm",
    "good_parts.smoothing_px",
    "good_parts.tolerance_mm",
    "good_parts.weighed",
    "good_parts.wider",
    "good_parts.wider_px",
    "guard_k",
    "judges_nothing",
    "least_modulation",
    "min_coverage",
    "models",
    "models.camera",
    "models.camera.cx",
    "models.camera.cy",
    "models.camera.distortion",
    "models.camera.fx",
    "models.camera.fy",
    "models.camera.rotation",
    "models.camera.translation_mm",
    "models.projector",
    "models.projector.cx",
    "models.projector.cy",
    "models.projector.distortion",
    "models.projector.fx",
    "models.projector.fy",
    "models.projector.rotation",
    "models.projector.translation_mm",
    "name",
    "noise_counts",
    "number",
    "part_number",
    "pattern",
    "pattern.kind",
    "placement_tolerance_mm",
    "production",
    "projector",
    "projector.height",
    "projector.width",
    "range_mm",
    "read_noise_counts",
    "sequences",
    "sequences.frames",
    "sequences.kind",
    "sequences.ripple_mm",
    "sequences.safe_share",
    "sequences.sigma_mm",
    "sequences.unseen_orders",
    "sequences.unseen_orders.darkest",
    "sequences.unseen_orders.part",
    "shot_noise",
    "taught_at_unix_s",
    "taught_by",
    "tried",
    "tried.gauge",
    "tried.passes",
    "two_frames",
    "version",
];
/// Keys that `recipe.json` may have in addition, and members of the recipe.
const OPTIONAL: [&str; 19] = [
    "models.plane",
    "calibration_sigma",
    "height_mm",
    "length_mm",
    "amplitude.npy",
    "smoothing.npy",
    "fringes",
    "tolerance_mm",
    "about",
    "above_mm",
    "component",
    "datum",
    "nominal",
    "golden",
    "plus",
    "minus",
    "master",
    "master_u",
    "golden_value",
];

fn collect(value: &Value, prefix: &str, keys: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                let path = format!("{prefix}{key}");
                collect(value, &format!("{path}."), keys);
                keys.insert(path);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| collect(item, prefix, keys)),
        _ => {}
    }
}

/// Name and content of each member of a ZIP file without compression (APPNOTE 6.3.10, section
/// 4.3.7).
fn stored_members(mut zip: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut members = Vec::new();
    while let Some(header) = zip.strip_prefix(b"PK\x03\x04") {
        let short = |at: usize| usize::from(u16::from_le_bytes([header[at], header[at + 1]]));
        let (method, size) = (short(4), short(14) | short(16) << 16);
        assert_eq!(method, 0, "members are stored");
        let name = 26..26 + short(22);
        let content = name.end + short(24)..name.end + short(24) + size;
        members.push((
            String::from_utf8(header[name].to_vec()).unwrap(),
            header[content.clone()].to_vec(),
        ));
        zip = &header[content.end..];
    }
    members
}

#[test]
fn a_taught_recipe_has_exactly_the_documented_members_and_keys() {
    let place = Place::taught();
    let members = stored_members(&fs::read(place.recipe()).unwrap());
    let names = members.iter().map(|(name, _)| &**name);
    let names: Vec<&str> = names.filter(|name| !OPTIONAL.contains(name)).collect();
    assert_eq!(names, MEMBERS);
    let text = str::from_utf8(&members[0].1).unwrap();
    let manifest: Value = serde_json::from_str(text).unwrap();
    assert_eq!(
        (&manifest["format"], &manifest["version"]),
        (&"fringed-recipe".into(), &3.into())
    );
    let mut keys = BTreeSet::new();
    collect(&manifest, "", &mut keys);
    assert_eq!(keys.iter().map(String::as_str).collect::<Vec<_>>(), KEYS);
    let documented = document("formats.md");
    for name in MEMBERS.iter().chain(&KEYS).chain(&OPTIONAL) {
        let name = name
            .rsplit('.')
            .next()
            .filter(|_| !name.ends_with(".npy") && !name.ends_with(".json"))
            .unwrap_or(name);
        assert!(
            documented.contains(&format!("`{name}`")),
            "docs/formats.md names no `{name}`"
        );
    }
}

#[test]
fn every_documented_gauge_is_read_and_written_as_it_stands_there() {
    let documented = document("formats.md");
    let (_, from) = documented
        .split_once("possible values of `kind` with their parameters:\n\n```json\n")
        .unwrap();
    let (list, _) = from.split_once("```").unwrap();
    let documented: Vec<Measure> = serde_json::from_str(list).unwrap();
    assert_eq!(documented, Measure::examples());
    let list: Value = serde_json::from_str(list).unwrap();
    assert_eq!(serde_json::to_value(documented).unwrap(), list);
}

/// First and last address of a block, as the document states them.
fn span(documented: &str, block: &str) -> (u64, u64) {
    let (_, span) = documented
        .split_once(&format!("**{block}**: "))
        .unwrap_or_else(|| panic!("no block {block}"));
    let (first, rest) = span.split_once('–').unwrap();
    let last = rest.split(|letter: char| !letter.is_ascii_digit()).next();
    (first.parse().unwrap(), last.unwrap().parse().unwrap())
}

/// How many registers a value of a type takes, by the document's rule.
fn registers(kind: &str) -> u64 {
    let (one, times) = kind.split_once(" x ").unwrap_or((kind, "1"));
    let one = match one {
        "bits" | "u16" | "i16" => 1,
        "u32" | "i32" | "f32" => 2,
        "u64" => 4,
        text => text.strip_prefix("ascii ").unwrap().parse::<u64>().unwrap() / 2,
    };
    one * times.parse::<u64>().unwrap()
}

#[test]
fn the_documentation_holds_the_register_map() {
    let json = program().run(&["registers", "--json"]).succeeded().stdout;
    let json: Value = serde_json::from_str(&json).unwrap();
    let documented = document("modbus.md");
    let flowing = documented.replace('\n', " ");
    for row in json["registers"].as_array().unwrap() {
        let text = |key: &str| row[key].as_str().unwrap();
        let number = |key: &str| row[key].as_u64().unwrap();
        let (block, name) = (text("block"), text("name"));
        let (address, count) = (number("address"), number("registers"));
        let (first, last) = span(&documented, block);
        assert!(first <= address && address + count <= last + 1, "{row}");
        let base = if block == "CONTROL" { 400_001 } else { 300_001 };
        assert_eq!(number("reference"), base + address, "{row}");
        assert_eq!(count, registers(text("type")), "{row}");
        // The blocks of OLDEST have the layouts of others.
        if block.starts_with("OLDEST") {
            continue;
        }
        let (kind, meaning) = (text("type"), text("meaning"));
        let line = format!("| {address} | {name} | {kind} | {meaning} |\n");
        // One sentence documents both ends of the blocks that hold one value of each gauge.
        let words = format!("{name} ({kind}, {meaning})");
        let end = match name {
            "SEQ" => Some(first),
            "SEQ_AGAIN" => Some(last - 1),
            _ => None,
        };
        let said = end == Some(address) && flowing.contains(&words);
        assert!(
            documented.contains(&line) || said,
            "docs/modbus.md lacks: {line}"
        );
    }
}

#[test]
fn the_documented_scenario_is_the_default_one() {
    let documented = document("formats.md");
    let (_, from) = documented.split_once("```toml\n").unwrap();
    let (scenario, _) = from.split_once("```").unwrap();
    let read = sim::Scenario::from_toml(scenario, "docs/formats.md").unwrap();
    assert_eq!(read, sim::Scenario::default());
}

/// Keys of `calibration.json`, version 2, of a head with a plate. If this fails, do not change the
/// test without a new version: files of this one must stay readable.
const CALIBRATION: [&str; 72] = [
    "camera",
    "camera.bit_depth",
    "camera.height",
    "camera.model",
    "camera.model.cx",
    "camera.model.cy",
    "camera.model.distortion",
    "camera.model.fx",
    "camera.model.fy",
    "camera.model.rotation",
    "camera.model.translation_mm",
    "camera.width",
    "checksum",
    "contrast",
    "contrast.modulation_counts",
    "contrast.pitches",
    "contrast.pitches.contrast",
    "contrast.pitches.pitch_px",
    "fingerprint",
    "format",
    "heights_by",
    "made_at_unix_s",
    "made_by",
    "models_from",
    "noise",
    "noise.counts",
    "noise.exposing",
    "noise.exposing.exposure_us",
    "noise.exposing.gain",
    "noise.levels",
    "noise.levels.counts",
    "noise.levels.level",
    "noise.read_counts",
    "noise.shot",
    "projector",
    "projector.height",
    "projector.model",
    "projector.model.cx",
    "projector.model.cy",
    "projector.model.distortion",
    "projector.model.fx",
    "projector.model.fy",
    "projector.model.rotation",
    "projector.model.translation_mm",
    "projector.width",
    "reference",
    "reference.horizontal",
    "reference.horizontal.file",
    "reference.horizontal.filled",
    "reference.horizontal.noise_turns",
    "reference.horizontal.residual_turns",
    "reference.horizontal.sha256",
    "reference.models_off_px",
    "reference.pitch_px",
    "reference.plane",
    "reference.plane.eta",
    "reference.plane.xi",
    "reference.vertical",
    "reference.vertical.file",
    "reference.vertical.filled",
    "reference.vertical.noise_turns",
    "reference.vertical.residual_turns",
    "reference.vertical.sha256",
    "response",
    "timing",
    "timing.flip_to_light_ns",
    "timing.readout_ns",
    "timing.refreshes",
    "timing.sigma_ns",
    "timing.stamp",
    "timing.stamp_late_ns",
    "version",
];

#[test]
fn a_calibration_has_exactly_the_documented_keys() {
    let place = Place::new();
    let config = place.path("fringed.toml");
    program()
        .run(&["calibrate", "--quiet", "--config", config.to_str().unwrap()])
        .succeeded();
    let text = fs::read_to_string(place.path("state/calibration/calibration.json")).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&file["format"], &file["version"]),
        (&"fringed-calibration".into(), &2.into())
    );
    let mut keys = BTreeSet::new();
    collect(&file, "", &mut keys);
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    assert_eq!(keys, CALIBRATION);
    let documented = document("formats.md");
    for key in CALIBRATION.iter().chain(&["temperature_c"]) {
        let name = key.rsplit('.').next().unwrap();
        assert!(
            documented.contains(&format!("`{name}`")),
            "docs/formats.md names no `{name}`"
        );
    }
}
