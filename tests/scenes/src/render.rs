//! Small rendered recordings: the pattern's equation (docs/measurement.md) sampled on an analytic
//! surface, with seeded noise.
//!
//! Each pixel is one point sample on its central ray (no pixel integration, no blur, no shadows),
//! so the truth is exact and the only errors are those of the noise. Some patches are spoilt on
//! purpose: one is dark, one over full scale, one has no contrast in its finest level, and in one
//! the modulation fades through the threshold.

use crate::oracle::{Pattern, Rig};
use crate::random::Random;
use crate::rig;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::replay::Recording;
use hal::replay::recording::{PatternSpec, RecordedFrame, RecordedProjector};
use hal::units::Timestamp;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// What to render.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Camera pixels each way.
    pub size: u32,
    /// Bits of a sample.
    pub bit_depth: u8,
    /// Projector columns and rows.
    pub projector: (u32, u32),
    /// The patterns.
    pub patterns: Vec<PatternSpec>,
    /// Ratio and shift of each frame, for every pattern.
    pub frames: Vec<(f64, f64)>,
    /// Half width of the uniform noise, as a share of full scale.
    pub noise: f64,
    /// Whether to render the spoilt patches.
    pub patches: bool,
    /// Seed of the noise.
    pub seed: u64,
    /// Whether the projector stands above the camera instead of beside it.
    pub above: bool,
}

/// Height of the bump's top above the plane, mm, and its radius on the plane.
const BUMP: (f64, f64) = (9.0, 55.0);

impl Scene {
    /// 96 × 96 pixels of 8 bit, ± 2.5 % noise, vertical fringes.
    pub fn new(fringes: f64, frames: Vec<(f64, f64)>) -> Self {
        Self {
            size: 96,
            bit_depth: 8,
            projector: (256, 192),
            patterns: vec![PatternSpec::Vertical { fringes }],
            frames,
            noise: 0.025,
            patches: true,
            seed: 1,
            above: false,
        }
    }

    /// Renders the frames, with truth and models.
    pub fn record(&self) -> Recording {
        let (columns, rows) = self.projector;
        let format = FrameFormat::packed(self.size, self.size, self.bit_depth);
        let mut models = [rig::camera(self.size), rig::projector(columns, rows)];
        if self.above {
            models = models.map(rig::above);
        }
        let [camera, projector] = models;
        let projector = RecordedProjector {
            width: columns,
            height: rows,
            model: Some(projector),
            plane: None,
        };
        let mut recording = Recording {
            description: "a tilted plane with a bump".to_owned(),
            source: "rendered by the integration suite".to_owned(),
            camera_model: Some(camera),
            patterns: self.patterns.clone(),
            range_mm: Some([-60.0, 60.0]),
            ..Recording::new(format, projector)
        };
        let geometry = Rig::of(&recording).expect("both models are there");
        let pixels = (self.size * self.size) as usize;
        let place = |at: usize| {
            let size = self.size as usize;
            ((at % size) as f64, (at / size) as f64)
        };
        let heights: Vec<f64> = (0..pixels)
            .map(|at| height_on_ray(&geometry, place(at)))
            .collect();
        let finest = self.frames.iter().map(|f| f.0).fold(0.0, f64::max);
        let full = f64::from(format.full_scale());
        let mut random = Random::new(self.seed);
        for pattern in 0..self.patterns.len() {
            let function = Pattern::of(&recording, pattern);
            let phases: Vec<f64> = (0..pixels)
                .map(|at| {
                    let (u, v) = place(at);
                    geometry.phase_at(&function, u, v, heights[at])
                })
                .collect();
            for &(ratio, shift_turns) in &self.frames {
                let samples = (0..pixels).map(|at| {
                    let light = self.light(place(at), ratio == finest);
                    let sine = (TAU * (ratio * phases[at] + shift_turns)).sin();
                    let noise = self.noise * (2.0 * random.share() - 1.0);
                    let share = light.offset + light.modulation * sine + noise;
                    (full * share).round().clamp(0.0, full) as u16
                });
                let samples: Vec<u16> = samples.collect();
                let place = recording.frames.len() as u64;
                recording.frames.push(RecordedFrame {
                    ratio,
                    shift_turns,
                    harmonics: Vec::new(),
                    pattern,
                    timestamp_ns: Some(1_000_000 * place),
                    frame: frame(format, samples, place),
                });
            }
        }
        let classes = (0..pixels).map(|at| match self.spoilt(place(at)) {
            Patch::None => 2,
            _ => 1,
        });
        recording.truth_class = Some(classes.collect());
        recording.truth_height = Some(heights.iter().map(|z| *z as f32).collect());
        recording
    }

