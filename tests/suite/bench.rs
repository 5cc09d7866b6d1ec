//! `fringed-lab bench`: its keys and files, with frames that are too small to measure the speed.

use crate::written::laboratory;
use serde_json::Value;
use std::fs;

/// Share of the pixels that a kernel gets right; at the smallest size a few pixels lie on the edge
/// of the part.
const RIGHT: f64 = 0.99;

fn json(arguments: &[&str]) -> Value {
    let run = laboratory().run(arguments).succeeded();
    serde_json::from_str(&run.stdout).unwrap()
}

fn positive(value: &Value, key: &str) -> f64 {
    let number = value[key].as_f64();
    let number = number.unwrap_or_else(|| panic!("{key} of {value} is no number"));
    assert!(number > 0.0, "{key} is {number}");
    number
}

#[test]
fn the_kernel_table_has_its_keys_and_every_variant_decodes_rightly() {
    // Users' scripts read these keys: if this fails, do not change the test.
    let all = json(&["bench", "kernel", "--quick", "--json"]);
    assert!(all["machine"]["processor"].is_string());
    assert!(positive(&all["machine"], "cores") >= 1.0);
    let kernel = all["kernel"].as_object().unwrap();
    positive(&all["kernel"], "floor_ns_per_px");
    let workloads = [
        "geometric_12",
        "geometric_12_quiet",
        "dense_12_quiet",
        "golden_4_quiet",
        "golden_3_quiet",
        "geometric_9_quiet",
        "background_25",
        "background_50",
        "background_75",
        "geometric_9",
        "geometric_24",
        "bits_10",
        "bits_12",
        "dense_12",
        "golden_6",
        "golden_4",
        "golden_3",
    ];
    for workload in workloads {
        let decoders = kernel.keys().filter(|name| name.ends_with(workload));
        assert!(decoders.count() >= 1, "{workload} is not timed");
    }
    for workload in ["geometric_12", "dense_12"] {
        let last = format!("_last_frames_of_{workload}");
        assert!(kernel.keys().any(|name| name.ends_with(&last)), "{last}");
    }
    // N = 3 to 9 shifts at three geometric levels and at two dense ones.
    for shifts in 3..=9 {
        for workload in [
            format!("_geometric_{}", 3 * shifts),
            format!("_golden_{}", 2 * shifts),
        ] {
            let mut names = kernel.keys();
            assert!(names.any(|name| name.ends_with(&workload)), "{workload}");
        }
    }
    for (name, variant) in kernel.iter().filter(|(_, value)| value.is_object()) {
        for key in ["frames", "ns_per_px", "x_floor"] {
            positive(variant, key);
        }
        let least = positive(variant, "least_ns_per_px");
        assert!(least <= positive(variant, "ns_per_px"), "{name}: {variant}");
        let [least, most] = [0, 1].map(|end| variant["x_floor_range"][end].as_f64());
        let median = variant["x_floor"].as_f64();
        assert!(least <= median && median <= most, "{name}: {variant}");
        let right = positive(variant, "right");
        assert!(right >= RIGHT, "{name} has {right} of its pixels right");
    }
}

#[test]
fn time_stands_against_error_and_the_cycle_has_its_stages() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out_name = out.to_str().unwrap();
    let all = json(&["bench", "accuracy", "--quick", "--json", "--out", out_name]);
    let points = all["accuracy"].as_array().unwrap();
    for point in points {
        for key in [
            "frames",
            "steps",
            "bits",
            "ns_per_px",
            "x_floor",
            "ms_per_set",
        ] {
            positive(point, key);
        }
        assert!(positive(point, "rms_mm") < 0.5, "{point}");
    }
    let frames: Vec<u64> = points.iter().filter_map(|p| p["frames"].as_u64()).collect();
    for count in [24, 12, 9, 6, 4, 3] {
        assert!(frames.contains(&count), "{count} frames are missing");
    }
    assert!(points.iter().any(|point| point["skipping"] == true));
    // Every sequence is decoded by the textbook, too.
    let textbook = points.iter().filter(|p| p["implementation"] == "f64");
    assert_eq!(textbook.count(), 10);
    let csv = fs::read_to_string(out.join("accuracy.csv")).unwrap();
    let header = csv.lines().next().unwrap();
    assert_eq!(header, fringed_lab::benchmark::HEADER);
    // With one part every line is a mean.
    assert_eq!(csv.lines().count(), points.len() + 1);
    let tables = fs::read_to_string(out.join("benchmarks.md")).unwrap();
    assert!(tables.starts_with("Machine"), "{tables}");
    let written = fs::read_to_string(out.join("benchmarks.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&written).unwrap(), all);

    let all = json(&["bench", "budget", "--quick", "--json"]);
    for gauges in [
        "8_mean_heights",
        "8_planes",
        "32_mean_heights",
        "32_planes",
        "32_planes_64_gauges",
    ] {
        let row = &all["budget"]["160x120"][gauges];
        positive(row, "verdict_ms");
        positive(row, "one_thread_ms");
    }
    for frames in ["4", "12"] {
        let sizes = &all["budget"]["160x120"];
        let cycle = &sizes[frames];
        for name in ["production", "aligned", "moved", "kernel"] {
            positive(&sizes[format!("{name}_golden_{frames}")], "ns_per_px");
        }
        positive(&sizes[format!("production_golden_{frames}")], "x_kernel");
        for key in [
            "exposure_ms",
            "verdict_ms",
            "one_thread_ms",
            "kernel_ms",
            "x_kernel",
        ] {
            positive(cycle, key);
        }
        assert!(positive(cycle, "total_ms") >= positive(cycle, "exposure_ms"));
        // The camera takes half a second to start, and is on.
        assert_eq!(cycle["start_ms"], 0.0);
        assert!(!cycle["stages"].as_object().unwrap().is_empty());
    }
}

#[test]
fn the_frames_that_are_timed_can_be_had_as_files() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().to_str().unwrap();
    laboratory()
        .run(&["bench", "--quick", "--frames", name])
        .succeeded();
    let sequence = fs::read_to_string(folder.path().join("sequence.json")).unwrap();
    let sequence: Value = serde_json::from_str(&sequence).unwrap();
    assert_eq!(sequence["frames"].as_array().unwrap().len(), 12);
    let bytes = fs::read(folder.path().join("frame-11.npy")).unwrap();
    let frame: hal::npy::Array<u8> = hal::npy::read(&bytes).unwrap();
    assert_eq!((frame.rows, frame.columns), (48, 64));
    let bytes = fs::read(folder.path().join("phase.npy")).unwrap();
    let phase: hal::npy::Array<f64> = hal::npy::read(&bytes).unwrap();
    assert!(
        phase
            .elements
            .iter()
            .all(|turns| (0.0..64.0).contains(turns))
    );
}

#[test]
fn wrong_arguments_measure_nothing() {
    for arguments in [
        &["bench", "speed"][..],
        &["bench", "--size", "3"],
        &["bench", "kernel", "--frames", "x"],
    ] {
        let run = laboratory().run(arguments);
        assert_eq!(run.code, 64, "{arguments:?}: {}", run.stderr);
        assert_eq!(run.stdout, "");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let name = file.to_str().unwrap();
    let run = laboratory().run(&["bench", "--quick", "--out", name]);
    assert_eq!(run.code, 73, "{}", run.stderr);
}
