//! Single stages, each on 512 × 512 pixels of the study's rig: `cargo bench -p algo [NAME]`.
//!
//! For work on one stage. Published figures come from `fringed-lab bench`, which keeps the frames
//! out of the caches.

#![expect(clippy::unwrap_used, reason = "a benchmark may fail loudly")]

use algo::frame::{FrameView, Samples};
use algo::geometry::{Pinhole, PinholeModel, Reference, Triangulator};
use algo::pattern::{Encoder, PhaseFunction, Sequence, Shot};
use algo::phase::{Decoder, Trust};
use algo::pipeline::{PhaseMap, decode, triangulate};
use algo::units::AbsolutePhase;
use divan::Bencher;
use divan::counter::ItemsCount;
use std::f64::consts::TAU;

const SIDE: usize = 512;
const PIXELS: usize = SIDE * SIDE;

fn main() {
    divan::main();
}

fn device(width: usize, height: usize, fov: [f64; 2], angle: f64, distortion: [f64; 5]) -> Pinhole {
    let (sin, cos) = f64::to_radians(angle).sin_cos();
    let focal = |size: usize, fov: f64| size as f64 / 2.0 / (fov.to_radians() / 2.0).tan();
    let model = PinholeModel {
        fx: focal(width, fov[0]),
        fy: focal(height, fov[1]),
        cx: (width - 1) as f64 / 2.0,
        cy: (height - 1) as f64 / 2.0,
        distortion,
        rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
        translation: [0.0, 0.0, 600.0],
    };
    Pinhole::new(model, width, height).unwrap()
}

fn function() -> PhaseFunction {
    PhaseFunction::vertical(1024, 768, 100.0).unwrap()
}

fn triangulator() -> Triangulator {
    let camera = device(SIDE, SIDE, [20.0; 2], 20.0, [-0.12, 0.15, 2e-4, -3e-4, 0.0]);
    let lens = [-0.05, 0.03, -3e-4, 2e-4, 0.0];
    let projector = device(1024, 768, [43.6, 33.4], -7.0, lens);
    Triangulator::new(camera, projector, Reference::Models, function(), None).unwrap()
}

/// A sequence, its frames of the plane z = 0, and the map about which dense and single ones are
/// unwrapped.
struct Scene {
    decoder: Decoder,
    frames: Vec<Vec<u8>>,
    map: Vec<AbsolutePhase>,
}

impl Scene {
    fn new(frames: &[Shot]) -> Self {
        let map = triangulator().reference_map();
        let sequence = Sequence::from_frames(frames).unwrap();
        let light = |&Shot { ratio, shift, .. }: &Shot| {
            let sample = |phase: &AbsolutePhase| {
                let sine = (TAU * (ratio * phase.turns() + shift)).sin();
                (122.0 + 100.0 * sine).round() as u8
            };
            map.iter().map(sample).collect()
        };
        Self {
            decoder: Decoder::new(&sequence, function().range(), 8).unwrap(),
            frames: frames.iter().map(light).collect(),
            map,
        }
    }

    fn geometric() -> Self {
        Self::new(&Sequence::geometric(function().range(), 3, 4))
    }

    fn views(&self) -> Vec<FrameView<'_>> {
        let view = |frame| FrameView::new(Samples::Eight(frame), SIDE, SIDE, SIDE).unwrap();
        self.frames.iter().map(|frame| view(frame)).collect()
    }

    fn decode(&self) -> PhaseMap {
        decode(&self.decoder, &self.views(), Some(&self.map), None).unwrap()
    }
}

fn bench_decode(bencher: Bencher<'_, '_>, scene: &Scene) {
    bencher
        .counter(ItemsCount::new(PIXELS))
        .bench(|| scene.decode());
}

#[divan::bench]
fn decode_geometric_12(bencher: Bencher<'_, '_>) {
    bench_decode(bencher, &Scene::geometric());
}

#[divan::bench]
fn decode_dense_12(bencher: Bencher<'_, '_>) {
    bench_decode(bencher, &Scene::new(&Sequence::dense(6.0, 4)));
}

#[divan::bench]
fn decode_golden_4(bencher: Bencher<'_, '_>) {
    let level: Vec<Shot> = Shot::level(1.0, 4).collect();
    bench_decode(bencher, &Scene::new(&level));
}

#[divan::bench]
fn triangulate_every_pixel(bencher: Bencher<'_, '_>) {
    let (scene, triangulator) = (Scene::geometric(), triangulator());
    let phases = scene.decode();
    assert!(phases.count(Trust::Resolved) > PIXELS / 2);
    bencher
        .counter(ItemsCount::new(PIXELS))
        .with_inputs(|| phases.clone())
        .bench_values(|mut phases| {
            triangulate(&triangulator, &scene.decoder, None, &mut phases, &|_| ())
        });
}

#[divan::bench]
fn reference_map(bencher: Bencher<'_, '_>) {
    let triangulator = triangulator();
    let counter = ItemsCount::new(PIXELS);
    bencher
        .counter(counter)
        .bench(|| triangulator.reference_map());
}

#[divan::bench]
fn pattern_raster(bencher: Bencher<'_, '_>) {
    let function = function();
    let shot = Shot::sine(1.0, 0.25);
    let counter = ItemsCount::new(1024_usize * 768);
    bencher
        .counter(counter)
        .bench(|| Encoder::new(None, &[]).raster(&function, shot));
}