    /// Offset and modulation of a pixel's light, as shares of full scale.
    fn light(&self, (u, v): (f64, f64), finest: bool) -> PixelLight {
        // A uniform part, lit a little more on one side; at 8 bit B is 82 to 113 counts.
        let albedo = 0.32 + 0.12 * u / f64::from(self.size);
        let even = PixelLight {
            offset: 0.06 + albedo,
            modulation: albedo,
        };
        match self.spoilt((u, v)) {
            Patch::None => even,
            Patch::Dark => PixelLight {
                offset: 0.06,
                modulation: 0.01,
            },
            Patch::Bright => PixelLight {
                offset: 0.85,
                modulation: 0.6,
            },
            Patch::Flat if finest => PixelLight {
                modulation: 0.02,
                ..even
            },
            Patch::Flat => even,
            Patch::Fading => PixelLight {
                offset: 0.3,
                modulation: 0.02 + 0.1 * v / f64::from(self.size),
            },
        }
    }

    fn spoilt(&self, (u, v): (f64, f64)) -> Patch {
        let (u, v) = (u / f64::from(self.size), v / f64::from(self.size));
        let inside = |left: f64, top: f64, side: f64| {
            (left..left + side).contains(&u) && (top..top + side).contains(&v)
        };
        if !self.patches {
            Patch::None
        } else if inside(0.05, 0.05, 0.15) {
            Patch::Dark
        } else if inside(0.8, 0.05, 0.15) {
            Patch::Bright
        } else if inside(0.05, 0.8, 0.15) {
            Patch::Flat
        } else if u >= 0.94 {
            Patch::Fading
        } else {
            Patch::None
        }
    }
}

/// Offset and modulation, as shares of full scale.
struct PixelLight {
    offset: f64,
    modulation: f64,
}

enum Patch {
    None,
    Dark,
    Bright,
    Flat,
    Fading,
}

/// Frame number `place`, with these samples.
fn frame(format: FrameFormat, samples: Vec<u16>, place: u64) -> Frame {
    let pixels = if format.bit_depth == 8 {
        Pixels::Eight(samples.iter().map(|sample| *sample as u8).collect())
    } else {
        Pixels::Sixteen(samples)
    };
    let timestamp = Timestamp(1_000_000 * place);
    Frame::new(format, Arc::new(pixels), timestamp, place).expect("a frame of its own format")
}

/// The part: a plane tilted about both axes, with a bump in the form of one cosine arch. Its
/// steepest slope is 0.35, so that camera and projector see all of it.
pub fn surface(x: f64, y: f64) -> f64 {
    let (top, radius) = BUMP;
    let r = ((x - 8.0).powi(2) + (y + 5.0).powi(2)).sqrt();
    let bump = if r < radius {
        top / 2.0 * (1.0 + (PI * r / radius).cos())
    } else {
        0.0
    };
    0.03 * x - 0.02 * y + bump - 1.0
}

/// The height at which the ray of a pixel meets the part, by bisection; the ray is steeper than the
/// part.
fn height_on_ray(geometry: &Rig, (u, v): (f64, f64)) -> f64 {
    let above = |z: f64| {
        let [x, y, z] = geometry.camera.point_at(u, v, z);
        z > surface(x, y)
    };
    let (mut low, mut high) = (-60.0, 60.0);
    for _ in 0..80 {
        let middle = (low + high) / 2.0;
        if above(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (low + high) / 2.0
}

/// Ratio and shift of the frames of several levels with `shifts` shifts k/N each, in the order of
/// the ratios.
pub fn levels(ratios: &[f64], shifts: usize) -> Vec<(f64, f64)> {
    ratios
        .iter()
        .flat_map(|&ratio| (0..shifts).map(move |k| (ratio, k as f64 / shifts as f64)))
        .collect()
}

/// A recording of few pixels, with every optional part.
pub fn small_recording(bit_depth: u8, ratios: &[f64]) -> Recording {
    let (columns, rows) = (32, 24);
    let turns = (0..rows * columns).map(|at| f64::from(at % columns) + f64::from(at) / 999.0);
    let sampled = PatternSpec::File {
        rows: rows as usize,
        columns: columns as usize,
        turns: turns.collect(),
    };
    let scene = Scene {
        size: 12,
        bit_depth,
        projector: (columns, rows),
        patterns: vec![PatternSpec::Vertical { fringes: 30.0 }, sampled],
        patches: false,
        ..Scene::new(0.0, levels(ratios, 3))
    };
    let mut recording = scene.record();
    recording.noise_counts = Some(3.7);
    recording.exposure_us = Some(1e4);
    recording
}
