//! `fringed-lab accuracy --out DIR`: what the error of a height is made of: noise, what remains
//! without noise, and how fine a structure is seen.

use crate::experiment::{BetterSequence, Method, OpticsKind, Run, Runner, Scene};
use algo::phase::Trust;
use appliance::cli::{Output, Threads, names};
use appliance::error::{Exit, Result};
use appliance::head::calibrated::MeasureError;
use appliance::measure::{GROSS_MM, Truth};
use appliance::output::picture::height_png;
use appliance::storage::folder::OutputFolder;
use serde::Serialize;
use sim::Part;
use sim::parts::{Defect, SheetMetal};
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

#[derive(Default, Serialize)]
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
        let mut answer = Answer::default();
        for optics in OPTICS {
            for part in PARTS {
                self.output.progress().tell(0.0, part);
                let Some(scene) = Scene::named(part) else {
                    continue;
                };
                let found = pool
                    .install(|| divided(&scene, optics, SEED))
                    .map_err(&failed)?;
                let [width, height] = found.size;
                let name = format!("bias-{part}-{}.png", optics.word());
                folder.write(&name, &height_png(width, height, &found.bias_mm))?;
                answer.errors.push(found.share);
            }
            if let Some(scene) = Scene::named(PARTS[0]) {
                let dents = pool.install(|| resolution(&scene, optics));
                answer.dents.extend(dents.map_err(&failed)?);
            }
        }
        self.output.progress().clear();
        self.output.answer(&answer, || tables(&answer))
    }
}

