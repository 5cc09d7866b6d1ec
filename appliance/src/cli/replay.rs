//! `fringed replay RECORDING`: judges a kept part again and compares with what the history says, bit by bit.

use super::history::failure;
use super::options::{Files, Json, Quiet, Threads, answer};
use crate::calibration::Calibration;
use crate::calibration::place::Place;
use crate::error::{Exit, Failure};
use crate::history::{Entry, Reader, difference};
use crate::plan::{Plan, PlanError};
use crate::recipe::{LoadError, Recipe, Store};
use crate::station::result::flag::SIMULATED;
use crate::station::{Inspection, ResultRecord};
use algo::pattern::GreyResponse;
use hal::replay::Recording;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Judge a kept part again, from its frames.
#[derive(Debug, clap::Args)]
pub struct Replay {
    /// Its folder; `fringed history` names it.
    recording: PathBuf,
    /// The recipe it was measured with, where the state folder no longer has that one.
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    quiet: Quiet,
    #[command(flatten)]
    json: Json,
}

impl Replay {
    /// Judges and compares.
    ///
    /// # Errors
    /// If recording, recipe or stored result cannot be had (65, 66), or the result is not the stored one (70).
    pub fn run(&self) -> Result<(), Failure> {
        let config = self.files.configuration()?;
        let state = self.state()?;
        let recording = Recording::open(&self.recording)?;
        let wrong = |lacks: &str| {
            let place = self.recording.join("recording.json");
            Failure::new(
                Exit::Content,
                format!(
                    "replay {}: it has no {lacks}: replay one that the station kept",
                    place.display()
                ),
            )
        };
        let reference = recording.recipe.clone().ok_or_else(|| wrong("recipe"))?;
        let noise = recording
            .noise_counts
            .ok_or_else(|| wrong("camera.noise_counts"))?;
        let mut calibration = Calibration::of(&recording, noise).map_err(wrong)?;
        let recipe = self.recipe(&state, reference.number, &reference.fingerprint)?;
        let place = config.head_in(&state).calibration;
        calibration.response = place.and_then(|place| response(&place, &recipe));
        let stored = self.stored(&state)?;
        let flags = stored.as_ref().map_or(0, |entry| entry.flags);
        let frames: Vec<_> = recording
            .frames
            .iter()
            .map(|taken| taken.frame.clone())
            .collect();
        let judged = self.threads.pool(config.threads)?.install(|| {
            let plan = Plan::new(recipe, &calibration, flags & SIMULATED != 0)?;
            Ok::<_, PlanError>(plan.inspect(&frames, Instant::now()))
        });
        let inspection = judged.map_err(|error| Failure::new(Exit::Content, error.to_string()))?;
        let replayed = entry(inspection, reference.number, &reference.fingerprint);
        let document = || {
            let both = serde_json::json!({ "replayed": replayed, "stored": stored });
            format!("{both:#}")
        };
        answer(self.json, self.quiet, document, || table(&replayed));
        let Some(stored) = stored else {
            let message = format!(
                "compare with the history: no stored result names {}: the result above was compared with nothing",
                self.recording.display()
            );
            return Err(Failure::new(Exit::Missing, message));
        };
        match difference(&stored, &replayed) {
            None => {
                if !self.json.json {
                    self.quiet.say(|| {
                        format!(
                            "the same as result {} in the history, bit by bit",
                            stored.seq
                        )
                    });
                }
                Ok(())
            }
            Some(difference) => {
                let message = format!(
                    "the replay differs from result {}: {difference}",
                    stored.seq
                );
                Err(Failure::new(Exit::Software, message))
            }
        }
    }

    /// The state folder that the recording lies in, else the configured one.
    fn state(&self) -> Result<PathBuf, Failure> {
        let own = self.recording.canonicalize().ok();
        let own = own.and_then(|folder| Some(folder.parent()?.parent()?.to_path_buf()));
        match own {
            Some(state) if self.files.state.is_none() && Reader::of(&state).path().exists() => {
                Ok(state)
            }
            _ => self.files.state_folder(),
        }
    }

    fn recipe(&self, state: &Path, number: u32, fingerprint: &str) -> Result<Recipe, Failure> {
        let Some(path) = &self.recipe else {
            let number = u16::try_from(number).unwrap_or(0);
            let store = Store::at(&state.join("recipes"));
            return store
                .load_fingerprint(number, fingerprint)
                .map_err(|error| {
                    let exit = match error {
                        LoadError::Unknown(_) => Exit::Missing,
                        LoadError::Corrupt { .. } => Exit::Content,
                    };
                    Failure::new(exit, format!("{error}; or name its file with --recipe"))
                });
        };
        let read = |what: String| move |error: String| Failure::because(Exit::Content, what, error);
        let what = format!("read recipe {}", path.display());
        let opened = File::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (size, file) = opened.map_err(|error| Failure::because(Exit::Missing, &what, error))?;
        let recipe = Recipe::read(std::io::BufReader::new(file), size)
            .map_err(|error| read(what.clone())(error.to_string()))?;
        if recipe.file.fingerprint == fingerprint {
            return Ok(recipe);
        }
        let found = recipe
            .file
            .fingerprint
            .get(..8)
            .unwrap_or_default()
            .to_owned();
        let wanted = fingerprint.get(..8).unwrap_or_default();
        Err(read(what)(format!(
            "its fingerprint is {found}, the part was judged by {wanted}: name that one"
        )))
    }

    /// The stored result that names this recording.
    fn stored(&self, state: &Path) -> Result<Option<Entry>, Failure> {
        let folder = self.recording.canonicalize().ok();
        let name = folder
            .as_deref()
            .and_then(Path::file_name)
            .map(|name| name.to_string_lossy().into_owned());
        let reader = Reader::of(state);
        match name {
            Some(name) if reader.path().exists() => reader.recorded_as(&name).map_err(failure),
            _ => Ok(None),
        }
    }
}

/// The grey response that the recipe was made with, which recordings do not say: of the calibration that it names.
fn response(place: &Path, recipe: &Recipe) -> Option<GreyResponse> {
    let place = Place::at(place);
    let newest = place.load().ok().flatten().map(|loaded| loaded.file);
    let generations = newest.into_iter().chain(place.load_previous());
    let mut same = generations.filter(|file| file.fingerprint == recipe.file.calibration);
    same.find_map(|file| file.calibration().ok()?.response)
}

fn entry(inspection: Inspection, recipe: u32, fingerprint: &str) -> Entry {
    Entry::of(&ResultRecord {
        recipe: u16::try_from(recipe).unwrap_or(0),
        recipe_crc: crate::recipe::short(fingerprint),
        verdict: inspection.verdict(),
        error_code: inspection.error_code,
        inspection: Arc::new(inspection),
        ..ResultRecord::default()
    })
}

/// The verdict, and a line for each gauge.
fn table(entry: &Entry) -> String {
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:+.4}"));
    let mut lines = vec![format!("{}{}", entry.verdict.word(), because(entry))];
    lines.extend(entry.gauges.iter().map(|gauge| {
        format!(
            "{:<20} {:>10} {:<3} σ {:>8}  limits {} to {}",
            gauge.name,
            number(gauge.value),
            gauge.unit,
            number(gauge.sigma),
            number(gauge.low),
            number(gauge.high)
        )
    }));
    lines.join("\n")
}

fn because(entry: &Entry) -> String {
    let reason = entry.reason.as_ref();
    reason
        .map(|reason| format!(": {reason}"))
        .unwrap_or_default()
}
