//! Opens the recording of a part that a station judged, so that it can be judged again: frames,
//! calibration, recipe.

use crate::error::{Exit, Failure, Result};
use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::history::RECIPE;
use crate::recipe::file::archive;
use crate::recipe::plan::{Plan, PlanError};
use crate::recipe::{LoadError, Recipe, Store};
use algo::pattern::Shot;
use hal::frame::Frame;
use hal::replay::Recording;
use hal::replay::recording::RecipeReference;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// A recording that a station made of a part that it had judged, or another one that a recipe is to
/// judge.
#[derive(Debug)]
pub struct Kept {
    recording: Recording,
    reference: Option<RecipeReference>,
    calibration: Calibration,
    /// The recording's own recipe; none where there was no room for it.
    own: Option<PathBuf>,
}

impl Kept {
    /// Opens the recording in a folder.
    ///
    /// # Errors
    /// If it is not there (66), damaged, or not one that a station kept (65).
    pub fn open(folder: &Path) -> Result<Self> {
        let recording = Recording::open(folder)?;
        if recording.recipe.is_none() {
            let remedy = "replay one that the station kept, or name the recipe with --recipe";
            return Err(wrong(folder, "has no recipe", remedy));
        }
        Self::of(folder, recording, None)
    }

    /// Opens a recording that is to be judged by this recipe, which need not have judged it before:
    /// frames that were imported, for example. Of several patterns only the recipe's counts. The
    /// noise of a sample is the recipe's where the recording states none.
    ///
    /// # Errors
    /// If it is not there (66), damaged, without models, of another size or without the recipe's
    /// pattern (65).
    pub fn judged_by(folder: &Path, recipe: &Recipe) -> Result<Self> {
        let mut recording = Recording::open(folder)?;
        let pattern = recipe.pattern_in(&recording);
        let refused = |reason| Failure::because(Exit::Content, named(folder), reason);
        let pattern = pattern.map_err(refused)?;
        recording.frames.retain(|frame| frame.pattern == pattern);
        let noise = recipe.conditions.noise_counts;
        Self::of(folder, recording, Some(noise))
    }

    fn of(folder: &Path, mut recording: Recording, noise: Option<f64>) -> Result<Self> {
        let remedy = "replay one that the station kept, or add what is missing";
        let noise = recording.noise_counts.or(noise);
        let noise = noise.ok_or_else(|| wrong(folder, "has no camera.noise_counts", remedy))?;
        let calibration = Calibration::of(&recording, noise)
            .map_err(|lacks| wrong(folder, &lacks.to_string(), remedy))?;
        let own = folder.join(RECIPE);
        Ok(Self {
            reference: recording.recipe.take(),
            recording,
            calibration,
            own: own.exists().then_some(own),
        })
    }

    /// The recipe that judged the part, if one did.
    pub fn reference(&self) -> Option<&RecipeReference> {
        self.reference.as_ref()
    }

    /// Whether the part was judged by this recipe.
    pub fn was_judged_by(&self, recipe: &Recipe) -> bool {
        let judge = self.reference.as_ref();
        judge.is_some_and(|judge| judge.fingerprint == recipe.id.fingerprint)
    }

    /// PART_ID, as far as the recording says.
    pub fn part_id(&self) -> Option<&str> {
        self.recording.part_id.as_deref()
    }

    /// The recipe's sequence that the frames are of, and its frames: all of them, or else those of
    /// the longest sequence whose frames are among them.
    pub fn sequence(&self, plan: &Plan) -> Option<(usize, Vec<Frame>)> {
        let shots = self.shots();
        if let Some(all) = plan.sequence_of(&shots) {
            return Some((all, self.frames()));
        }
        let shown: Vec<Option<Shot>> = shots.into_iter().map(Some).collect();
        let (sequence, at) = plan.sequence_among(&shown)?;
        let taken = |&at: &usize| self.recording.frames[at].frame.clone();
        Some((sequence, at.iter().map(taken).collect()))
    }

    /// The frames, in the order of their sequence.
    pub fn frames(&self) -> Vec<Frame> {
        let taken = self.recording.frames.iter();
        taken.map(|taken| taken.frame.clone()).collect()
    }

    /// What each frame shows: which sequence of a recipe they are of.
    pub fn shots(&self) -> Vec<Shot> {
        self.recording.frames.iter().map(seam::shot).collect()
    }

    /// The recipe that judged the part: the recording's own, else the generation of the station's
    /// that has its fingerprint. The answer says whether it is the recording's.
    ///
    /// # Errors
    /// If neither the recording nor the store has it (66), or the recording's is damaged or another
    /// one (65).
    pub fn recipe(&self, stored: &Store) -> Result<(Recipe, bool)> {
        let Some(RecipeReference {
            number,
            fingerprint,
        }) = &self.reference
        else {
            let words = "replay: the recording has no recipe: name one with --recipe";
            return Exit::Content.fail(words);
        };
        let Some(own) = &self.own else {
            let number = u16::try_from(*number).unwrap_or(0);
            return match stored.load_fingerprint(number, fingerprint) {
                Ok(recipe) => Ok((recipe, false)),
                Err(error) => Err(missing(&error)),
            };
        };
        let recipe = read(own)?;
        if recipe.id.fingerprint == *fingerprint {
            return Ok((recipe, true));
        }
        let words = format!(
            "read recipe {}: its fingerprint is {:.8}, the part was judged by {fingerprint:.8}: copy the whole recording \
             again, or name a recipe",
            own.display(),
            recipe.id.fingerprint
        );
        Exit::Content.fail(words)
    }

    /// Joins a recipe with what the recording says of the head.
    ///
    /// # Errors
    /// If it was made for another head or does not fit the frames.
    pub fn plan(&self, recipe: Recipe, simulated: bool) -> Result<Plan, PlanError> {
        if self.was_judged_by(&recipe)
            || self.calibration_then().as_ref() == Some(&recipe.id.calibration)
        {
            return Plan::again(recipe, &self.calibration, simulated);
        }
        Plan::new(recipe, &self.calibration, simulated)
    }

    /// Fingerprint of the calibration that the part was measured with, if the recording has its
    /// recipe.
    fn calibration_then(&self) -> Option<String> {
        let file = File::open(self.own.as_ref()?).ok()?;
        Some(archive::manifest(file).ok()?.calibration)
    }
}

fn wrong(folder: &Path, lacks: &str, remedy: &str) -> Failure {
    let words = format!("{}: it {lacks}: {remedy}", named(folder));
    Failure::new(Exit::Content, words)
}

fn named(folder: &Path) -> String {
    format!("replay {}", folder.join("recording.json").display())
}

/// The failure of a command that needs a recipe which the station does not have.
pub fn missing(error: &LoadError) -> Failure {
    let exit = match error {
        LoadError::Unknown(_) => Exit::Missing,
        LoadError::Corrupt { .. } | LoadError::Unfit { .. } | LoadError::Shared { .. } => {
            Exit::Content
        }
    };
    Failure::new(exit, format!("{error}; or name its file with --recipe"))
}

/// Reads a recipe by itself: a file may lie anywhere and have any name.
///
/// # Errors
/// If it is not there (66), or is no recipe (65).
pub fn read(path: &Path) -> Result<Recipe> {
    let what = format!("read recipe {}", path.display());
    let opened = File::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
    let (size, file) = opened.map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => Failure::new(
            Exit::Missing,
            format!("{what}: {error}: name the .recipe file of the part"),
        ),
        _ => Failure::because(Exit::Content, &what, error),
    })?;
    Recipe::read(BufReader::new(file), size).map_err(Exit::Content.because(what))
}
