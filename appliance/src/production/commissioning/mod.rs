//! Commissioning on the station: steps are asked for from other threads, and the measuring task,
//! which owns the head, carries them out.
//!
//! [`Commission`] is what both share: the step that waits, how far the one that runs has come, what
//! the steps have found, and what is known of the open head. The station is in its state
//! "commissioning" while a step runs, so no cycle and no change of recipe begins.

mod carrying_out;
pub mod live;

use crate::error::Result;
use crate::head::board;
use crate::head::calibration::Calibration;
use crate::head::commission::{
    Commissioning, GEOMETRY, Laid, PoseAction, STEPS, Step, StepOutcome, pose_name,
};
use crate::head::exposing::Exposing;
use crate::head::live::VolumeOutline;
use crate::production::drift::DriftTrend;
use crate::station::{Event, Request, Snapshot, StationHandle};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Folder of the pictures of poses in the state folder.
const PICTURES: &str = "commissioning";

/// A step that was asked for, with what is set before it.
#[derive(Clone, Debug)]
pub struct StepRequest {
    /// The step.
    pub step: &'static Step,
    /// What is done with the poses, where the step is about them.
    pub poses: Option<PoseAction>,
    /// Exposure and gain to set first, and whether they are kept.
    pub exposing: Option<(Exposing, bool)>,
}

/// What is known of the open head.
#[derive(Clone, Debug)]
pub struct OpenHead {
    /// Whether it is simulated.
    pub simulated: bool,
    /// Whether exposure and gain can be set: not those of recordings.
    pub adjustable: bool,
    /// Why its calibration cannot be trusted.
    pub problem: Option<String>,
    /// Sizes and models.
    pub calibration: Calibration,
    /// Exposure and gain.
    pub exposing: Exposing,
    /// Outlines of the measuring volume in the camera's picture; none before it is calibrated.
    pub volume: Vec<VolumeOutline>,
    /// The least gain that the camera can be set to.
    pub least_gain: f64,
    /// Time between two refreshes of the projector.
    pub refresh: Duration,
}

/// The step that runs.
#[derive(Clone, Debug)]
struct Running {
    name: &'static str,
    said: String,
    share: f64,
    since: Instant,
}

#[derive(Debug, Default)]
struct CommissionState {
    asked: Option<StepRequest>,
    running: Option<Running>,
    head: Option<OpenHead>,
    kept: Commissioning,
    /// How the board lies in its poses.
    laid: Laid,
}

/// Commissioning, for the measuring task and for those who ask for steps. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Commission {
    state: PathBuf,
    inside: Arc<Mutex<CommissionState>>,
    drift: DriftTrend,
}

impl Commission {
    /// Commissioning with what is kept in the state folder, and complaints about files that cannot
    /// be used and begin anew.
    pub fn open(state: &Path) -> (Self, Vec<String>) {
        let (drift, unfit) = DriftTrend::open(state);
        let (kept, complaint) = match Commissioning::load(state) {
            Ok(kept) => (kept, None),
            Err(problem) => {
                Commissioning::put_aside(state);
                (Commissioning::default(), Some(problem.to_string()))
            }
        };
        let inside = CommissionState {
            laid: kept.laid(),
            kept,
            ..CommissionState::default()
        };
        let opened = Self {
            state: state.to_path_buf(),
            inside: Arc::new(Mutex::new(inside)),
            drift,
        };
        (opened, complaint.into_iter().chain(unfit).collect())
    }

    /// What the checks of the geometry have found.
    pub fn drift(&self) -> &DriftTrend {
        &self.drift
    }

    fn inside(&self) -> MutexGuard<'_, CommissionState> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has the measuring task carry out a step; answers whether it does, which it does not while it
    /// has something else to do.
    pub fn begin(&self, station: &StationHandle, asked: StepRequest) -> bool {
        {
            let mut inside = self.inside();
            if inside.asked.is_some() || inside.running.is_some() {
                return false;
            }
            inside.running = Some(Running {
                name: asked.step.name,
                said: "waiting for the measuring task".into(),
                share: 0.0,
                since: Instant::now(),
            });
            inside.asked = Some(asked);
        }
        let after = station.event(Event::Request(Request::Commission));
        let begun = after.state_word == "commissioning" || self.inside().asked.is_none();
        if !begun {
            self.ended();
        }
        begun
    }

    /// Whether this step is under way.
    pub fn is_running(&self, name: &str) -> bool {
        let inside = self.inside();
        inside
            .running
            .as_ref()
            .is_some_and(|running| running.name == name)
    }

    /// The number that the next pose gets.
    pub fn free_pose(&self) -> u32 {
        self.inside().kept.free_pose()
    }

    /// The file of a pose's picture.
    fn picture_file(&self, number: u32) -> PathBuf {
        self.state.join(PICTURES).join(format!("pose-{number}.png"))
    }

    /// The picture of a pose as PNG, if there is one.
    pub fn pose_picture(&self, number: u32) -> Option<Vec<u8>> {
        let known = self.inside().kept.poses.contains_key(&number);
        known.then(|| std::fs::read(self.picture_file(number)).ok())?
    }

    /// What is known of the open head; none while no head is open.
    pub fn head(&self) -> Option<OpenHead> {
        self.inside().head.clone()
    }

    /// The head was opened, changed or lost.
    pub(super) fn set_head(&self, head: Option<OpenHead>) {
        self.inside().head = head;
    }

    /// The step that waits, for the measuring task.
    fn take(&self) -> Option<StepRequest> {
        self.inside().asked.take()
    }

    fn tell(&self, share: f64, words: &str) {
        if let Some(running) = &mut self.inside().running {
            (running.share, running.said) = (share, words.to_owned());
        }
    }

