//! Rendered recordings of every form that can be decoded.

use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use std::f64::consts::TAU;
use tests::render::{Scene, levels};

/// Names and recordings: every form of levels, 8 to 16 bit, 3 to 8 shifts, vertical, horizontal and
/// sampled patterns, and finest ratios other than 1.
pub fn all() -> Vec<(&'static str, Recording)> {
    let geometric = |fringes: f64| [0.94 / fringes, (0.94 / fringes).sqrt(), 1.0];
    let three = |n: f64| [1.0, 1.0 - 1.0 / (n * n), 1.0 - 1.0 / n];
    vec![
        (
            "geometric, 4 shifts, 8 bit",
            Scene::new(49.0, levels(&geometric(49.0), 4)).record(),
        ),
        (
            "geometric, 3 shifts, 12 bit",
            deep(12, Scene::new(36.0, levels(&geometric(36.0), 3))),
        ),
        (
            "geometric, 5 shifts, 10 bit",
            deep(10, Scene::new(49.0, levels(&geometric(49.0), 5))),
        ),
        (
            "geometric, 8 shifts, 16 bit",
            deep(16, Scene::new(81.0, levels(&geometric(81.0), 8))),
        ),
        (
            "geometric, finest ratio 0.8",
            Scene::new(64.0, levels(&[0.0148, 0.11, 0.8], 4)).record(),
        ),
        (
            "geometric, finest ratio 1.7, shuffled",
            Scene::new(40.0, shuffled(&[0.0235, 0.2, 1.7])).record(),
        ),
        (
            "dense three, n = 6, 4 shifts, 8 bit",
            Scene::new(81.0, levels(&three(6.0), 4)).record(),
        ),
        (
            "dense three, n = 4, 3 shifts, 12 bit",
            deep(12, Scene::new(64.0, levels(&three(4.0), 3))),
        ),
        (
            "dense two, n = 5, 3 shifts, 8 bit",
            Scene::new(49.0, levels(&[0.8, 1.0], 3)).record(),
        ),
        (
            "single, 8 shifts, 10 bit",
            deep(10, Scene::new(25.0, levels(&[1.0], 8))),
        ),
        (
            "single, ratio 0.7, 5 shifts, 16 bit",
            deep(16, Scene::new(36.0, levels(&[0.7], 5))),
        ),
        ("vertical and horizontal", both()),
        ("horizontal, no models", horizontal()),
        ("sampled, geometric, both ends in view", ends_in_view()),
        ("sampled, geometric", sampled(&[0.0118, 0.11, 1.0])),
        ("sampled, dense three", sampled(&three(6.0))),
    ]
}

fn deep(bit_depth: u8, scene: Scene) -> Recording {
    Scene {
        bit_depth,
        seed: u64::from(bit_depth),
        ..scene
    }
    .record()
}

/// The frames of all levels mixed, with shifts that decrease from 0.37.
fn shuffled(ratios: &[f64]) -> Vec<(f64, f64)> {
    let mut frames: Vec<(f64, f64)> = levels(ratios, 5)
        .into_iter()
        .map(|(ratio, shift)| (ratio, 0.37 - shift))
        .collect();
    frames.sort_by(|a, b| (a.1 * 7.3).fract().total_cmp(&(b.1 * 7.3).fract()));
    frames.rotate_left(4);
    frames
}

fn both() -> Recording {
    Scene {
        patterns: vec![
            PatternSpec::Horizontal { fringes: 36.0 },
            PatternSpec::Vertical { fringes: 49.0 },
        ],
        seed: 12,
        ..Scene::new(0.0, levels(&[0.019, 0.137, 1.0], 4))
    }
    .record()
}

/// Fringes along the baseline give almost no information about the height, so only the phase is
/// compared.
fn horizontal() -> Recording {
    let mut recording = Scene {
        patterns: vec![PatternSpec::Horizontal { fringes: 48.0 }],
        seed: 13,
        ..Scene::new(0.0, levels(&[0.02, 0.14, 1.0], 3))
    }
    .record();
    recording.camera_model = None;
    recording.projector.model = None;
    recording
}

/// The camera sees the smallest and the largest phase, so noise moves the coarsest level beyond
/// both ends of its turn. The pattern is constant beyond them, so only the phase is compared.
fn ends_in_view() -> Recording {
    let (columns, rows) = (256_usize, 192_usize);
    let turns = (0..rows * columns).map(|at| {
        let xi = (at % columns) as f64 / columns as f64;
        5.2 + 40.0 * ((xi - 0.4) / 0.2).clamp(0.0, 1.0)
    });
    let spec = PatternSpec::File {
        rows,
        columns,
        turns: turns.collect(),
    };
    let mut recording = Scene {
        patterns: vec![spec],
        seed: 15,
        ..Scene::new(0.0, levels(&[0.94 / 40.0, 0.15, 1.0], 4))
    }
    .record();
    recording.camera_model = None;
    recording.projector.model = None;
    recording
}

/// A pattern whose pitch varies along its rows and slightly from row to row; its smallest phase is
/// not 0.
fn sampled(ratios: &[f64]) -> Recording {
    let (columns, rows) = (256_usize, 192_usize);
    let turns = (0..rows * columns).map(|at| {
        let (xi, eta) = (
            (at % columns) as f64 / columns as f64,
            (at / columns) as f64,
        );
        -3.3 + 70.0 * xi + 2.5 * (TAU * xi).sin() + 0.004 * (eta - 96.0) * (TAU * xi).cos()
    });
    let spec = PatternSpec::File {
        rows,
        columns,
        turns: turns.collect(),
    };
    Scene {
        patterns: vec![spec],
        seed: 14,
        ..Scene::new(0.0, levels(ratios, 4))
    }
    .record()
}
