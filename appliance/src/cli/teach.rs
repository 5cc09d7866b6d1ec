//! `fringed teach`: a recipe from the part in front of the head, or from recordings.

use super::names;
use super::numbers::number;
use super::options::Measuring;
use super::options::SimulatedPart;
use crate::access::Change;
use crate::config::Config;
use crate::error::{Exit, Failure, Result};
use crate::head::calibrated::EmptyStation;
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::measure::{measure, measure_after};
use crate::production::backend::{self, OpenedHead};
use crate::recipe::file::{LONGEST_NAME, LONGEST_PART_NUMBER, MAX_EXPOSURES, MAX_TOLERANCE_MM};
use crate::recipe::teach::golden::{GoldenPart, Naming, TaughtRecipe, UnsealedRecipe};
use crate::recipe::teach::replace::{LEAST_LIMIT_MM, MOST_LIMIT_MM};
use crate::recipe::teach::{TeachError, captures, part, replace, teach};
use crate::recipe::{PatternFile, RecipeFile, Store, store};
use crate::station::control::MAX_RECIPE;
use crate::storage::folder::write_whole;
use crate::storage::state::StateFolder;
use crate::system::headway::Headway;
use algo::adaptive::ProjectorMap;
use algo::frame::SampleNoise;
use hal::bounds::text;
use hal::replay::Recording;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Make a recipe from a good part.
#[derive(Debug, clap::Args)]
pub struct Teach {
    /// Recipe number.
    #[arg(long, value_parser = number(1, MAX_RECIPE))]
    number: u16,
    /// Replace the recipe that has this number; it stays as the previous generation, `fringed
    /// recipe undo` brings it back.
    #[arg(long, conflicts_with = "out")]
    replace: bool,
    /// Keep features, datum systems, gauges and limits of the recipe that is replaced.
    #[arg(long, requires = "replace")]
    keep_gauges: bool,
    /// Part number: the key that a PLC may select by; without it that of the recipe that is
    /// replaced, or PART-NNNN.
    #[arg(long, value_parser = part_number)]
    part_number: Option<String>,
    /// Name for people; without it that of the recipe that is replaced, or Part N.
    #[arg(long, value_parser = name)]
    name: Option<String>,
    /// How far parts may lie from where this one lies, in any direction, mm; without it as in the
    /// recipe that is replaced, or 1.
    #[arg(long, value_name = "MM", value_parser = number(0.0, MAX_TOLERANCE_MM))]
    tolerance: Option<f64>,
    /// Limit of the deviation from golden, ± mm: a part whose good ones would not keep it is refused;
    /// without it as in the recipe that is replaced, or 0.15.
    #[arg(long, value_name = "MM", value_parser = number(LEAST_LIMIT_MM, MOST_LIMIT_MM))]
    limit: Option<f64>,
    /// Expose each frame so many times as long as the head is set to, with less light where the
    /// part is bright: dark places have less noise; without it as in the recipe that is replaced, if
    /// that has longer ones, else once unless the part is dark.
    #[arg(long, value_name = "N", conflicts_with = "golden", value_parser = number(1, MAX_EXPOSURES))]
    exposures: Option<u32>,
    /// Take all that is seen for the part, also a flat surface that lies behind it all round: the base of
    /// a part that is larger than the picture. A recipe that is replaced says so for the next one.
    #[arg(long)]
    everything: bool,
    /// Let cycles begin with two frames, the fringe and its complement; where they do not hold, the
    /// sequence that the limits ask for follows in the same cycle.
    #[arg(long, value_name = "2", value_parser = number(2_u16, 2))]
    frames: Option<u16>,
    /// Recording of the good part with the full sequence; its pattern becomes the recipe's. Without
    /// it, the part in front of the configured head is taught.
    #[arg(long, value_name = "DIR", requires = "out", conflicts_with = "state")]
    golden: Option<PathBuf>,
    /// Recording that tells the golden one's dense levels what phase to expect; without it, the
    /// reference phase map does.
    #[arg(long, value_name = "DIR", requires = "golden")]
    preliminary: Option<PathBuf>,
    /// Write the recipe to this file instead of the state folder.
    #[arg(long, value_name = "FILE.recipe", value_parser = names::file("recipe"))]
    out: Option<PathBuf>,
    #[command(flatten)]
    part: SimulatedPart,
    #[command(flatten)]
    measuring: Measuring,
}

/// Where the recipe goes.
enum Target<'a> {
    File(&'a Path),
    /// Locked until the recipe is stored.
    State(StateFolder),
}

