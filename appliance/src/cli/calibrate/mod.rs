//! `fringed calibrate`: makes or imports the models, measures the rest of the calibration on the
//! head as the steps of commissioning do, and writes `calibration.json`.

mod poses;

pub use poses::Print;

use super::numbers::number;
use super::options::Measuring;
use crate::config::HeadConfig;
use crate::error::{Exit, Result};
use crate::head::calibration::file::{COLDEST_C, CalibrationFile, HOTTEST_C};
use crate::head::calibration::opencv::{self, Declared, Sizes, Unit};
use crate::head::calibration::place::CalibrationPlace;
use crate::head::calibration::{Calibration, HeightsBy};
use crate::head::commission::{
    Characteristics, Choices, Commissioning, HeadModels, OF_SCENARIO, PLANE, STEPS, Subject, TIMING,
};
use crate::production::backend;
use crate::storage::state::StateFolder;
use algo::geometry::RigError;
use algo::pattern::PhaseFunction;
use hal::bounds::MAX_RANGE_MM;
use poses::BoardOptions;
use serde_json::{Value, json};
use sim::{Part, Stage};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What to do if the calibration cannot be written.
const FULL: &str = "free space, or name another file with --out";

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
    board: BoardOptions,
    #[command(flatten)]
    measuring: Measuring,
}

impl Calibrate {
    /// Opens the head, measures it, writes the calibration and prints what was found.
    ///
    /// # Errors
    /// If a model cannot be imported (65, 66), the head cannot be measured (69), or the calibration
    /// cannot be written (73). The calibration before is then unchanged.
    pub fn run(&self) -> Result<()> {
        let options = &self.measuring;
        if self.board.given() {
            return self.board.run(options);
        }
        let why = "calibrate: a recording carries its own calibration";
        let config = options.live(self.scenario.as_ref(), why)?;
        // Locked until all is written: no station measures meanwhile with the calibration that is
        // being replaced.
        let state = StateFolder::open(&options.files.state_folder()?)?;
        let head = config.head_in(state.path());
        let place = CalibrationPlace::at(head.calibration.as_deref().unwrap_or(Path::new("")));
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
        let exact = opened.problem.is_none() && opened.stage.is_some();
        let imported = self.imported(&opened.calibration, &mut notes)?;
        let heights_by = match self.no_plate {
            true => None,
            false => self
                .heights_by
                .or(before.as_ref().map(|file| file.heights_by)),
        };
        let sizes = opened.calibration.sizes();
        let usable = |file: &&CalibrationFile| {
            file.sizes() == sizes && (exact || file.models_from != OF_SCENARIO)
        };
        let place = self
            .board
            .out
            .as_deref()
            .map_or(place, CalibrationPlace::at);
        let timing = |share: f64, words: &str| progress.tell(0.3 + 0.525 * share, words);
        let plane = |share: f64, words: &str| progress.tell(0.825 + 0.175 * share, words);
        let mut kept = Commissioning::of(sizes, None);
        let mut subject = Subject {
            head: &mut opened.head,
            calibration: &mut opened.calibration,
            calibrated: opened.problem.is_none(),
            exact,
            before: before.as_ref().filter(usable).cloned(),
            place: place.path(),
            poses: None,
            choices: Choices {
                imported,
                heights_by: Some(heights_by.unwrap_or(HeightsBy::Models)),
                temperature_c: self.temperature.filter(|celsius| celsius.is_finite()),
                no_plate: self.no_plate,
                if_full: Some(FULL),
            },
            progress: &timing,
            white: None,
            stored: None,
            notes,
        };
        if subject.models(&kept).is_none() {
            let words = "calibrate: the models of camera and projector are not known yet: make them with --board and --poses, or import them with \
                         --camera and --projector, or with --models";
            return Exit::Usage.fail(words);
        }
        if !self.no_plate {
            pool.install(|| lay_plate(opened.stage.as_ref(), &mut subject.notes))?;
        }
        let done = pool.install(|| -> Result<()> {
            for step in STEPS
                .iter()
                .filter(|step| [TIMING, PLANE].contains(&step.name))
            {
                subject.progress = if step.name == TIMING { &timing } else { &plane };
                step.carry_out(&mut subject, &mut kept)?;
            }
            Ok(())
        });
        progress.clear();
        done?;
        let Subject { stored, notes, .. } = subject;
        // The step plane has stored it.
        let Some(file) = &stored else { return Ok(()) };
        let report = CalibrationReport {
            file,
            before: before.as_ref().map(|file| file.fingerprint.as_str()),
            place: place.path(),
            notes: &notes,
        };
        options.output.answer(&report.json(), || report.table())
    }

