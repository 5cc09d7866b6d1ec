//! A simulated head in front of one part, and one run of each method.
//!
//! Preliminary maps, patterns and the golden map of the part are measured once per noise seed, and shared by the runs that need
//! them.

use super::judge::{Outcome, judge};
use super::methods::{self, BetterSequence, Method};
use super::scenes::{Judged, OpticsKind, Scene};
use algo::adaptive::{ProjectorMap, noise, paper};
use algo::pattern::{PhaseFunction, PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use appliance::head::calibration::Calibration;
use appliance::head::rig::{MeasureError, Measured, Rig};
use hal::head::DynHead;
use sim::{Stage, Truth};
use std::sync::Arc;
use std::time::Duration;

/// A simulated head in front of one part, with the preliminary measurements of the part.
pub struct Runner {
    head: DynHead,
    stage: Stage,
    truth: Truth,
    calibration: Calibration,
    optics: OpticsKind,
    judged: Judged,
    learnt: Learnt,
}

/// The preliminary measurements and patterns with the noise of one seed, made when first needed.
#[derive(Default)]
struct Learnt {
    seed: u64,
    preliminary: Option<Arc<Preliminary>>,
    paper: Option<Arc<ProjectorMap>>,
    better: Option<Arc<Better>>,
    golden: Option<Arc<Vec<AbsolutePhase>>>,
}

/// The preliminary vertical measurement: its raw phase, and where each pixel's light comes from.
struct Preliminary {
    phase: Vec<AbsolutePhase>,
    map: ProjectorMap,
}

/// The better pattern, and the phase that it has in each camera pixel on the measured surface.
struct Better {
    function: PhaseFunction,
    expected: Vec<AbsolutePhase>,
}

/// The pattern of a sequence that the caller chooses, and what it is unwrapped about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Fixed pitch, absolute by itself.
    Fixed {
        /// Fringes over the projector's width.
        fringes: u32,
    },
    /// The better pattern about the map of the preliminary measurement.
    Better,
    /// The better pattern about the golden map.
    Golden,
}

/// A run: its measurement and how good it is.
pub struct Run {
    /// Against truth.
    pub outcome: Outcome,
    /// Frames, phases and heights.
    pub measured: Measured,
    /// The pattern.
    pub function: PhaseFunction,
    /// Which of the frames shows the finest level first.
    pub finest: usize,
}

const TIMEOUT: Duration = Duration::from_secs(5);
/// Pitch of the preliminary patterns, projector pixels.
const PRELIMINARY_PITCH: f64 = paper::PROJECTOR_PITCH * paper::PRELIMINARY;

/// Noise streams: each measurement of a seed has its own, so that its result does not depend on which other methods are run.
const STREAMS: u64 = 1000;
const PRELIMINARY_STREAM: u64 = 0;
const HORIZONTAL_STREAM: u64 = 1;
const GOLDEN_STREAM: u64 = 2;
const CHOSEN_STREAM: u64 = 3;

fn stream(method: Method) -> u64 {
    match method {
        Method::Paper { image_pitch } => 10 + u64::from(image_pitch),
        Method::Better(shot) => 30 + u64::from(shot.count()),
        Method::Fixed { fringes } => 100 + u64::from(fringes),
    }
}

impl Runner {
    /// Sets up the head in front of the part.
    ///
    /// # Errors
    /// If the scene cannot be simulated.
    pub fn new(scene: &Scene, optics: OpticsKind) -> Result<Self, MeasureError> {
        let scenario = scene.scenario(optics, 1);
        let (head, stage) = sim::head(&scenario)?;
        let calibration = Calibration::of_stage(&stage).map_err(rig)?;
        Ok(Self {
            head,
            truth: stage.truth(),
            stage,
            calibration,
            optics,
            judged: scene.judged,
            learnt: Learnt::default(),
        })
    }

