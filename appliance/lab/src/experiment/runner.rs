//! A simulated head in front of one part, and one run of each method.
//!
//! Preliminary maps, patterns and the golden map of the part are measured once per noise seed, and
//! shared by the runs that need them.

use super::compared::{BetterSequence, Judged, Method, OpticsKind, Scene, finest};
use super::judge::judge;
use super::table::Values;
use algo::adaptive::{ProjectorMap, paper};
use algo::pattern::{PhaseFunction, PhaseRange, Sequence, Shot};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use algo::units::AbsolutePhase;
use appliance::head::calibrated::{CalibratedHead, MeasureError, MeasuredPart};
use appliance::head::calibration::Calibration;
use appliance::recipe::teach::adaptive::{AdaptivePattern, Preliminary};
use hal::head::Head;
use sim::{Stage, Truth};
use std::sync::Arc;
use std::time::Duration;

/// A simulated head in front of one part, with the preliminary measurements of the part.
pub struct Runner {
    head: Head,
    stage: Stage,
    truth: Truth,
    calibration: Calibration,
    judged: Judged,
    learnt: Learnt,
}

/// The preliminary measurements and patterns with the noise of one seed, made when first needed.
#[derive(Default)]
struct Learnt {
    seed: u64,
    preliminary: Option<Arc<MeasuredPart>>,
    paper: Option<Arc<ProjectorMap>>,
    better: Option<Arc<AdaptivePattern>>,
    golden: Option<Arc<Vec<AbsolutePhase>>>,
}

/// A run: its measurement and how good it is.
pub struct Run {
    /// Errors against the truth.
    pub values: Values,
    /// Frames, phases and heights.
    pub measured: MeasuredPart,
    /// The pattern.
    pub function: PhaseFunction,
    /// Which of the frames shows the finest level first.
    pub finest: usize,
}

const TIMEOUT: Duration = Duration::from_secs(5);
/// Pitch of the preliminary patterns, projector pixels.
const PRELIMINARY_PITCH: f64 = paper::PROJECTOR_PITCH * paper::PRELIMINARY;

/// Noise streams: each measurement of a seed has its own, so that its result does not depend on
/// which other methods are run.
const STREAMS: u64 = 1000;
const PRELIMINARY_STREAM: u64 = 0;
const HORIZONTAL_STREAM: u64 = 1;
const GOLDEN_STREAM: u64 = 2;
const CHOSEN_STREAM: u64 = 3;

