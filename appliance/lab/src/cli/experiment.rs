//! `fringed-lab experiment --out DIR`: the paper's experiments as tables, arrays and pictures, of all
//! runs of the chosen parts: parts × optics × seeds × methods. `tests/peers/plots.py` draws them.

use super::adapt::Form;
use crate::experiment::{
    OpticsKind, PARTS, Run, RunRow, Runner, SHOWN, Scene, csv, means, set_ratios, table,
};
use algo::pattern::{Encoder, Shot};
use algo::phase::Trust;
use appliance::cli::{Output, Threads, names, numbers};
use appliance::error::{Exit, Failure, Result};
use appliance::head::calibrated::MeasureError;
use appliance::output::grey_png;
use appliance::storage::folder::OutputFolder;
use hal::npy;
use std::path::PathBuf;

/// Repeat the paper's experiments on the simulated head.
#[derive(Debug, clap::Args)]
pub struct Experiment {
    /// Parts, or all.
    #[arg(long, value_name = "NAME", num_args = 1.., default_value = "all")]
    part: Vec<String>,
    /// How sharp projector and camera are.
    #[arg(long, value_enum, default_value = "sharp")]
    optics: OpticsKind,
    /// Noise seeds.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = numbers::number(1_u64, 100))]
    seeds: u64,
    /// What the better sequences show: the waveform with the most modulation for each number of
    /// shifts, or a sine.
    #[arg(long, value_enum, default_value_t = Form::Bright)]
    waveform: Form,
    /// Folder for tables, arrays and pictures; made if it does not exist.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    out: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

/// The results of all runs.
#[derive(Debug, Default)]
struct Results {
    /// One row per run.
    rows: Vec<RunRow>,
    /// File names and contents of what some methods showed, saw and measured.
    shown: Vec<(String, Vec<u8>)>,
}

impl Experiment {
    /// Runs the experiments, writes their results and prints the means.
    ///
    /// # Errors
    /// If a part is not known, a run fails or the results cannot be written.
    pub fn run(&self) -> Result<()> {
        let scenes = self.scenes()?;
        let folder = OutputFolder::create(&self.out)?;
        let pool = self.threads.pool(0)?;
        let progress = self.output.progress();
        let on_progress = |share: f64, words: &str| progress.tell(share, words);
        let results = pool.install(|| self.measure(&scenes, &on_progress));
        progress.clear();
        let results = results.map_err(Exit::Software.because("run the experiments"))?;
        let means = means(&results.rows);
        write(&folder, &results)?;
        let text = || {
            let tables = self.tables(&scenes, &means);
            format!("{}\nwritten to {}", tables.trim_end(), self.out.display())
        };
        self.output.answer(&means, text)
    }

    fn scenes(&self) -> Result<Vec<Scene>> {
        let all = self.part.iter().any(|name| name == "all");
        let names: Vec<&str> = if all {
            PARTS.to_vec()
        } else {
            self.part.iter().map(String::as_str).collect()
        };
        let mut scenes: Vec<Scene> = Vec::new();
        for name in names {
            let scene = Scene::named(name).ok_or_else(|| {
                let known = PARTS.join(", ");
                let message = format!("experiment: no part {name:?}: name one of {known}, all");
                Failure::new(Exit::Usage, message)
            })?;
            if scenes.iter().all(|known| known.name != scene.name) {
                scenes.push(scene);
            }
        }
        Ok(scenes)
    }

    /// Runs each method of each scene with each seed. `progress` is called with the share done, 0…1,
    /// and with the run that begins.
    ///
    /// # Errors
    /// If the simulated head or a pattern fails.
    fn measure(
        &self,
        scenes: &[Scene],
        progress: &dyn Fn(f64, &str),
    ) -> Result<Results, MeasureError> {
        let mut results = Results::default();
        let sines = self.waveform == Form::Sine;
        let settings = scenes.iter().flat_map(|scene| {
            let kinds = scene.optics(self.optics);
            kinds.into_iter().map(move |optics| (scene, optics))
        });
        let settings: Vec<_> = settings.collect();
        let count = |(scene, _): &(&Scene, _)| scene.methods(sines).len() as u64 * self.seeds;
        let total = settings.iter().map(count).sum::<u64>().max(1) as f64;
        for (scene, optics) in settings {
            let about = format!("{}, {} optics", scene.name, optics.word());
            let done = results.rows.len() as f64;
            progress(done / total, &format!("{about}: light of the scene"));
            let mut runner = Runner::new(scene, optics)?;
            for seed in 1..=self.seeds {
                for method in scene.methods(sines) {
                    let done = results.rows.len() as f64;
                    let words = format!("{about}, seed {seed}: {}", method.name());
                    progress(done / total, &words);
                    let run = runner.run(method, seed)?;
                    let row = RunRow::new(scene, optics, method, seed, run.values);
                    results.rows.push(row);
                    if seed == 1 && SHOWN.contains(&method) {
                        let name = format!("{}-{}-{}", scene.name, optics.word(), method.name());
                        results.shown.extend(shown(&name, &run));
                    }
                }
            }
        }
        set_ratios(&mut results.rows);
        Ok(results)
    }

    /// A table for each part and each of its optics.
    fn tables(&self, scenes: &[Scene], means: &[RunRow]) -> String {
        let mut tables = Vec::new();
        for scene in scenes {
            for optics in scene.optics(self.optics) {
                let same = |row: &&RunRow| row.part == scene.name && row.optics == optics.word();
                let rows: Vec<&RunRow> = means.iter().filter(same).collect();
                tables.push(table(scene, &rows));
            }
        }
        tables.join("\n")
    }
}

/// The finest pattern and its frame as pictures, and the measured heights in mm as an array of the
/// frame's size, NaN where a pixel is not resolved.
fn shown(name: &str, run: &Run) -> [(String, Vec<u8>); 3] {
    let raster = Encoder::new(None, &[]).raster(&run.function, Shot::sine(1.0, 0.0));
    let frame = &run.measured.frames[run.finest];
    let format = frame.format();
    let shift = format.bit_depth - 8;
    let counts = frame.counts().into_iter();
    let seen: Vec<u8> = counts.map(|count| (count as u16 >> shift) as u8).collect();
    let measured = &run.measured;
    let heights = measured.heights.height.iter().zip(&measured.phases.trust);
    let heights: Vec<f32> = heights
        .map(|(height, trust)| match trust {
            Trust::Resolved => height.mm() as f32,
            _ => f32::NAN,
        })
        .collect();
    [
        (
            format!("{name}-pattern.png"),
            grey_png(raster.width, &raster.pixels),
        ),
        (
            format!("{name}-frame.png"),
            grey_png(format.width as usize, &seen),
        ),
        (
            format!("{name}-height.npy"),
            npy::write(measured.heights.width, &heights),
        ),
    ]
}

fn write(folder: &OutputFolder, results: &Results) -> Result<()> {
    folder.write("experiments.csv", csv(&results.rows).as_bytes())?;
    for (name, content) in &results.shown {
        folder.write(name, content)?;
    }
    Ok(())
}
