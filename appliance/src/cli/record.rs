//! `fringed record DIR`: a sequence from the configured head as a recording.

use super::names;
use super::numbers::number;
use super::options::{Files, Quiet, Threads};
use crate::error::{Exit, Failure};
use crate::head::scan::take;
use crate::head::seam;
use crate::production::backend::{self, Opened};
use algo::pattern::{PhaseFunction, Sequence};
use hal::bounds::MAX_FRINGES;
use hal::replay::Recording;
use hal::replay::recorder;
use hal::replay::recording::PatternSpec;
use std::path::PathBuf;
use std::time::Duration;

/// Record a geometric sequence of vertical fringes.
#[derive(Debug, clap::Args)]
pub struct Record {
    /// Folder for the recording; must not exist yet.
    #[arg(value_parser = names::folder())]
    folder: PathBuf,
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
    files: Files,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    quiet: Quiet,
}

/// Longest wait for one frame.
const TIMEOUT: Duration = Duration::from_secs(5);

impl Record {
    /// Opens the head, takes the sequence and writes it.
    ///
    /// # Errors
    /// If the head cannot be opened, the pattern cannot be shown, or the folder cannot be written.
    pub fn run(&self) -> Result<(), Failure> {
        let config = self.files.configuration()?;
        let progress = self.quiet.progress();
        let on_progress =
            |share: f64| progress.tell(0.8 * share, "working out the light of the scene");
        let pool = self.threads.pool(config.threads)?;
        let mut opened = pool.install(|| backend::open(&self.files.head(&config), &on_progress))?;
        opened.calibrated()?;
        let taken = self.take(&mut opened, &|share| {
            progress.tell(0.8 + 0.2 * share, "recording")
        });
        progress.clear();
        opened.dark.iter().for_each(|words| progress.warn(words));
        let recording = taken?;
        recorder::write(&recording, &self.folder)
            .map_err(|error| Failure::new(Exit::CannotCreate, error.to_string()))?;
        let count = recording.frames.len();
        self.quiet
            .say(|| format!("recorded {count} frames to {}", self.folder.display()));
        Ok(())
    }

    fn take(&self, opened: &mut Opened, on_progress: &dyn Fn(f64)) -> Result<Recording, Failure> {
        let Opened {
            head,
            calibration,
            stage,
            ..
        } = opened;
        let (columns, rows) = calibration.raster();
        let fringes = self.fringes.unwrap_or(f64::from(columns) / 12.0);
        let function = PhaseFunction::vertical(columns as usize, rows as usize, fringes)
            .map_err(|error| Failure::because(Exit::Usage, "--fringes", error))?;
        let (levels, steps) = (usize::from(self.levels), usize::from(self.steps));
        let shots = Sequence::geometric(function.range(), levels, steps);
        let taken = take(head, calibration, &function, &shots, TIMEOUT, on_progress)?;
        let recorded = shots.into_iter().zip(taken);
        let truth = stage.as_ref().map(sim::Stage::truth);
        Ok(Recording {
            description: format!("{levels} levels of {steps} shifts, {fringes} vertical fringes"),
            source: match stage {
                Some(_) => "fringed's simulated head".into(),
                None => "a head of fringed".into(),
            },
            patterns: vec![PatternSpec::Vertical { fringes }],
            frames: recorded
                .map(|(shot, frame)| seam::recorded(shot, frame))
                .collect(),
            truth_height: truth.as_ref().map(|truth| truth.height.clone()),
            truth_class: truth.map(|truth| truth.class),
            ..calibration.recording()
        })
    }
}