impl Target<'_> {
    /// Writes the recipe; returns where, in words.
    fn store(&self, taught: &TaughtRecipe) -> Result<String> {
        let (written, what, place) = match self {
            Self::File(out) => (
                write_whole(out, &taught.bytes),
                format!("write {}", out.display()),
                out.display().to_string(),
            ),
            Self::State(state) => {
                let (number, path) = (taught.manifest.number, state.path().display());
                (
                    Store::of_state(state)?.save(number, &taught.bytes),
                    format!("store recipe {number} in {path}"),
                    format!("stored in {path}"),
                )
            }
        };
        written.map_err(Exit::CannotCreate.because(what))?;
        Ok(place)
    }
}

/// Longest wait for one frame.
const TIMEOUT: Duration = Duration::from_secs(5);

fn part_number(given: &str) -> Result<String, String> {
    text("it", given, LONGEST_PART_NUMBER)?;
    match given.is_ascii() {
        true => Ok(given.to_owned()),
        false => Err("write ASCII characters: a PLC selects by it".into()),
    }
}

fn name(given: &str) -> Result<String, String> {
    text("it", given, LONGEST_NAME)?;
    Ok(given.to_owned())
}

impl Teach {
    /// Teaches, stores the recipe and prints which sequence was chosen and why.
    ///
    /// # Errors
    /// If the part cannot be taught, the number is taken, or the recipe cannot be stored; a recipe
    /// stored before is unchanged.
    pub fn run(&self) -> Result<()> {
        let options = &self.measuring;
        let mut config = options.files.configuration()?;
        let part = self.part.placed(&config.head)?;
        if let Some(golden) = self.golden.as_ref().filter(|_| part.is_some()) {
            let words = format!(
                "teach from {}: a recording has its own part: leave out --golden, or the part's options",
                golden.display()
            );
            return Exit::Usage.fail(words);
        }
        config.head.part = part;
        // Opened before anything is measured, and locked until the recipe is stored.
        let target = match &self.out {
            Some(out) => Target::File(out),
            None => Target::State(StateFolder::open_unless_used(
                &options.files.state_folder()?,
                Exit::CannotCreate,
                "use *Recipes*, *Teach* on its page",
            )?),
        };
        let recipes = match &target {
            Target::File(_) => None,
            Target::State(state) => Some(Store::of_state(state)?),
        };
        let replaced = match &recipes {
            Some(recipes) => self.replaced(recipes)?,
            None => None,
        };
        let naming = self.naming(replaced.as_ref());
        if let Some(recipes) = &recipes {
            let shared = recipes.refuse_shared(self.number, &naming.part_number);
            shared.map_err(Exit::CannotCreate.because("teach"))?;
        }
        let pool = options.threads.pool(config.threads)?;
        let taught = match &self.golden {
            Some(golden) => pool.install(|| self.teach_recordings(golden, &naming))?,
            None => self.teach_head(&config, &pool, &naming)?,
        };
        let taught = match self.frames {
            Some(_) => taught.with_two_frames(),
            None => taught,
        };
        let taught = match replaced.filter(|_| self.keep_gauges) {
            Some(file) => pool.install(|| replace::keep_gauges(taught, &file, Headway::silent())),
            None => pool.install(|| taught.with_rims(Headway::silent())),
        };
        let taught = taught
            .and_then(UnsealedRecipe::seal)
            .map_err(Exit::Content.because("teach"))?;
        let place = target.store(&taught)?;
        let file = &taught.manifest;
        if let Target::State(_) = target {
            options.files.note(&Change {
                fingerprint: Some(file.fingerprint.clone()),
                ..Change::of_command("teach recipe", format!("recipes/{}", file.number))
            });
        }
        let summary = serde_json::json!({
            "number": file.number,
            "fingerprint": file.fingerprint,
            "sequences": file.sequences,
            "production": file.production,
            "reasons": taught.choice.reasons,
            "file": place,
        });
        let text = || {
            let mut lines = taught.choice.reasons.clone();
            let fingerprint = &file.fingerprint[..8];
            lines.push(format!(
                "recipe {}, fingerprint {fingerprint}: {place}",
                file.number
            ));
            lines.join("\n")
        };
        options.output.answer(&summary, text)
    }

    /// The recipe that is replaced, if any.
    ///
    /// # Errors
    /// If the number is taken and `--replace` is not given, or there are no gauges to keep.
    fn replaced(&self, recipes: &Store) -> Result<Option<RecipeFile>> {
        let number = self.number;
        if !self.replace {
            let words = ("teach", "add --replace (and --keep-gauges)", "teach number");
            store::refuse_taken(recipes, number, words).map_err(Exit::CannotCreate.failure())?;
        }
        let replaced = recipes.present(number);
        if self.keep_gauges && replaced.is_none() {
            return Exit::Missing.fail(replace::no_gauges(number));
        }
        Ok(replaced)
    }

