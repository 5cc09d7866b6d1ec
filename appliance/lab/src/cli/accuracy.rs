//! `fringed-lab accuracy --out DIR`: what the error of a height is made of, and how fine a
//! structure is seen.

use crate::accuracy::{Resolution, Share, budget, resolution};
use crate::experiment::{OpticsKind, Scene};
use appliance::cli::{Output, Threads, names};
use appliance::error::{Exit, Result};
use appliance::output::picture::height_png;
use appliance::storage::folder::OutputFolder;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Divide the error of heights into noise and what remains without it, and find the smallest dents
/// that are seen.
#[derive(Debug, clap::Args)]
pub struct Accuracy {
    /// Folder for the maps of the errors without noise; made if it does not exist.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    out: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

#[derive(Serialize)]
struct Answer {
    errors: Vec<Share>,
    dents: Vec<Resolution>,
}

const PARTS: [&str; 4] = ["cone", "sawtooth", "sphere", "spline"];
const OPTICS: [OpticsKind; 2] = [OpticsKind::Sharp, OpticsKind::Real];
/// The noise of all measurements.
const SEED: u64 = 1;

impl Accuracy {
    /// Measures, writes the maps and prints the tables.
    ///
    /// # Errors
    /// If a part cannot be measured or a map not be written.
    pub fn run(&self) -> Result<()> {
        let folder = OutputFolder::create(&self.out)?;
        let pool = self.threads.pool(0)?;
        let failed = Exit::Software.because("measure the simulated parts");
        let (mut errors, mut dents) = (Vec::new(), Vec::new());
        for optics in OPTICS {
            for part in PARTS {
                self.output.progress().tell(0.0, part);
                let Some(scene) = Scene::named(part) else {
                    continue;
                };
                let found = pool
                    .install(|| budget(&scene, optics, SEED))
                    .map_err(&failed)?;
                let [width, height] = found.size;
                let name = format!("bias-{part}-{}.png", optics.word());
                folder.write(&name, &height_png(width, height, &found.bias_mm))?;
                errors.push(found.share);
            }
            if let Some(scene) = Scene::named(PARTS[0]) {
                dents.extend(
                    pool.install(|| resolution(&scene, optics))
                        .map_err(&failed)?,
                );
            }
        }
        self.output.progress().clear();
        let text = || tables(&errors, &dents);
        let (errors, dents) = (errors.clone(), dents.clone());
        self.output.answer(&Answer { errors, dents }, text)
    }
}

/// Both tables as Markdown.
fn tables(errors: &[Share], dents: &[Resolution]) -> String {
    let mut text = String::from(
        "| part | optics | RMS, µm | noise | without noise | 99 % of it | stated σ |\n|---|---|---:|---:|---:|---:|---:|\n",
    );
    for row in errors {
        let Share { part, optics, .. } = row;
        let um = [
            row.total_mm,
            row.noise_mm,
            row.systematic_mm,
            row.systematic_p99_mm,
            row.stated_mm,
        ];
        let [total, noise, systematic, p99, stated] = um.map(|mm| 1e3 * mm);
        let _ = writeln!(
            text,
            "| {part} | {optics} | {total:.1} | {noise:.1} | {systematic:.1} | {p99:.1} | {stated:.1} |"
        );
    }
    text.push_str("\n| dent, mm | optics | depth of a pixel, % | of a mean of 9 × 9, % |\n|---:|---|---:|---:|\n");
    for row in dents {
        let _ = writeln!(
            text,
            "| {} | {} | {:.0} | {:.0} |",
            row.diameter_mm,
            row.optics,
            100.0 * row.of_pixel,
            100.0 * row.of_mean
        );
    }
    text
}