fn stream(method: Method) -> u64 {
    match method {
        Method::Paper { image_pitch } => 10 + u64::from(image_pitch),
        Method::Better(sequence) => 30 + sequence.frames as u64,
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
        let calibration =
            Calibration::of_scenario(stage.scenario()).map_err(MeasureError::impossible)?;
        Ok(Self {
            head,
            truth: stage.truth(),
            stage,
            calibration,
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
        let (function, map) = self.pattern(method)?;
        let shots = method.shots(&function).map_err(MeasureError::impossible)?;
        let mut measured = self.measure(stream(method), &function, &shots, map.as_deref())?;
        if map.is_none() {
            reject_too_fine(&mut measured.phases);
        }
        Ok(Run {
            values: judge(&self.truth, &measured, self.judged),
            measured,
            function,
            finest: finest(&shots),
        })
    }

    /// Measures the pattern of a method with a sequence of the caller's choice and the noise of
    /// `seed`. `shots` returns what each frame shows, for the range of the phase function. The
    /// second result is the map that the phase was unwrapped about.
    ///
    /// # Errors
    /// If the head or the pattern fails.
    pub fn measure_with(
        &mut self,
        method: Method,
        shots: impl Fn(PhaseRange) -> Vec<Shot>,
        seed: u64,
    ) -> Result<(MeasuredPart, Option<Vec<AbsolutePhase>>), MeasureError> {
        self.learn_with(seed);
        let (function, map) = self.pattern(method)?;
        let shots = shots(function.range());
        let measured = self.measure(CHOSEN_STREAM, &function, &shots, map.as_deref())?;
        Ok((measured, map))
    }

    /// The pattern of a method, and the map that its phase is unwrapped about if it is not absolute
    /// by itself.
    fn pattern(
        &mut self,
        method: Method,
    ) -> Result<(PhaseFunction, Option<Vec<AbsolutePhase>>), MeasureError> {
        Ok(match method {
            Method::Fixed { fringes } => (self.vertical(f64::from(fringes))?, None),
            Method::Paper { image_pitch } => {
                let ((columns, rows), map) = (self.size(), self.paper_map()?);
                let function = paper::adapt(&map, columns, rows, f64::from(image_pitch));
                (function.map_err(MeasureError::impossible)?, None)
            }
            Method::Better(sequence) => {
                let better = self.better()?;
                let map = match sequence.needs_golden() {
                    true => self.golden()?.to_vec(),
                    false => better.expected.clone(),
                };
                (better.function.clone(), Some(map))
            }
        })
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
    ) -> Result<MeasuredPart, MeasureError> {
        self.stage.reseed(self.learnt.seed * STREAMS + noise_stream);
        let mut head = CalibratedHead::new(&mut self.head, &self.calibration, TIMEOUT);
        head.measure(function, shots, map, &|_| ())
    }

    fn vertical(&self, fringes: f64) -> Result<PhaseFunction, MeasureError> {
        let (columns, rows) = self.size();
        PhaseFunction::vertical(columns, rows, fringes).map_err(MeasureError::impossible)
    }

    /// The preliminary measurement of both adaptive methods: one vertical sequence at 20 px pitch.
    fn preliminary(&mut self) -> Result<Arc<MeasuredPart>, MeasureError> {
        if let Some(known) = &self.learnt.preliminary {
            return Ok(Arc::clone(known));
        }
        let first = self.first()?;
        let measured = self.measure(PRELIMINARY_STREAM, &first.function, &first.shots, None)?;
        let found = Arc::new(measured);
        Ok(Arc::clone(self.learnt.preliminary.insert(found)))
    }

    fn first(&self) -> Result<Preliminary, MeasureError> {
        Preliminary::new(self.size()).map_err(MeasureError::impossible)
    }

    /// The paper's preliminary maps: vertical and horizontal at 20 px, each measured by itself.
    fn paper_map(&mut self) -> Result<Arc<ProjectorMap>, MeasureError> {
        if let Some(known) = &self.learnt.paper {
            return Ok(Arc::clone(known));
        }
        let vertical = self.preliminary()?;
        let (columns, rows) = self.size();
        let fringes = rows as f64 / PRELIMINARY_PITCH;
        let function =
            PhaseFunction::horizontal(columns, rows, fringes).map_err(MeasureError::impossible)?;
        let shots = Sequence::geometric(function.range(), 3, 4);
        let horizontal = self.measure(HORIZONTAL_STREAM, &function, &shots, None)?;
        let phases = [&vertical.phases.phase[..], &horizontal.phases.phase];
        let width = horizontal.phases.width;
        let map = ProjectorMap::from_phases(phases, [PRELIMINARY_PITCH; 2], width);
        Ok(Arc::clone(self.learnt.paper.insert(Arc::new(map))))
    }

    /// The better pattern, made as teaching makes it.
    fn better(&mut self) -> Result<Arc<AdaptivePattern>, MeasureError> {
        if let Some(known) = &self.learnt.better {
            return Ok(Arc::clone(known));
        }
        let preliminary = self.preliminary()?;
        let made = self
            .first()?
            .adapt(&preliminary, &self.calibration, &|_| ());
        let found = Arc::new(made.map_err(MeasureError::impossible)?);
        Ok(Arc::clone(self.learnt.better.insert(found)))
    }

    /// The golden map: the full sequence of the better pattern.
    fn golden(&mut self) -> Result<Arc<Vec<AbsolutePhase>>, MeasureError> {
        if let Some(known) = &self.learnt.golden {
            return Ok(Arc::clone(known));
        }
        let better = self.better()?;
        let map = Some(&better.expected[..]);
        let shots = BetterSequence::TWELVE
            .shots()
            .map_err(MeasureError::impossible)?;
        let measured = self.measure(GOLDEN_STREAM, &better.function, &shots, map)?;
        let found = Arc::new(measured.phases.phase);
        Ok(Arc::clone(self.learnt.golden.insert(found)))
    }
}

/// Smallest image pitch along u that the paper's chain resolves, camera pixels.
const RESOLVED_PITCH: f64 = 2.5;

/// The criterion of the paper's chain: rejects the pixels whose image pitch along u, by central
/// differences of Φ, is below [`RESOLVED_PITCH`].
fn reject_too_fine(phases: &mut PhaseMap) {
    let (phase, width) = (&phases.phase, phases.width);
    for (at, trust) in phases.trust.iter_mut().enumerate() {
        let inside = at % width > 0 && at % width + 1 < width;
        if *trust == Trust::Resolved
            && inside
            && phase[at - 1].is_known()
            && phase[at + 1].is_known()
            && (phase[at + 1] - phase[at - 1]).turns().abs() / 2.0 > 1.0 / RESOLVED_PITCH
        {
            *trust = Trust::LowModulation;
        }
    }
}
