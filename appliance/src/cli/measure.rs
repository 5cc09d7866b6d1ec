//! `fringed measure RECORDING [--recipe FILE | --about FILE] [--calibration FILE] --out DIR`.

use super::names;
use super::options::{Output, Threads};
use crate::error::{Exit, Result};
use crate::history::kept;
use crate::measure::{MeasuredRecording, measure_about_map, measure_with, models};
use crate::output::cloud::{Axes, Pixels};
use crate::output::{grey_png, picture};
use crate::storage::archive::Unpacked;
use crate::storage::folder::OutputFolder;
use algo::pipeline::PhaseMap;
use hal::npy;
use hal::replay::Recording;
use std::path::{Path, PathBuf};

/// Measure a recording.
#[derive(Debug, clap::Args)]
pub struct Measure {
    /// Folder with recording.json and its frames, or the ZIP that the page gives.
    recording: PathBuf,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    out: PathBuf,
    /// Recipe of the part: dense and single levels are unwrapped about its golden map.
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    /// Expected phase as adapt writes it: dense and single levels are unwrapped about this map.
    #[arg(long, value_name = "FILE.npy", conflicts_with = "recipe")]
    about: Option<PathBuf>,
    /// Measure with the models of this calibration.json instead of the recording's.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Frame of the points in cloud.ply.
    #[arg(long, default_value = "world")]
    axes: Axes,
    /// Pixels of cloud.ply: those with a height, or all, row by row.
    #[arg(long, default_value = "resolved")]
    pixels: Pixels,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

impl Measure {
    /// Measures, writes the results and prints the report.
    ///
    /// # Errors
    /// If the recording cannot be opened or measured, or the results cannot be written.
    pub fn run(&self) -> Result<()> {
        let unpacked = Unpacked::of(&self.recording)?;
        let mut recording = Recording::open(unpacked.folder())?;
        let models = match &self.calibration {
            Some(calibration) => models::replace(&mut recording, calibration)?,
            None => None,
        };
        let recipe = self.recipe.as_deref().map(kept::read).transpose()?;
        let pool = self.threads.pool(0)?;
        let about = self.about.as_deref().map(expected_phase).transpose()?;
        let measured = || match &about {
            Some(map) => measure_about_map(&recording, unpacked.folder(), map),
            None => measure_with(&recording, unpacked.folder(), recipe.as_ref()),
        };
        let mut measurement = pool.install(measured)?;
        measurement.report.add_models(models);
        let folder = OutputFolder::create(&self.out)?;
        pool.install(|| write(&folder, &measurement, (self.axes, self.pixels)))?;
        let json = serde_json::to_string_pretty(&measurement.report)
            .map_err(Exit::Software.because("write the report"))?;
        folder.write("report.json", format!("{json}\n").as_bytes())?;
        let text = || {
            let table = measurement.report.table();
            format!("{}\nwritten to {}", table.trim_end(), self.out.display())
        };
        self.output.answer(&measurement.report, text)
    }
}

/// The largest file of an expected phase: f64 of the largest camera.
const MAX_MAP: u64 = 1 << 30;

/// The expected phase in a file.
fn expected_phase(path: &Path) -> Result<npy::Array<f64>> {
    let what = || format!("read {}", path.display());
    let remedy = "name the expected phase that fringed-lab adapt wrote";
    let missing = Exit::Missing.advising(what(), remedy);
    if std::fs::metadata(path).map_err(&missing)?.len() > MAX_MAP {
        let too_large = Exit::Content.advising(what(), remedy);
        return Err(too_large("it is larger than a map of any camera"));
    }
    let bytes = std::fs::read(path).map_err(&missing)?;
    npy::read::<f64>(&bytes).map_err(Exit::Content.because(what()))
}

/// Files that are written only if there are heights.
const SURFACE: [&str; 4] = ["height.npy", "sigma.npy", "height.png", "cloud.ply"];

/// Files of Gray codes alone, by the beginning of their names.
const PLACES: [&str; 2] = ["column", "row"];

/// Files of each pattern, by the beginning of their names.
const OF_PATTERN: [&str; 4] = ["phase", "wrapped", "modulation", "mask"];

fn write(
    folder: &OutputFolder,
    measurement: &MeasuredRecording,
    form: (Axes, Pixels),
) -> Result<()> {
    let array = |name: &str, width, values: &[f32]| folder.write(name, &npy::write(width, values));
    let patterns = measurement.phases.len();
    write_pattern(folder, measurement, measurement.primary, "")?;
    let several = if patterns > 1 { patterns } else { 0 };
    for pattern in 0..several {
        write_pattern(folder, measurement, pattern, &format!("-{pattern}"))?;
    }
    // Files of an earlier measurement that this one does not write would be taken for its results.
    for name in OF_PATTERN {
        let mut beyond = several;
        while folder.remove(&format!("{name}-{beyond}.npy"))? {
            beyond += 1;
        }
    }
    let width = measurement.phases[measurement.primary].width;
    for name in PLACES {
        folder.remove(&format!("{name}.npy"))?;
    }
    for ((name, pitch), map) in measurement.places.iter().zip(&measurement.phases) {
        let places = turns(map).into_iter();
        let places: Vec<f32> = places.map(|turns| turns * *pitch as f32).collect();
        array(&format!("{name}.npy"), width, &places)?;
    }
    let picture = grey_png(width, &measurement.intensity);
    folder.write("picture.png", &picture)?;
    if measurement.heights.is_err() {
        for name in SURFACE {
            folder.remove(name)?;
        }
    }
    if let Ok(surface) = &measurement.heights {
        let map = &surface.map;
        let mm: Vec<f32> = map.height.iter().map(|height| height.mm() as f32).collect();
        let [height, sigma, picture_of, points] = SURFACE;
        array(height, map.width, &mm)?;
        array(sigma, map.width, &map.sigma)?;
        let rows = mm.len() / map.width.max(1);
        let png = picture::height_png(map.width as u32, rows as u32, &mm);
        folder.write(picture_of, &png)?;
        folder.write(points, &surface.ply(form, &measurement.intensity))?;
    }
    Ok(())
}

/// The phases, the modulation and the mask of one pattern, in files whose names end in `suffix`.
fn write_pattern(
    folder: &OutputFolder,
    measurement: &MeasuredRecording,
    pattern: usize,
    suffix: &str,
) -> Result<()> {
    let (absolute, wrapped) = (&measurement.phases[pattern], &measurement.wrapped[pattern]);
    let width = wrapped.width;
    let named = OF_PATTERN.map(|name| format!("{name}{suffix}.npy"));
    let [phase_file, wrapped_file, modulation_file, mask_file] = &named;
    let valid = match measurement.wrapped_only[pattern] {
        None => {
            folder.write(phase_file, &npy::write(width, &turns(absolute)))?;
            absolute
        }
        Some(_) => {
            folder.remove(phase_file)?;
            wrapped
        }
    };
    folder.write(wrapped_file, &npy::write(width, &turns(wrapped)))?;
    let full_scale = measurement.full_scale;
    let counts = wrapped.modulation.iter();
    let counts: Vec<f32> = counts
        .map(|modulation| modulation.counts(full_scale) as f32)
        .collect();
    folder.write(modulation_file, &npy::write(width, &counts))?;
    let mask = valid.trust.iter().map(|trust| u8::from(trust.has_phase()));
    let mask: Vec<u8> = mask.collect();
    folder.write(mask_file, &npy::write(width, &mask))
}

/// Phase in turns, NaN where modulation, saturation or residual reject the pixel.
fn turns(phases: &PhaseMap) -> Vec<f32> {
    let pixels = phases.phase.iter().zip(&phases.trust);
    pixels
        .map(|(phase, trust)| {
            if trust.has_phase() {
                phase.turns() as f32
            } else {
                f32::NAN
            }
        })
        .collect()
}
