//! `fringed-lab experiment --out DIR`: the paper's experiments as tables, arrays and pictures.
//! `tests/peers/plots.py` draws them.

use super::adapt::Form;
use crate::experiment::{Campaign, OpticsKind, PARTS, Results, RunRow, Scene, csv, means};
use appliance::cli::{Output, Threads, names, numbers};
use appliance::error::{Exit, Failure, Result};
use appliance::storage::folder::OutputFolder;
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

impl Experiment {
    /// Runs the experiments, writes their results and prints the means.
    ///
    /// # Errors
    /// If a part is not known, a run fails or the results cannot be written.
    pub fn run(&self) -> Result<()> {
        let campaign = Campaign {
            scenes: self.scenes()?,
            optics: self.optics,
            seeds: self.seeds,
            sines: self.waveform == Form::Sine,
        };
        let folder = OutputFolder::create(&self.out)?;
        let pool = self.threads.pool(0)?;
        let progress = self.output.progress();
        let on_progress = |share: f64, words: &str| progress.tell(share, words);
        let results = pool.install(|| campaign.run(&on_progress));
        progress.clear();
        let results = results.map_err(Exit::Software.because("run the experiments"))?;
        let means = means(&results.rows);
        write(&folder, &results)?;
        let text = || {
            let tables = tables(&campaign, &means);
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
}

fn write(folder: &OutputFolder, results: &Results) -> Result<()> {
    folder.write("experiments.csv", csv(&results.rows).as_bytes())?;
    for (name, content) in &results.shown {
        folder.write(name, content)?;
    }
    Ok(())
}

/// A table for each part and each of its optics.
fn tables(campaign: &Campaign, means: &[RunRow]) -> String {
    let mut tables = Vec::new();
    for scene in &campaign.scenes {
        for optics in scene.optics(campaign.optics) {
            let same = |row: &&RunRow| row.part == scene.name && row.optics == optics.word();
            let rows: Vec<&RunRow> = means.iter().filter(same).collect();
            tables.push(crate::experiment::table(scene, &rows));
        }
    }
    tables.join("\n")
}
