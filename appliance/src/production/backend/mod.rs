//! Opens the configured head. Only this module knows which back-ends there are.

mod devices;

pub use devices::{Wires, built_for, leave_lines_idle, lines};

use crate::config::{Backend, HeadConfig};
use crate::error::{Exit, Failure, Result};
use crate::head::calibration::Calibration;
use crate::head::calibration::place::{CalibrationPlace, Loaded};
use crate::head::examine::{LONGEST_DARK, first_light};
use crate::head::exposing::Exposing;
use crate::head::seam;
use crate::history::RECIPE;
use crate::recipe::file::archive;
use crate::recipe::plan::{Plan, PlanError};
use crate::recipe::{PatternFile, Recipe};
use algo::pattern::Shot;
use hal::head::{Head, Timing};
use hal::replay::Recording;
use sim::{Ground, Scenario, Stage};
use std::fs;
use std::path::Path;

/// An opened head.
pub struct OpenedHead {
    /// The devices.
    pub head: Head,
    /// Their calibration.
    pub calibration: Calibration,
    /// Where parts are placed in front of a simulated head.
    pub stage: Option<Stage>,
    /// Why the calibration cannot be trusted: it is nominal only, or the stored one cannot be used.
    /// Nothing may be measured then.
    pub problem: Option<String>,
    /// If the calibration is the previous generation: why the newest could not be used.
    pub fallback: Option<String>,
    /// A note if the projector's light did not come after the head was opened.
    pub dark: Option<String>,
    /// The recordings of a replay head.
    pub played: Option<Played>,
}

/// The recordings that a replay head plays.
#[derive(Clone, Debug)]
pub struct Played {
    /// The pattern and the shift that each frame of the first recording shows.
    shots: Vec<(PatternFile, Shot)>,
    /// Fingerprint of the calibration that they were taken with, if a station kept the recipe too.
    calibration: Option<String>,
}

impl Played {
    fn of(folder: &Path, recording: &Recording) -> Self {
        let recipe = fs::File::open(folder.join(RECIPE)).ok();
        let manifest = recipe.and_then(|file| archive::manifest(file).ok());
        Self {
            shots: recording
                .frames
                .iter()
                .map(|frame| {
                    let pattern = PatternFile::of(&recording.patterns[frame.pattern]);
                    (pattern, seam::shot(frame))
                })
                .collect(),
            calibration: manifest.map(|manifest| manifest.calibration),
        }
    }

    /// Plans a recipe to judge these recordings, with only the sequence that they show. A recording
    /// does not hold the whole calibration, so its fingerprint is taken from the recipe that was
    /// kept with it.
    ///
    /// # Errors
    /// If the recipe was made for another calibration or does not fit the frames.
    pub fn plan(&self, recipe: Recipe, calibration: &Calibration) -> Result<Plan, PlanError> {
        let own = |(pattern, shot): &(PatternFile, Shot)| {
            (*pattern == recipe.conditions.pattern).then_some(*shot)
        };
        let shown: Vec<Option<Shot>> = self.shots.iter().map(own).collect();
        let plan = match self.calibration.as_ref() == Some(&recipe.id.calibration) {
            true => Plan::again(recipe, calibration, false),
            false => Plan::new(recipe, calibration, false),
        };
        Ok(plan?.only(&shown))
    }
}

impl OpenedHead {
    /// A head and what is known of it, before a stored calibration is looked for.
    fn new(head: Head, calibration: Calibration) -> Self {
        Self {
            head,
            calibration,
            stage: None,
            problem: None,
            fallback: None,
            dark: None,
            played: None,
        }
    }

    /// Opens the head again after it was lost. It may be another one by then, so its calibration is
    /// read again.
    ///
    /// # Errors
    /// If a device is not there.
    pub fn reopen(&mut self, config: &HeadConfig) -> Result<()> {
        match &self.stage {
            Some(stage) => {
                self.head = stage.reopen().map_err(Exit::Unavailable.failure())?;
                if !stage.scenario().calibrated {
                    self.head.set_timing(Timing::default());
                }
                self.adopt(config);
                self.await_light();
            }
            None => {
                // A device must be closed before it can be opened again.
                self.head = self.head.closed();
                *self = open(config, &|_| ())?;
            }
        }
        Ok(())
    }