/// Both tables as Markdown.
fn tables(answer: &Answer) -> String {
    let mut text = String::from(
        "| part | optics | RMS, µm | noise | without noise | 99 % of it | stated σ |\n|---|---|---:|---:|---:|---:|---:|\n",
    );
    for row in &answer.errors {
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
    for row in &answer.dents {
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

/// Measures a scene with the pattern made for it and 12 frames. Without noise only the camera's
/// rounding is left.
fn measure(scene: &Scene, optics: OpticsKind, seed: u64) -> Result<(Runner, Run), MeasureError> {
    let mut runner = Runner::new(scene, optics)?;
    let run = runner.run(Method::Better(BetterSequence::TWELVE), seed)?;
    Ok((runner, run))
}

/// The error of one part with one setting of the optics, mm.
#[derive(Debug, Serialize)]
struct Share {
    /// The part.
    part: &'static str,
    /// The optics.
    optics: &'static str,
    /// RMS error with the study's noise.
    total_mm: f64,
    /// RMS error without noise; the camera rounds.
    systematic_mm: f64,
    /// √(total² − systematic²).
    noise_mm: f64,
    /// RMS of the σ that is stated for the pixels.
    stated_mm: f64,
    /// 99 % of the errors without noise are smaller.
    systematic_p99_mm: f64,
}

/// The division, and the map of the errors without noise.
struct Divided {
    share: Share,
    /// Columns and rows of the map.
    size: [u32; 2],
    /// The map: mm, row-major, NaN where they are not known.
    bias_mm: Vec<f32>,
}

/// Measures a part with the noise of `seed` and without.
///
/// # Errors
/// If the part cannot be simulated or measured.
fn divided(scene: &Scene, optics: OpticsKind, seed: u64) -> Result<Divided, MeasureError> {
    let (noisy, run) = measure(scene, optics, seed)?;
    let with_noise = errors(noisy.truth(), &run);
    let sigmas = run.measured.heights.sigma.iter().zip(&with_noise);
    let sigmas = sigmas.filter(|(_, error)| !error.is_nan());
    let stated = rms(sigmas.map(|(&sigma, _)| f64::from(sigma)));
    let quiet = Scene {
        noise_counts: 0.0,
        ..scene.clone()
    };
    let (runner, run) = measure(&quiet, optics, seed)?;
    let bias_mm = errors(runner.truth(), &run);
    let known = |errors: &[f32]| -> Vec<f64> {
        let known = errors.iter().filter(|error| !error.is_nan());
        known.map(|&error| f64::from(error)).collect()
    };
    let total = rms(known(&with_noise).into_iter());
    let mut biases = known(&bias_mm);
    let systematic = rms(biases.iter().copied());
    biases.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let p99 = biases.get(biases.len() * 99 / 100);
    let width = run.measured.heights.width.max(1);
    Ok(Divided {
        share: Share {
            part: scene.name,
            optics: optics.word(),
            total_mm: total,
            systematic_mm: systematic,
            noise_mm: (total * total - systematic * systematic).max(0.0).sqrt(),
            stated_mm: stated,
            systematic_p99_mm: p99.map_or(f64::NAN, |error| error.abs()),
        },
        size: [width as u32, (bias_mm.len() / width) as u32],
        bias_mm,
    })
}

/// The errors of the resolved, wholly lit pixels but the gross ones, mm; NaN elsewhere.
fn errors(truth: &sim::Truth, run: &Run) -> Vec<f32> {
    let (heights, trust) = (&run.measured.heights.height, &run.measured.phases.trust);
    let mut errors = vec![f32::NAN; heights.len()];
    for at in Truth::from(truth).whole_pixels() {
        let error = heights[at].mm() - f64::from(truth.height[at]);
        if trust[at] == Trust::Resolved && error.abs() <= GROSS_MM {
            errors[at] = error as f32;
        }
    }
    errors
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for value in values {
        squares += value * value;
        count += 1.0;
    }
    (squares / f64::max(count, 1.0)).sqrt()
}

/// What is left of a dent's depth in the middle of the dent, without noise.
#[derive(Debug, Serialize)]
struct Resolution {
    /// The optics.
    optics: &'static str,
    /// Diameter of the dent, mm.
    diameter_mm: f64,
    /// What is left in the height of a single pixel.
    of_pixel: f64,
    /// What is left in the mean of 9 × 9 pixels.
    of_mean: f64,
}

/// Diameters, mm.
const DIAMETERS: [f64; 7] = [0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0];
/// Depth, mm.
const DENT_DEPTH: f64 = 0.2;
/// Where the dent is: on the flat plate between bead, slot and the large hole, mm.
const DENT_AT: [f64; 2] = [-20.0, 4.0];
/// Side of the mean, pixels: that of a deviation's squares unless the recipe says otherwise.
const SIDE: usize = 9;

/// Measures the sheet-metal part good and with dents, without noise.
///
/// # Errors
/// If the part cannot be simulated or measured.
fn resolution(scene: &Scene, optics: OpticsKind) -> Result<Vec<Resolution>, MeasureError> {
    let with = |defects| Scene {
        part: Part::SheetMetal(SheetMetal {
            defects,
            ..Default::default()
        }),
        noise_counts: 0.0,
        ..scene.clone()
    };
    let (runner, good) = measure(&with(Vec::new()), optics, 1)?;
    let truth = runner.truth().height.clone();
    let mut found = Vec::new();
    for diameter_mm in DIAMETERS {
        let dent = Defect::Dent {
            x: DENT_AT[0],
            y: DENT_AT[1],
            depth_mm: DENT_DEPTH,
            diameter_mm,
        };
        let (runner, dented) = measure(&with(vec![dent]), optics, 1)?;
        let depths = truth.iter().zip(&runner.truth().height);
        let depths: Vec<f64> = depths.map(|(a, b)| f64::from(a - b)).collect();
        let known = (0..depths.len()).filter(|&at| depths[at].is_finite());
        let Some(middle) = known.max_by(|&a, &b| depths[a].total_cmp(&depths[b])) else {
            continue;
        };
        let left = |side| mean_change(&good, &dented, middle, side) / DENT_DEPTH;
        found.push(Resolution {
            optics: optics.word(),
            diameter_mm,
            of_pixel: left(1),
            of_mean: left(SIDE),
        });
    }
    Ok(found)
}

/// By how much the mean height of a square about a pixel is lower in the second run, mm.
fn mean_change(good: &Run, dented: &Run, middle: usize, side: usize) -> f64 {
    let width = good.measured.heights.width;
    let reach = side / 2 * (width + 1);
    let first = middle.saturating_sub(reach);
    let places =
        (0..side).flat_map(|row| (0..side).map(move |column| first + row * width + column));
    let height = |run: &Run, at: usize| run.measured.heights.height[at].mm();
    let sum: f64 = places.map(|at| height(good, at) - height(dented, at)).sum();
    sum / (side * side) as f64
}
