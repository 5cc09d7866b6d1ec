//! Pictures of a synthetic surface, as another program would have taken them.

use crate::written::{laboratory, program};
use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tests::files;
use tests::program::Run;
use tests::random::Random;

pub const WIDTH: usize = 140;
pub const HEIGHT: usize = 100;
/// Columns and rows of the projector of the synthetic scenes.
pub const PROJECTOR: (u32, u32) = (400, 240);

/// The projector pixel that lights a camera pixel, on a wavy surface.
pub fn lit_by(u: usize, v: usize) -> (f64, f64) {
    let (u, v) = (u as f64, v as f64);
    let wave = (v / 17.0).sin() + (u / 23.0).cos();
    (14.0 + 2.6 * u + 2.0 * wave, 12.0 + 2.1 * v + 1.5 * wave)
}

pub fn save(path: &Path, colour: png::ColorType, samples: &[u8]) {
    let file = fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, WIDTH as u32, HEIGHT as u32);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(samples).unwrap();
}

/// A folder of pictures and a place for a recording and results.
pub struct Scene {
    folder: TempDir,
    count: usize,
    noise: Random,
}

impl Scene {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("pictures")).unwrap();
        Self {
            folder,
            count: 0,
            noise: Random::new(5),
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Adds the picture of light that is a function of the projector pixel, 0 to 1, with ± 2 counts
    /// of noise.
    pub fn show(&mut self, light: impl Fn(f64, f64) -> f64) {
        let mut samples = Vec::with_capacity(WIDTH * HEIGHT);
        for v in 0..HEIGHT {
            for u in 0..WIDTH {
                let (xi, eta) = lit_by(u, v);
                let noise = self.noise.share() * 4.0 - 2.0;
                let counts = 25.0 + 190.0 * light(xi, eta) + noise;
                samples.push(counts.round() as u8);
            }
        }
        let name = format!("pictures/pat{}.png", self.count);
        self.count += 1;
        save(&self.path(&name), png::ColorType::Grayscale, &samples);
    }

    /// Adds the pictures of a level of vertical fringes: `shift(k)` in turns of a cosine.
    pub fn level(&mut self, fringes: f64, steps: usize, shift: impl Fn(f64) -> f64) {
        for k in 0..steps {
            let shift = shift(k as f64 / steps as f64);
            let turns = |xi: f64| fringes * xi / f64::from(PROJECTOR.0) + shift;
            self.show(|xi, _| 0.5 + 0.5 * (TAU * turns(xi)).cos());
        }
    }

    pub fn import(&self, options: &[&str]) -> Run {
        let (pictures, out) = (self.path("pictures"), self.path("recording"));
        import(&pictures, &out, "400x240", options)
    }

    pub fn measure(&self) -> PathBuf {
        let out = self.path("out");
        let run = program().measure(&self.path("recording"), &out, &[]);
        run.succeeded();
        out
    }
}

pub fn import(pictures: &Path, out: &Path, projector: &str, options: &[&str]) -> Run {
    let (pictures, out) = (pictures.to_str().unwrap(), out.to_str().unwrap());
    let mut all = vec!["import", pictures, "--out", out, "--projector", projector];
    all.extend(options);
    laboratory().run(&all)
}

/// The notes of an import with `--json`.
pub fn notes(run: &Run) -> Vec<String> {
    let report: serde_json::Value = serde_json::from_str(&run.stdout).expect("JSON");
    let notes = report["notes"].as_array().unwrap().iter();
    notes
        .map(|note| note.as_str().unwrap().to_owned())
        .collect()
}

/// Checks a phase against the projector coordinate, in pixels; returns how many pixels have one.
pub fn check_phase(
    path: &Path,
    pitch: f64,
    coordinate: impl Fn(usize, usize) -> f64,
    bound: f64,
) -> usize {
    let phase = files::array(path);
    assert_eq!((phase.rows, phase.columns), (HEIGHT, WIDTH));
    let known = phase
        .elements
        .iter()
        .enumerate()
        .filter(|(_, turns)| !turns.is_nan());
    let mut count = 0;
    for (at, &turns) in known {
        let error = f64::from(turns) * pitch - coordinate(at % WIDTH, at / WIDTH);
        assert!(error.abs() < bound, "pixel {at} is off by {error} px");
        count += 1;
    }
    count
}

pub fn png_of(width: u32, height: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer
        .write_image_data(&vec![9; (width * height) as usize])
        .unwrap();
    writer.finish().unwrap();
    file
}