    /// The models that the options name; `notes` gets what was corrected in them.
    fn imported(&self, head: &Calibration, notes: &mut Vec<String>) -> Result<Option<HeadModels>> {
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
        let (from, models) = match (&self.camera, &self.projector, &self.models) {
            (Some(camera), Some(projector), _) => {
                let models = opencv::from_two(camera, projector, sizes, declared);
                (format!("{}, {}", name(camera), name(projector)), models)
            }
            (_, _, Some(models)) => (name(models), opencv::from_one(models, sizes, declared)),
            _ => return Ok(None),
        };
        let models = models?;
        if !models.has_plane {
            return Exit::Content.fail(format!(
                "import {from}: it states no plane z = 0: add plate_R and plate_T (the pose of the plate that lies in the reference \
                 plane, as cv2.solvePnP gives it), or give the plane's distance with --plane-at"
            ));
        }
        notes.extend(models.notes);
        let models = HeadModels {
            camera: models.camera,
            projector: models.projector,
            from,
            geometry: None,
        };
        let calibration = models.calibration(head);
        let checked = calibration.and_then(|calibration| look_down(&calibration));
        checked.map_err(Exit::Content.because(format!("import {}", models.from)))?;
        Ok(Some(models))
    }
}

/// The calibration that is replaced, if one can be read; else a note says why.
fn before(place: &CalibrationPlace, notes: &mut Vec<String>) -> Option<CalibrationFile> {
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
///
/// # Errors
/// They do not.
fn look_down(calibration: &Calibration) -> Result<()> {
    let (columns, rows) = calibration.raster();
    let function = PhaseFunction::vertical(columns as usize, rows as usize, 1.0);
    let function = function.map_err(Exit::Content.failure())?;
    match calibration.triangulator(function, None) {
        Ok(_) => Ok(()),
        Err(error @ RigError::NotAbove(_)) => Exit::Content.fail(format!(
            "{error}; OpenCV's boards have their z pointing away from the camera: then add --z-away"
        )),
        Err(error) => Exit::Content.fail(error),
    }
}

/// Puts a flat plate in front of a simulated head.
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

/// A calibration that was written.
struct CalibrationReport<'a> {
    file: &'a CalibrationFile,
    /// Fingerprint of the calibration before.
    before: Option<&'a str>,
    place: &'a Path,
    notes: &'a [String],
}

impl CalibrationReport<'_> {
    fn json(&self) -> Value {
        json!({
            "calibration": self.file, "file": self.place.display().to_string(), "notes": self.notes,
            "fingerprint_before": self.before,
        })
    }

    fn table(&self) -> String {
        let file = self.file;
        let mut lines = String::new();
        let mut line = |name: &str, found: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(lines, "{name:9} {found}");
        };
        line("models", format!("of {}", file.models_from));
        for (name, found) in Characteristics::of(file)
            .iter()
            .flat_map(Characteristics::words)
        {
            line(name, found);
        }
        if let Some(plane) = &file.reference {
            line("plane", plane.words());
        }
        for note in self.notes {
            line("note", note.clone());
        }
        let digits = |fingerprint: &str| fingerprint.get(..8).unwrap_or_default().to_owned();
        let recipes = match self.before {
            Some(before) if before != file.fingerprint => format!(
                "was {}: recipes made for that one are refused, teach them again",
                digits(before)
            ),
            Some(_) => "as before: recipes stay valid".into(),
            None => "the first one here".into(),
        };
        line(
            "written",
            format!(
                "{}, fingerprint {}, {recipes}",
                self.place.display(),
                digits(&file.fingerprint)
            ),
        );
        lines
    }
}