    /// Runs a method with the noise of `seed`.
    ///
    /// # Errors
    /// If the head or the pattern fails.
    pub fn run(&mut self, method: Method, seed: u64) -> Result<Run, MeasureError> {
        self.learn_with(seed);
        let (columns, rows) = self.size();
        match method {
            Method::Fixed { fringes } => {
                self.paper_chain(method, self.vertical(f64::from(fringes))?)
            }
            Method::Paper { image_pitch } => {
                let map = self.paper_map()?;
                let function = paper::adapt(&map, columns, rows, f64::from(image_pitch));
                self.paper_chain(method, function.map_err(rig)?)
            }
            Method::Better(frames) => self.better_frames(method, frames),
        }
    }

    /// Measures with a sequence of the caller's choice and the noise of `seed`. `shots` returns what each frame
    /// shows, for the range of the phase function. The second result is the map that the phase was unwrapped about.
    ///
    /// # Errors
    /// If the head or the pattern fails.
    pub fn measure_with(
        &mut self,
        pattern: Pattern,
        shots: impl Fn(PhaseRange) -> Vec<Shot>,
        seed: u64,
    ) -> Result<(Measured, Option<Vec<AbsolutePhase>>), MeasureError> {
        self.learn_with(seed);
        let (function, map) = match pattern {
            Pattern::Fixed { fringes } => (self.vertical(f64::from(fringes))?, None),
            Pattern::Better => {
                let better = self.better()?;
                (better.function.clone(), Some(better.expected.clone()))
            }
            Pattern::Golden => {
                let golden = self.golden()?;
                (self.better()?.function.clone(), Some(golden.to_vec()))
            }
        };
        let shots = shots(function.range());
        let measured = self.measure(CHOSEN_STREAM, &function, &shots, map.as_deref())?;
        Ok((measured, map))
    }

