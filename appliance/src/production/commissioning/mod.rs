//! Commissioning on the station: steps are asked for from other threads, and the measuring task,
//! which owns the head, carries them out.
//!
//! [`Commission`] is what both share: the step that waits, how far the one that runs has come, what
//! the steps have found, and what is known of the open head. The station is in its state
//! "commissioning" while a step runs, so no cycle and no change of recipe begins.

mod carrying_out;
pub mod live;
mod view;

use crate::head::calibration::Calibration;
use crate::head::commission::{Commissioning, Laid, Poses, Step};
use crate::head::exposing::Exposing;
use crate::head::live::Outline;
use crate::production::drift::DriftTrend;
use crate::station::{Event, Request, StationHandle};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Folder of the pictures of poses in the state folder.
const PICTURES: &str = "commissioning";

/// A step that was asked for, with what is set before it.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The step.
    pub step: &'static Step,
    /// What is done with the poses, where the step is about them.
    pub poses: Option<Poses>,
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
    pub volume: Vec<Outline>,
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
struct Inside {
    asked: Option<Asked>,
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
    inside: Arc<Mutex<Inside>>,
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
                (Commissioning::default(), Some(problem))
            }
        };
        let inside = Inside {
            laid: kept.laid(),
            kept,
            ..Inside::default()
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

    fn inside(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has the measuring task carry out a step; answers whether it does, which it does not while it
    /// has something else to do.
    pub fn begin(&self, station: &StationHandle, asked: Asked) -> bool {
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
    fn take(&self) -> Option<Asked> {
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
    /// In words: it cannot be stored; it is known until the next start.
    fn keep(&self, mut kept: Commissioning) -> Result<(), String> {
        let saved = kept.save(&self.state);
        let laid = kept.laid();
        let mut inside = self.inside();
        (inside.kept, inside.laid) = (kept, laid);
        saved
    }
}