    /// Checks that the calibration can be trusted.
    ///
    /// # Errors
    /// Why not (exit code 65).
    pub fn calibrated(&self) -> Result<()> {
        match &self.problem {
            None => Ok(()),
            Some(problem) => Exit::Content.fail(problem),
        }
    }

    /// Waits until the projector has locked on to its mode, where opening has set one.
    fn await_light(&mut self) {
        // An error comes again with the next measurement, which reports it.
        let dark = self.head.starts_dark() && first_light(&mut self.head) == Ok(None);
        self.dark = dark.then(|| {
            format!(
                "no light of the projector has come within {} s: unless no part is there, check its power and its input; `fringed doctor` says more",
                LONGEST_DARK.as_secs()
            )
        });
    }

    /// Whether the calibration of the back-end is nominal only: that of real devices, and of a
    /// simulated head that is to be commissioned.
    fn is_bare(&self, config: &HeadConfig) -> bool {
        let bare = |stage: &Stage| !stage.scenario().calibrated;
        config.backend == Backend::Rpi || self.stage.as_ref().is_some_and(bare)
    }

    /// Sets exposure and gain of the camera to those of a configuration that was changed, or
    /// changed back, to `exposing`.
    ///
    /// # Errors
    /// If the head cannot expose in this way, or a device is not there.
    pub fn expose(&mut self, config: &HeadConfig, exposing: Exposing) -> Result<()> {
        let timing = self.head.timing();
        match &self.stage {
            Some(stage) => exposed(stage, exposing)?,
            None => self.reopen(config)?,
        }
        self.head.set_timing(timing);
        self.adopt(config);
        Ok(())
    }

    /// Exposure and gain of the camera.
    pub fn exposing(&self, config: &HeadConfig) -> Exposing {
        let gain = match &self.stage {
            Some(stage) => stage.exposing().1,
            None => config.camera.gain,
        };
        // A loaded recipe may ask for several.
        let exposure = self.head.camera_timing().exposure / self.head.exposures();
        Exposing {
            exposure_us: u32::try_from(exposure.as_micros()).unwrap_or(u32::MAX),
            gain,
        }
    }

    /// Uses the stored calibration if there is one, else that of the back-end.
    pub fn adopt(&mut self, config: &HeadConfig) {
        self.fallback = None;
        let exposing = self.exposing(config);
        self.problem = match stored(config) {
            Ok(None) => {
                match &self.stage {
                    Some(stage) if stage.scenario().calibrated => {
                        let scenario = stage.scenario();
                        self.calibration.simulate_noise(scenario, exposing);
                    }
                    // Recordings were taken with whatever their head was set to.
                    _ if config.backend == Backend::Replay => {}
                    _ => self.calibration.exposing = Some(exposing),
                }
                self.is_bare(config)
                    .then(|| devices::uncalibrated().to_string())
            }
            Ok(Some((loaded, calibration))) => {
                let misfit = misfit(config, &self.calibration, &calibration);
                if misfit.is_none() {
                    self.head.set_timing(loaded.file.timing(self.head.timing()));
                    let noise = loaded.file.noise.as_ref();
                    self.head
                        .set_clipping(noise.and_then(|noise| noise.clips_from));
                    self.calibration = calibration;
                    self.fallback = loaded.fallback.clone();
                }
                misfit
                    .or_else(|| unfinished(config, &loaded))
                    .or_else(|| set_otherwise(&loaded, exposing))
            }
            Err(failure) => Some(failure.to_string()),
        };
    }
}

/// Opens the configured head. `progress` is called with the share done, from any thread.
///
/// # Errors
/// If a file of the head is missing or wrong, or a device is not there.
pub fn open(config: &HeadConfig, progress: &(dyn Fn(f64) + Sync)) -> Result<OpenedHead> {
    let mut opened = open_as_it_is(config, progress)?;
    let encoding = opened.head.encoding();
    // Luma has passed an image processor, so it is used only if the configuration asks for it.
    let luma = config.backend == Backend::Rpi && config.camera.luma;
    if !(encoding.exact || luma) {
        let message = format!(
            "open the camera: it grants {} only, which is compressed, and no phase can be trusted that is made of it: \
             ask for a raw format; `fringed doctor` says more",
            encoding.name
        );
        return Exit::Unavailable.fail(message);
    }
    opened.await_light();
    Ok(opened)
}