    fn ended(&self) {
        let mut inside = self.inside();
        (inside.asked, inside.running) = (None, None);
    }

    /// What the steps have found.
    fn kept(&self) -> Commissioning {
        self.inside().kept.clone()
    }

    /// Keeps what the steps have found, also on the card.
    ///
    /// # Errors
    /// It cannot be stored; it is known until the next start.
    fn keep(&self, mut kept: Commissioning) -> Result<()> {
        let saved = kept.save(&self.state);
        let laid = kept.laid();
        let mut inside = self.inside();
        (inside.kept, inside.laid) = (kept, laid);
        saved
    }
}

impl Commission {
    /// The state of head and steps; whether a recipe is active comes from the snapshot.
    pub fn view(&self, snapshot: &Snapshot) -> Value {
        let inside = self.inside();
        let Some(head) = &inside.head else {
            let words = match &snapshot.fault {
                Some(fault) => format!("{}; {}", fault.cause, fault.remedy),
                None => "the head is being opened".into(),
            };
            return json!({ "open": false, "problem": words, "running": null, "steps": [] });
        };
        let running = inside.running.as_ref().map(|running| {
            json!({
                "step": running.name, "said": running.said, "share": running.share,
                "since_ms": running.since.elapsed().as_millis() as u64,
            })
        });
        let (width, height, bits) = head.calibration.frames();
        let (columns, rows) = head.calibration.raster();
        json!({
            "open": true,
            "simulated": head.simulated,
            "calibrated": head.problem.is_none(),
            "problem": head.problem,
            "camera": {
                "columns": width, "rows": height, "bits": bits, "exposure_us": head.exposing.exposure_us, "gain": head.exposing.gain, "least_gain": head.least_gain,
                "refresh_us": head.refresh.as_micros() as u64, "adjustable": head.adjustable,
            },
            "projector": { "columns": columns, "rows": rows },
            "volume": head.volume,
            "running": running,
            "steps": steps(&inside, snapshot),
            "geometry": geometry(&inside, head),
            "drift": self.drift.view(&head.calibration.fingerprint()),
        })
    }
}

fn steps(inside: &CommissionState, snapshot: &Snapshot) -> Vec<Value> {
    let running = inside.running.as_ref().map(|running| running.name);
    let mut steps: Vec<Value> = STEPS
        .iter()
        .map(|step| {
            let outcome = inside.kept.steps.get(step.name);
            let state = match outcome {
                _ if running == Some(step.name) => "running",
                None => "open",
                Some(outcome) if outcome.passed => "done",
                Some(_) => "failed",
            };
            let mut shown = shown(step.name, state, outcome);
            let ground = inside.laid.ground.as_ref();
            if let (GEOMETRY, None, Some(ground)) = (step.name, outcome, ground) {
                (shown["said"], shown["remedy"]) =
                    (json!([ground.words()]), json!(ground.remedy()));
            }
            shown
        })
        .collect();
    let state = match (&snapshot.teach, &snapshot.recipe) {
        (Some(_), _) => "running",
        (None, Some(_)) => "done",
        (None, None) => "open",
    };
    let mut teach = shown("teach", state, None);
    if let Some(recipe) = &snapshot.recipe {
        let words = format!("recipe {} ({}) is active", recipe.number, recipe.name);
        teach["said"] = json!([words]);
    }
    steps.push(teach);
    steps
}

fn shown(name: &str, state: &str, outcome: Option<&StepOutcome>) -> Value {
    json!({
        "name": name, "state": state, "at_unix_s": outcome.map(|outcome| outcome.at_unix_s),
        "said": outcome.map_or(&[][..], |outcome| &outcome.said),
        "remedy": outcome.and_then(|outcome| outcome.remedy.as_ref()),
        "figures": outcome.map_or(json!({}), |outcome| outcome.figures.clone()),
    })
}

/// The poses, and the models if there are any. What a pose has left in the models is known by its
/// name there.
fn geometry(inside: &CommissionState, head: &OpenHead) -> Value {
    let (kept, laid) = (&inside.kept, &inside.laid);
    let models = kept.models.as_ref();
    let corners = kept.board.as_deref().and_then(corners_of).unwrap_or(0);
    let poses: Vec<Value> = kept
        .poses
        .iter()
        .map(|(number, pose)| {
            let name = pose_name(*number);
            let fitted = models.and_then(|models| {
                let mut poses = models.geometry.poses.iter();
                poses.find(|fitted| fitted.recording == name)
            });
            json!({
                "number": number, "corners": pose.located(), "of": corners, "usable": pose.problem.is_none(), "problem": pose.problem,
                "tilt_degrees": laid.tilt(*number), "camera_px": fitted.map(|pose| pose.camera_px),
                "projector_px": fitted.map(|pose| pose.projector_px),
            })
        })
        .collect();
    let result = models.map(|models| {
        let file = &models.geometry;
        json!({
            "camera_px": file.camera_px, "projector_px": file.projector_px, "height_sigma_mm": file.height_sigma_mm,
            "length_sigma_mm": file.length_sigma_mm, "baseline_mm": file.baseline_mm, "scale": models.scale,
        })
    });
    let plane = laid.ground.as_ref().map(
        |ground| json!({ "pose": ground.pose, "said": ground.words(), "remedy": ground.remedy() }),
    );
    json!({
        "board": kept.board, "poses": poses, "plane": plane, "frame_covered": kept.covered(head.calibration.frames()),
        "tilt_degrees": models.map(|models| models.tilt_degrees), "result": result,
    })
}

fn corners_of(board: &str) -> Option<usize> {
    let board = board::parse(board).ok()?;
    Some(board.columns * board.rows)
}
