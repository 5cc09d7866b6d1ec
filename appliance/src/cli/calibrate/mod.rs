//! `fringed calibrate`: makes or imports the models, measures the rest of the calibration on the
//! head, and writes `calibration.json`.

mod poses;
mod report;

use super::numbers::number;
use super::options::Measuring;
use crate::config::HeadConfig;
use crate::error::{Exit, Result};
use crate::head::calibrate::{Basis, make};
use crate::head::calibration::file::{COLDEST_C, CalibrationFile, HOTTEST_C};
use crate::head::calibration::opencv::{self, Declared, Models, Sizes, Unit};
use crate::head::calibration::place::Place;
use crate::head::calibration::{Calibration, HeightsBy};
use crate::production::backend::{self, OpenedHead};
use crate::storage::state::StateFolder;
use algo::geometry::RigError;
use algo::pattern::PhaseFunction;
use hal::bounds::MAX_RANGE_MM;
use poses::Poses;
use sim::{Part, Stage};
use std::path::{Path, PathBuf};

/// Calibrate the head: make its models from a board or import them, measure delay, stamps, grey
/// response, noise, contrast and the reference plane.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("imported").args(["camera", "projector", "models"]).multiple(true).conflicts_with("board"))]
pub struct Calibrate {
    /// Calibrate a simulated head of this scenario instead of the configured head.
    #[arg(long, value_name = "FILE", conflicts_with = "board")]
    scenario: Option<PathBuf>,
    /// The camera's model, written by OpenCV (YAML, XML, JSON). Without models those of before
    /// stay.
    #[arg(long, value_name = "FILE", requires = "projector")]
    camera: Option<PathBuf>,
    /// The projector's model.
    #[arg(long, value_name = "FILE", requires = "camera")]
    projector: Option<PathBuf>,
    /// Both models in one file, with R and T from the camera to the projector and the pose of the
    /// plate.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera", "projector"])]
    models: Option<PathBuf>,
    /// Unit of lengths in the models' files, where they do not say it.
    #[arg(long, requires = "imported")]
    unit: Option<Unit>,
    /// The world's z in the models' files points away from the head, as on OpenCV's boards.
    #[arg(long, requires = "imported")]
    z_away: bool,
    /// The plane z = 0 stands across the camera's axis at this distance: for models without the
    /// pose of a plate.
    #[arg(long, value_name = "MM", requires = "imported", value_parser = number(1.0, MAX_RANGE_MM))]
    plane_at: Option<f64>,
    /// No flat plate lies in the plane z = 0: leave the reference plane to the models.
    #[arg(long, conflicts_with = "board")]
    no_plate: bool,
    /// What heights go by: the models, or the projector points that are measured on the plate. By
    /// default as in the calibration before, else the models.
    #[arg(long, conflicts_with_all = ["board", "no_plate"])]
    heights_by: Option<HeightsBy>,
    /// How warm the head is, °C: kept in the calibration.
    #[arg(long, value_name = "CELSIUS", allow_negative_numbers = true, conflicts_with = "board", value_parser = number(COLDEST_C, HOTTEST_C))]
    temperature: Option<f64>,
    #[command(flatten)]
    poses: Poses,
    #[command(flatten)]
    measuring: Measuring,
}

/// The origin of models that do not come from a file.
const OF_SCENARIO: &str = "scenario";

/// What to do if the calibration cannot be written.
const FULL: &str = "free space, or name another file with --out";

impl Calibrate {
    /// Opens the head, measures it, writes the calibration and prints what was found.
    ///
    /// # Errors
    /// If a model cannot be imported (65, 66), the head cannot be measured (69), or the calibration
    /// cannot be written (73). The calibration before is then unchanged.
    pub fn run(&self) -> Result<()> {
        let options = &self.measuring;
        if self.poses.given() {
            return self.poses.run(options);
        }
        let why = "calibrate: a recording carries its own calibration";
        let config = options.live(self.scenario.as_ref(), why)?;
        // Locked until all is written: no station measures meanwhile with the calibration that is
        // being replaced.
        let state = StateFolder::open(&options.files.state_folder()?)?;
        let head = config.head_in(state.path());
        let place = Place::at(head.calibration.as_deref().unwrap_or(Path::new("")));
        let mut notes = Vec::new();
        let before = before(&place, &mut notes);
        let progress = options.output.progress();
        let on_progress =
            |share: f64| progress.tell(0.3 * share, "working out the light of the scene");
        let pool = options.threads.pool(config.threads)?;
        // Without the stored calibration, which is being replaced.
        let bare = HeadConfig {
            calibration: None,
            ..head
        };
        let mut opened = pool.install(|| backend::open(&bare, &on_progress))?;
        let (basis, response) = self.basis(&opened, before.as_ref(), &mut notes)?;
        if basis.plate {
            let stage = opened.stage.clone();
            pool.install(|| lay_plate(stage.as_ref(), &mut notes))?;
        }
        let on_progress = |share: f64, words: &str| progress.tell(0.3 + 0.7 * share, words);
        let made = pool.install(|| make(&mut opened.head, basis, response, &on_progress));
        progress.clear();
        let mut made = made?;
        let place = self.poses.out.as_deref().map_or(place, Place::at);
        place.save(&made.bytes, &made.maps, FULL)?;
        notes.append(&mut made.notes);
        let report = report::Report {
            file: &made.file,
            before: before.as_ref().map(|file| file.fingerprint.as_str()),
            place: place.path(),
            notes: &notes,
        };
        options.output.answer(&report.json(), || report.table())
    }

