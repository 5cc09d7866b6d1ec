//! `fringed record DIR [--recipe FILE]`: a sequence from the configured head as a recording.

use super::names;
use super::numbers::number;
use super::options::SimulatedPart;
use super::options::{Files, Quiet, Threads};
use crate::error::{Exit, Result};
use crate::head::scan::take;
use crate::head::seam;
use crate::history::{RECIPE, kept};
use crate::production::backend::{self, OpenedHead};
use crate::recipe::Recipe;
use crate::recipe::plan::Plan;
use algo::pattern::{PhaseFunction, Sequence};
use hal::bounds::MAX_FRINGES;
use hal::replay::Recording;
use hal::replay::recorder;
use hal::replay::recording::PatternSpec;
use std::path::PathBuf;
use std::time::Duration;

/// Record a geometric sequence of vertical fringes, or what a recipe projects first.
#[derive(Debug, clap::Args)]
pub struct Record {
    /// Folder for the recording; must not exist yet.
    #[arg(value_parser = names::folder())]
    folder: PathBuf,
    /// Record the sequence for production of this recipe file, for `measure --recipe`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["fringes", "levels", "steps"])]
    recipe: Option<PathBuf>,
    /// Fringes over the projector's width; without it, one per 12 pixels.
    #[arg(long, value_name = "N", value_parser = number(1e-3, MAX_FRINGES))]
    fringes: Option<f64>,
    /// Levels, from coarse to fine.
    #[arg(long, default_value_t = 3, value_parser = number(1u8, 8))]
    levels: u8,
    /// Shifts per level.
    #[arg(long, default_value_t = 4, value_parser = number(3u8, 64))]
    steps: u8,
    #[command(flatten)]
    part: SimulatedPart,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    quiet: Quiet,
}

/// Frames of the fringe and its complement.
const PAIR: usize = 2;
/// Longest wait for one frame.
const TIMEOUT: Duration = Duration::from_secs(5);

impl Record {
    /// Opens the head, takes the sequence and writes it.
    ///
    /// # Errors
    /// If the recipe cannot be read or does not fit the head, the head cannot be opened, the
    /// pattern cannot be shown, or the folder cannot be written.
    pub fn run(&self) -> Result<()> {
        let mut config = self.files.configuration()?;
        config.head.part = self.part.placed(&config.head)?;
        let recipe = self.recipe.as_deref().map(kept::read).transpose()?;
        let progress = self.quiet.progress();
        let on_progress =
            |share: f64| progress.tell(0.8 * share, "working out the light of the scene");
        let pool = self.threads.pool(config.threads)?;
        let mut opened = pool.install(|| backend::open(&self.files.head(&config), &on_progress))?;
        opened.calibrated()?;
        let on_progress = |share: f64| progress.tell(0.8 + 0.2 * share, "recording");
        let taken = pool.install(|| match recipe {
            Some(recipe) => take_of_recipe(&mut opened, recipe, &on_progress),
            None => self.take(&mut opened, &on_progress),
        });
        progress.clear();
        opened.dark.iter().for_each(|words| progress.warn(words));
        let recording = taken?;
        recorder::write(&recording, &self.folder).map_err(Exit::CannotCreate.failure())?;
        if let Some(recipe) = &self.recipe {
            let copied = std::fs::copy(recipe, self.folder.join(RECIPE));
            copied.map_err(Exit::CannotCreate.because("copy the recipe into the recording"))?;
        }
        let count = recording.frames.len();
        self.quiet
            .say(|| format!("recorded {count} frames to {}", self.folder.display()));
        Ok(())
    }

    fn take(&self, opened: &mut OpenedHead, on_progress: &dyn Fn(f64)) -> Result<Recording> {
        let OpenedHead {
            head,
            calibration,
            stage,
            ..
        } = opened;
        let (columns, rows) = calibration.raster();
        let fringes = self.fringes.unwrap_or(f64::from(columns) / 12.0);
        let function = PhaseFunction::vertical(columns as usize, rows as usize, fringes)
            .map_err(Exit::Usage.because("--fringes"))?;
        let (levels, steps) = (usize::from(self.levels), usize::from(self.steps));
        let shots = Sequence::geometric(function.range(), levels, steps);
        let taken = take(head, calibration, &function, &shots, TIMEOUT, on_progress)?;
        let recorded = shots.into_iter().zip(taken);
        let recording = Recording {
            description: format!("{levels} levels of {steps} shifts, {fringes} vertical fringes"),
            patterns: vec![PatternSpec::Vertical { fringes }],
            frames: recorded
                .map(|(shot, frame)| seam::recorded(shot, frame))
                .collect(),
            ..calibration.recording()
        };
        Ok(of_head(recording, stage.as_ref()))
    }
}

/// Takes the sequence for production of a recipe. Two frames alone have no phase, so the sequence
/// behind them is taken.
fn take_of_recipe(
    opened: &mut OpenedHead,
    recipe: Recipe,
    on_progress: &dyn Fn(f64),
) -> Result<Recording> {
    let OpenedHead {
        head,
        calibration,
        stage,
        ..
    } = opened;
    let number = recipe.id.number;
    // It may have been taught from a recording, which does not have the whole calibration.
    let plan = Plan::again(recipe, calibration, stage.is_some())
        .map_err(Exit::Content.because("record"))?;
    let mut sequences = 0..plan.sequence_count();
    let sequence = sequences.find(|&sequence| plan.indices(sequence).len() > PAIR);
    let sequence = sequence.unwrap_or_default();
    plan.load(head, calibration)?;
    let indices = plan.indices(sequence);
    let mut frames = Vec::with_capacity(indices.len());
    head.acquire(indices, TIMEOUT, &mut |_, frame| {
        frames.push(frame);
        on_progress(frames.len() as f64 / indices.len() as f64);
    })?;
    let recording = Recording {
        description: format!("{} frames of recipe {number}", frames.len()),
        ..plan.recording(sequence, &frames, calibration)
    };
    Ok(of_head(recording, stage.as_ref()))
}

/// Says where a recording comes from, and of a simulated part what is true.
fn of_head(recording: Recording, stage: Option<&sim::Stage>) -> Recording {
    let truth = stage.map(sim::Stage::truth);
    Recording {
        source: match stage {
            Some(_) => "fringed's simulated head".into(),
            None => "a head of fringed".into(),
        },
        truth_height: truth.as_ref().map(|truth| truth.height.clone()),
        truth_class: truth.map(|truth| truth.class),
        ..recording
    }
}