    fn naming(&self, replaced: Option<&RecipeFile>) -> Naming {
        let kept = replace::naming(self.number, replaced, self.keep_gauges);
        Naming {
            part_number: self.part_number.clone().unwrap_or(kept.part_number),
            name: self.name.clone().unwrap_or(kept.name),
            placement_tolerance_mm: self.tolerance.unwrap_or(kept.placement_tolerance_mm),
            exposures: self.exposures.or(kept.exposures),
            everything: self.everything || kept.everything,
            limit_mm: self.limit.or(kept.limit_mm),
            ..kept
        }
    }

    fn teach_head(
        &self,
        config: &Config,
        pool: &rayon::ThreadPool,
        naming: &Naming,
    ) -> Result<UnsealedRecipe> {
        let options = &self.measuring;
        let progress = options.output.progress();
        let on_progress = |share: f64| progress.tell(share, "working out the light of the scene");
        let opened = pool.install(|| backend::open(&options.files.head(config), &on_progress))?;
        opened.calibrated()?;
        let place = options.files.head(config).calibration;
        let empty = place.map(|place| EmptyStation::load(&place, &opened.calibration));
        let empty = empty.transpose().map_err(Exit::Content.because("teach"))?;
        let naming = &Naming {
            empty: empty.flatten().map(Arc::new),
            ..naming.clone()
        };
        let OpenedHead {
            mut head,
            calibration,
            ..
        } = opened;
        let told = |share: f64, words: &str| {
            progress.tell(share, words);
            true
        };
        let headway = Headway::new(&told, "teaching");
        let taught = pool.install(|| teach(&mut head, &calibration, naming, TIMEOUT, headway));
        progress.clear();
        let taught = taught.map_err(|error| {
            let exit = match error {
                TeachError::Device(_) | TeachError::Ended => Exit::Unavailable,
                TeachError::Scene(_)
                | TeachError::Limit { .. }
                | TeachError::Rig(_)
                | TeachError::NotCalibrated(_) => Exit::Content,
            };
            Failure::new(exit, error)
        })?;
        Ok(taught)
    }

    fn teach_recordings(&self, folder: &Path, naming: &Naming) -> Result<UnsealedRecipe> {
        let recording = Recording::open(folder)?;
        let manifest = folder.join("recording.json");
        let wrong = |error: &dyn std::fmt::Display| {
            Failure::because(
                Exit::Content,
                format!("teach from {}", manifest.display()),
                error,
            )
        };
        let measured = match &self.preliminary {
            None => measure(&recording, folder)?,
            Some(before) => {
                let first = measure(&Recording::open(before)?, before)?;
                let surface = first.heights.map_err(|missing| {
                    let what = format!("teach from {}", before.display());
                    Failure::because(Exit::Content, what, missing)
                })?;
                let map = ProjectorMap::from_heights(&surface.triangulator, &surface.map);
                measure_after(&recording, folder, &map)?
            }
        };
        let surface = measured
            .heights
            .as_ref()
            .map_err(|missing| wrong(missing))?;
        let noise = measured.report.noise_counts.ok_or_else(|| {
            wrong(&"the noise of a sample is not known: add camera.noise_counts or levels of 4 shifts")
        })?;
        let calibration = Calibration::of(&recording, noise)
            .map_err(|lacks| wrong(&format!("it {lacks}: add both models")))?;
        let decoder = measured.decoder.as_ref();
        let decoder =
            decoder.ok_or_else(|| wrong(&"it has no fringes, which a recipe projects"))?;
        let phases = &measured.phases[measured.primary];
        crate::recipe::teach::refuse_empty(phases).map_err(|error| wrong(&error))?;
        let primary = measured.primary;
        let full = &measured.shots;
        let signal =
            captures::recorded_signal(&recording, primary).map_err(|error| wrong(&error))?;
        let (mut phases, mut heights) = (phases.clone(), surface.map.clone());
        let found = part::of(&heights, &surface.triangulator, naming.told());
        let found = found.map_err(|error| wrong(&error))?;
        if let Some(found) = &found {
            part::leave_out(found, &mut phases, &mut heights);
        }
        let part = GoldenPart {
            calibration: &calibration,
            pattern: PatternFile::of(&recording.patterns[primary]),
            // Recordings cannot be exposed anew.
            illumination: Illumination::default(),
            light_edges: false,
            full,
            decoder: decoder.clone(),
            triangulator: surface.triangulator.clone(),
            phases,
            heights,
            offsets: Vec::new(),
            signal,
            noise: SampleNoise::constant(noise),
            offset_counts: None,
            surroundings: found,
            captures: 1,
            comparison: None,
        };
        let mut taught = part
            .recipe(naming, Headway::silent())
            .map_err(|error| wrong(&error))?;
        if full.len()
            < recording
                .frames
                .iter()
                .filter(|frame| frame.pattern == primary)
                .count()
        {
            let words = "levels that are unwrapped by beats are for teaching alone: cycles take the finest one, about the golden phase";
            taught.choice.reasons.push(words.into());
        }
        Ok(taught)
    }
}
