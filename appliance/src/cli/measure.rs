//! `fringed measure RECORDING [--recipe FILE] --out DIR`.

use super::names;
use super::options::{Output, Threads};
use crate::error::{Exit, Failure};
use crate::history::kept;
use crate::measure::{Measurement, measure_with};
use crate::output::picture;
use crate::storage::folder::OutputFolder;
use crate::storage::unpack::Unpacked;
use algo::pipeline::PhaseMap;
use hal::npy;
use hal::replay::Recording;
use std::path::PathBuf;

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
    pub fn run(&self) -> Result<(), Failure> {
        let unpacked = Unpacked::of(&self.recording)?;
        let recording = Recording::open(unpacked.folder())?;
        let recipe = self.recipe.as_deref().map(kept::read).transpose()?;
        let pool = self.threads.pool(0)?;
        let measured = || measure_with(&recording, unpacked.folder(), recipe.as_ref());
        let measurement = pool.install(measured)?;
        let folder = OutputFolder::create(&self.out)?;
        pool.install(|| write(&folder, &measurement))?;
        let json = serde_json::to_string_pretty(&measurement.report)
            .map_err(|error| Failure::because(Exit::Software, "write the report", error))?;
        folder.write("report.json", format!("{json}\n").as_bytes())?;
        let text = || {
            let table = measurement.report.table();
            format!("{}\nwritten to {}", table.trim_end(), self.out.display())
        };
        self.output.answer(&measurement.report, text)
    }
}

/// Files that are written only if there are heights.
const SURFACE: [&str; 4] = ["height.npy", "sigma.npy", "height.png", "cloud.ply"];

/// The file of one pattern's phase, where a recording has several.
fn phase_of(pattern: usize) -> String {
    format!("phase-{pattern}.npy")
}

fn write(folder: &OutputFolder, measurement: &Measurement) -> Result<(), Failure> {
    let array = |name: &str, width, values: &[f32]| folder.write(name, &npy::write(width, values));
    let phases = &measurement.phases;
    let primary = &phases[measurement.primary];
    array("phase.npy", primary.width, &turns(primary))?;
    let patterns = if phases.len() > 1 { phases.len() } else { 0 };
    for (at, phase) in phases[..patterns].iter().enumerate() {
        array(&phase_of(at), phase.width, &turns(phase))?;
    }
    // Files of an earlier measurement that this one does not write would be taken for its results.
    let mut beyond = patterns;
    while folder.remove(&phase_of(beyond))? {
        beyond += 1;
    }
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
        folder.write(points, &surface.ply(&measurement.intensity))?;
    }
    Ok(())
}

/// Absolute phase in turns, NaN where modulation, saturation or residual reject the pixel.
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