    /// What the calibration starts from, and the response of the one before.
    fn basis(
        &self,
        opened: &OpenedHead,
        before: Option<&CalibrationFile>,
        notes: &mut Vec<String>,
    ) -> Result<(Basis, Option<Vec<f64>>)> {
        let mut calibration = opened.calibration.clone();
        let content = Exit::Content.failure::<String>();
        let stored = before
            .map(|file| Ok((file, file.calibration()?)))
            .transpose()
            .map_err(content)?
            .filter(|(_, stored)| stored.sizes() == calibration.sizes());
        let mut models_from = OF_SCENARIO.to_owned();
        let mut geometry = None;
        if let Some((from, models)) = self.imported(&calibration)? {
            models_from = from;
            notes.extend(models.notes);
            let (camera, projector) = (models.camera, models.projector);
            let (frames, raster) = (calibration.frames(), calibration.raster());
            let noise = calibration.noise_counts;
            let exposing = calibration.exposing;
            calibration = Calibration::new(frames, raster, (&camera, &projector), noise)
                .and_then(|imported| fits(&imported).map(|()| imported))
                .map_err(|error| content(format!("import {models_from}: {error}")))?;
            calibration.exposing = exposing;
        } else if let Some((file, stored)) = &stored
            && file.models_from != OF_SCENARIO
        {
            models_from = file.models_from.clone();
            geometry = file.geometry.clone();
            calibration.camera = stored.camera.clone();
            calibration.projector = stored.projector.clone();
        } else if opened.problem.is_some() || opened.stage.is_none() {
            let words = "calibrate: the models of camera and projector are not known yet: make them with --board and --poses, or import them with \
                         --camera and --projector, or with --models";
            return Exit::Usage.fail(words);
        }
        calibration.response = None;
        let heights_by = match self.no_plate {
            true => None,
            false => self.heights_by.or(before.map(|file| file.heights_by)),
        };
        let basis = Basis {
            calibration,
            models_from,
            geometry,
            temperature_c: self.temperature.filter(|celsius| celsius.is_finite()),
            plate: !self.no_plate,
            heights_by: heights_by.unwrap_or(HeightsBy::Models),
        };
        let response = stored.and_then(|(file, _)| file.response.clone());
        Ok((basis, response))
    }

    /// The models that the options name, and their files' names.
    fn imported(&self, head: &Calibration) -> Result<Option<(String, Models)>> {
        let (width, height, _) = head.frames();
        let sizes = Sizes {
            camera: (width, height),
            projector: head.raster(),
        };
        let declared = Declared {
            unit: self.unit,
            z_away: self.z_away,
            plane_at: self.plane_at,
        };
        let name = |path: &Path| path.display().to_string();
        let named = [&self.camera, &self.projector, &self.models];
        model_files(named.into_iter().flatten())?;
        let content = Exit::Content.failure();
        let (names, models) = match (&self.camera, &self.projector, &self.models) {
            (Some(camera), Some(projector), _) => {
                let models = opencv::from_two(camera, projector, sizes, declared);
                (format!("{}, {}", name(camera), name(projector)), models)
            }
            (_, _, Some(models)) => (name(models), opencv::from_one(models, sizes, declared)),
            _ => return Ok(None),
        };
        let models = models.map_err(content)?;
        match models.has_plane {
            true => Ok(Some((names, models))),
            false => Err(content(format!(
                "import {names}: it states no plane z = 0: add plate_R and plate_T (the pose of the plate that lies in the reference \
                 plane, as cv2.solvePnP gives it), or give the plane's distance with --plane-at"
            ))),
        }
    }
}

/// The calibration that is replaced, if one can be read; else a note says why.
fn before(place: &Place, notes: &mut Vec<String>) -> Option<CalibrationFile> {
    let loaded = place.load().unwrap_or_else(|problem| {
        notes.push(format!("{problem}; it is left behind"));
        None
    });
    loaded.map(|loaded| loaded.file)
}

/// Checks that the files of models exist.
///
/// # Errors
/// If one does not (66).
pub fn model_files<'a>(named: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    match named.into_iter().find(|path| !path.exists()) {
        None => Ok(()),
        Some(path) => Exit::Missing.fail(format!(
            "import {}: there is no such file: name one that cv2.FileStorage wrote",
            path.display()
        )),
    }
}

/// Checks that camera and projector look down at the plane z = 0 from two different places.
fn fits(calibration: &Calibration) -> Result<(), String> {
    let projector = &calibration.projector;
    let (columns, rows) = (projector.width(), projector.height());
    let function =
        PhaseFunction::vertical(columns, rows, 1.0).map_err(|error| error.to_string())?;
    match calibration.triangulator(function, None) {
        Ok(_) => Ok(()),
        Err(error @ RigError::NotAbove(_)) => Err(format!(
            "{error}; OpenCV's boards have their z pointing away from the camera: then add --z-away"
        )),
        Err(error) => Err(error.to_string()),
    }
}

/// Puts a flat plate in front of a simulated head, where nobody can lay one.
fn lay_plate(stage: Option<&Stage>, notes: &mut Vec<String>) -> Result<()> {
    let Some(stage) = stage else {
        return Ok(());
    };
    if matches!(stage.scenario().part, Part::Plane(_)) {
        return Ok(());
    }
    notes.push("a flat plate was laid in front of the simulated head".into());
    let plate = Part::Plane(sim::parts::Plane::default());
    stage
        .place(&plate, &sim::Placement::default())
        .map_err(Exit::Software.failure())
}