    /// The true heights and classes of the pixels.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    fn learn_with(&mut self, seed: u64) {
        if self.learnt.seed != seed {
            self.learnt = Learnt {
                seed,
                ..Learnt::default()
            };
        }
    }

    fn size(&self) -> (usize, usize) {
        let projector = &self.calibration.projector;
        (projector.width(), projector.height())
    }

    fn measure(
        &mut self,
        noise_stream: u64,
        function: &PhaseFunction,
        shots: &[Shot],
        map: Option<&[AbsolutePhase]>,
    ) -> Result<Measured, MeasureError> {
        self.stage.reseed(self.learnt.seed * STREAMS + noise_stream);
        let mut rig = Rig {
            head: &mut self.head,
            calibration: &self.calibration,
            timeout: TIMEOUT,
        };
        rig.measure(function, shots, map, &|_| ())
    }

    fn vertical(&self, fringes: f64) -> Result<PhaseFunction, MeasureError> {
        let (columns, rows) = self.size();
        PhaseFunction::vertical(columns, rows, fringes).map_err(rig)
    }

    /// The preliminary measurement of both adaptive methods: one vertical sequence at 20 px pitch.
    fn preliminary(&mut self) -> Result<Arc<Preliminary>, MeasureError> {
        if let Some(known) = &self.learnt.preliminary {
            return Ok(Arc::clone(known));
        }
        let function = self.vertical(self.size().0 as f64 / PRELIMINARY_PITCH)?;
        let shots = Sequence::geometric(function.range(), 3, 4);
        let measured = self.measure(PRELIMINARY_STREAM, &function, &shots, None)?;
        let map = ProjectorMap::from_heights(&measured.triangulator, &measured.heights);
        let phase = measured.phases.phase;
        let found = Arc::new(Preliminary { phase, map });
        Ok(Arc::clone(self.learnt.preliminary.insert(found)))
    }

    /// The paper's preliminary maps: vertical and horizontal at 20 px, each measured by itself.
    fn paper_map(&mut self) -> Result<Arc<ProjectorMap>, MeasureError> {
        if let Some(known) = &self.learnt.paper {
            return Ok(Arc::clone(known));
        }
        let vertical = self.preliminary()?;
        let (columns, rows) = self.size();
        let fringes = rows as f64 / PRELIMINARY_PITCH;
        let function = PhaseFunction::horizontal(columns, rows, fringes).map_err(rig)?;
        let shots = Sequence::geometric(function.range(), 3, 4);
        let horizontal = self.measure(HORIZONTAL_STREAM, &function, &shots, None)?;
        let phases = [&vertical.phase[..], &horizontal.phases.phase];
        let width = horizontal.phases.width;
        let map = ProjectorMap::from_phases(phases, [PRELIMINARY_PITCH; 2], width);
        Ok(Arc::clone(self.learnt.paper.insert(Arc::new(map))))
    }

    /// The better pattern, made for the blur of the scenario.
    fn better(&mut self) -> Result<Arc<Better>, MeasureError> {
        if let Some(known) = &self.learnt.better {
            return Ok(Arc::clone(known));
        }
        let preliminary = self.preliminary()?;
        let blur = self.optics.blur();
        let optics = noise::Optics {
            projector_blur: blur.projector_blur_px,
            camera_blur: blur.camera_blur_px,
            projector_pitch: noise::PROJECTOR_PITCH,
            image_pitch: noise::IMAGE_PITCH,
        };
        let (columns, rows) = self.size();
        let map = &preliminary.map;
        let function = noise::adapt(map, columns, rows, &optics).map_err(rig)?;
        let expected = map.expected_phase(&function);
        let found = Arc::new(Better { function, expected });
        Ok(Arc::clone(self.learnt.better.insert(found)))
    }

    /// The golden map: the full sequence of the better pattern.
    fn golden(&mut self) -> Result<Arc<Vec<AbsolutePhase>>, MeasureError> {
        if let Some(known) = &self.learnt.golden {
            return Ok(Arc::clone(known));
        }
        let better = self.better()?;
        let map = Some(&better.expected[..]);
        let shots = BetterSequence::Twelve.shots();
        let measured = self.measure(GOLDEN_STREAM, &better.function, &shots, map)?;
        let found = Arc::new(measured.phases.phase);
        Ok(Arc::clone(self.learnt.golden.insert(found)))
    }

    fn better_frames(
        &mut self,
        method: Method,
        frames: BetterSequence,
    ) -> Result<Run, MeasureError> {
        let better = self.better()?;
        let golden = if frames.needs_golden() {
            Some(self.golden()?)
        } else {
            None
        };
        let map = golden.as_deref().unwrap_or(&better.expected);
        let shots = frames.shots();
        let measured = self.measure(stream(method), &better.function, &shots, Some(map))?;
        Ok(self.judged(better.function.clone(), &shots, measured))
    }

    /// The paper's chain with its own criterion of image pitch.
    fn paper_chain(
        &mut self,
        method: Method,
        function: PhaseFunction,
    ) -> Result<Run, MeasureError> {
        let shots = methods::geometric(&function);
        let mut measured = self.measure(stream(method), &function, &shots, None)?;
        let fine = too_fine(&measured.phases.phase, measured.phases.width);
        for (trust, fine) in measured.phases.trust.iter_mut().zip(fine) {
            if fine && *trust == Trust::Resolved {
                *trust = Trust::LowModulation;
            }
        }
        Ok(self.judged(function, &shots, measured))
    }

    fn judged(&self, function: PhaseFunction, shots: &[Shot], measured: Measured) -> Run {
        Run {
            outcome: judge(&self.truth, &measured, self.judged),
            measured,
            function,
            finest: methods::finest(shots),
        }
    }
}

fn rig(error: impl std::fmt::Display) -> MeasureError {
    MeasureError::Impossible(error.to_string())
}

/// Smallest image pitch along u that the paper's chain resolves, camera pixels.
const RESOLVED_PITCH: f64 = 2.5;

/// Where the image pitch along u is below [`RESOLVED_PITCH`], by central differences of Φ.
fn too_fine(phase: &[AbsolutePhase], width: usize) -> Vec<bool> {
    (0..phase.len())
        .map(|at| {
            let u = at % width;
            let inside = u > 0 && u + 1 < width;
            inside && phase[at - 1].is_known() && phase[at + 1].is_known() && {
                let rise = (phase[at + 1] - phase[at - 1]).turns();
                rise.abs() / 2.0 > 1.0 / RESOLVED_PITCH
            }
        })
        .collect()
}