/// Opens the configured head even if nothing can be measured with it. `progress` is called with the
/// share done, from any thread.
///
/// # Errors
/// If a file of the head is missing or wrong, or a device is not there.
pub fn open_as_it_is(config: &HeadConfig, progress: &(dyn Fn(f64) + Sync)) -> Result<OpenedHead> {
    let mut opened = match config.backend {
        Backend::Sim => simulated(config, progress)?,
        Backend::Replay => replayed(&config.recordings)?,
        Backend::Rpi => devices::rpi(config)?,
    };
    opened.adopt(config);
    Ok(opened)
}

/// The stored calibration of the configured head, if there is one. Recordings carry their own.
///
/// # Errors
/// If it cannot be used (65).
fn stored(config: &HeadConfig) -> Result<Option<(Loaded, Calibration)>> {
    let place = config
        .calibration
        .as_deref()
        .filter(|_| config.backend != Backend::Replay);
    let loaded = place.map_or(Ok(None), |place| CalibrationPlace::at(place).load());
    let Some(loaded) = loaded.map_err(Exit::Content.failure())? else {
        return Ok(None);
    };
    let calibration = loaded.file.calibration();
    let calibration = calibration.map_err(Exit::Content.failure())?;
    Ok(Some((loaded, calibration)))
}

/// Why a stored calibration does not fit the head; `None` if it does.
fn misfit(config: &HeadConfig, head: &Calibration, stored: &Calibration) -> Option<String> {
    if head.sizes() == stored.sizes() {
        return None;
    }
    let place = config.calibration.as_deref().unwrap_or(Path::new(""));
    let describe = |calibration: &Calibration| {
        let [width, height, bits, columns, rows] = calibration.sizes();
        format!(
            "a camera of {width}×{height} pixels of {bits} bit and a projector of {columns}×{rows}"
        )
    };
    Some(format!(
        "calibration {} is of another head: it is for {}, this is {}: calibrate anew, or name this head's with head.calibration",
        place.display(),
        describe(stored),
        describe(head)
    ))
}

/// What is still to be measured before a stored calibration can be used; `None` if nothing is.
fn unfinished(config: &HeadConfig, stored: &Loaded) -> Option<String> {
    let missing = stored.file.missing();
    let place = config.calibration.as_deref().unwrap_or(Path::new(""));
    (!missing.is_empty()).then(|| {
        format!(
            "calibration {} has models, but {} of the head are still to be measured: run `fringed calibrate`",
            place.display(),
            missing.join(", ")
        )
    })
}

/// Why the noise of a stored calibration is not that of the head as it is set; `None` if it is, or
/// its setting is not known.
fn set_otherwise(stored: &Loaded, now: Exposing) -> Option<String> {
    let measured = stored.file.noise.as_ref()?.exposing?;
    (!measured.agrees(&now)).then(|| {
        format!(
            "the camera is set to {now}, and its noise was measured at {measured}: set that again, or measure anew with the steps timing and \
             plane or `fringed calibrate`, and teach the recipes again"
        )
    })
}

/// The calibration of the configured head, without opening it.
///
/// # Errors
/// If a file of the head is missing or wrong.
pub fn calibration(config: &HeadConfig) -> Result<Calibration> {
    let wrong = Exit::Content.failure();
    match config.backend {
        Backend::Sim => {
            let scenario = scenario(config.scenario.as_deref())?;
            let exact = exact(&scenario)?;
            match stored(config)? {
                None if !scenario.calibrated => Err(devices::uncalibrated()),
                None => Ok(exact),
                Some((loaded, calibration)) => misfit(config, &exact, &calibration)
                    .or_else(|| unfinished(config, &loaded))
                    .map_or(Ok(calibration), |why| Err(wrong(why))),
            }
        }
        Backend::Replay => {
            let first = config
                .recordings
                .iter()
                .take(1)
                .map(|folder| Recording::open(folder));
            calibration_of(&config.recordings, &first.collect::<Result<Vec<_>, _>>()?)
        }
        Backend::Rpi => match stored(config)? {
            Some((loaded, calibration)) => {
                unfinished(config, &loaded).map_or(Ok(calibration), |why| Err(wrong(why)))
            }
            None => Err(devices::uncalibrated()),
        },
    }
}

/// The scenario of a file, or the default one: a stock part on a grey floor.
///
/// # Errors
/// If the file does not exist or is not a scenario.
pub fn scenario(path: Option<&Path>) -> Result<Scenario> {
    let Some(path) = path else {
        return Ok(Scenario {
            floor: Some(Ground::default()),
            ..Scenario::default()
        });
    };
    let place = path.display().to_string();
    let what = format!("read scenario {place}");
    let missing = Exit::Missing.advising(what, "head.scenario names a TOML file");
    let text = fs::read_to_string(path).map_err(missing)?;
    Scenario::from_toml(&text, &place).map_err(Exit::Configuration.failure())
}

/// The exact calibration of a simulated head.
fn exact(scenario: &Scenario) -> Result<Calibration> {
    Calibration::of_scenario(scenario).map_err(Exit::Configuration.because("simulate the head"))
}

fn simulated(config: &HeadConfig, progress: &(dyn Fn(f64) + Sync)) -> Result<OpenedHead> {
    let mut scenario = scenario(config.scenario.as_deref())?;
    if let Some(placed) = &config.part {
        (scenario.part, scenario.placement) = (placed.part.clone(), placed.placement);
        scenario.material = placed.material;
        scenario.floor = placed.floor.clone().unwrap_or(scenario.floor);
        scenario.unsteady = placed.unsteady.unwrap_or(scenario.unsteady);
    }
    let (mut head, stage) =
        sim::head_with_progress(&scenario, progress).map_err(Exit::Unavailable.failure())?;
    if let Some(exposing) = config.exposing {
        exposed(&stage, exposing)?;
    }
    let calibration = if scenario.calibrated {
        exact(&scenario)?
    } else {
        head.set_timing(Timing::default());
        devices::nominal(head.camera_format(), head.projector_size())?
    };
    Ok(OpenedHead {
        stage: Some(stage),
        ..OpenedHead::new(head, calibration)
    })
}

/// Sets exposure and gain of a simulated camera.
fn exposed(stage: &Stage, exposing: Exposing) -> Result<()> {
    stage
        .expose(exposing.exposure(), exposing.gain)
        .map_err(Exit::Unavailable.failure())
}

fn replayed(folders: &[std::path::PathBuf]) -> Result<OpenedHead> {
    let recordings = folders
        .iter()
        .map(|folder| Recording::open(folder))
        .collect::<Result<Vec<_>, _>>()?;
    let calibration = calibration_of(folders, &recordings)?;
    let first = folders.iter().zip(&recordings).next();
    let played = first.map(|(folder, recording)| Played::of(folder, recording));
    let head = hal::replay::head(recordings).map_err(Exit::Unavailable.failure())?;
    Ok(OpenedHead {
        played,
        ..OpenedHead::new(head, calibration)
    })
}

/// The calibration that the first recording carries; the others were taken with the same head.
fn calibration_of(folders: &[std::path::PathBuf], recordings: &[Recording]) -> Result<Calibration> {
    let (Some(folder), Some(first)) = (folders.first(), recordings.first()) else {
        return Exit::Configuration
            .fail("head.backend is \"replay\" and head.recordings names no folder");
    };
    let missing = |what: &str| {
        let manifest = folder.join("recording.json");
        let message = format!("{} {what}: the replay head needs it", manifest.display());
        Failure::new(Exit::Content, message)
    };
    let noise = first
        .noise_counts
        .ok_or_else(|| missing("has no camera.noise_counts"))?;
    Calibration::of(first, noise).map_err(|what| missing(&what.to_string()))
}
