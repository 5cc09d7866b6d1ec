//! The methods that are compared, and one run of each.

use super::scenes::{OpticsKind, Scene};
use crate::bench::{About, Bench, BenchError, Measured};
use crate::calibration::Calibration;
use crate::measure::{Score, Truth};
use algo::adaptive::{ProjectorMap, noise, paper};
use algo::pattern::{PhaseFunction, Sequence};
use algo::phase::Trust;
use algo::units::AbsolutePhase;
use hal::head::DynHead;
use hal::sim::Stage;
use std::time::Duration;

/// A way to measure a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Fixed pitch, three geometric levels of four steps.
    Fixed {
        /// Fringes over the projector's width.
        fringes: f64,
    },
    /// The paper's adaptive pattern, three geometric levels of four steps.
    Paper {
        /// p_I in camera pixels.
        image_pitch: f64,
    },
    /// The better pattern.
    Better(Shot),
}

/// The sequences of the better method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shot {
    /// Three dense levels of four steps about the map of the preliminary measurement.
    Twelve,
    /// Three dense levels of three steps.
    Nine,
    /// Two dense levels of three steps about the golden map.
    Six,
    /// One level of four steps about the golden map.
    Four,
    /// One level of three steps about the golden map.
    Three,
}

impl Method {
    /// Every method of the tables.
    pub fn all() -> Vec<Self> {
        let fixed = [49.0, 64.0, 81.0, 100.0, 121.0].map(|fringes| Self::Fixed { fringes });
        let papers = [5.0, 4.0].map(|image_pitch| Self::Paper { image_pitch });
        let better = Shot::ALL.map(Self::Better);
        fixed.into_iter().chain(papers).chain(better).collect()
    }
}

impl Shot {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Twelve, Self::Nine, Self::Six, Self::Four, Self::Three];

    /// Ratio and shift of each frame.
    pub fn frames(self) -> Vec<(f64, f64)> {
        let n = 4.0;
        let dense = [1.0, 1.0 - 1.0 / (n * n), 1.0 - 1.0 / n];
        let (ratios, steps): (&[f64], u32) = match self {
            Self::Twelve => (&dense, 4),
            Self::Nine => (&dense, 3),
            Self::Six => (&[1.0, 0.8], 3),
            Self::Four => (&[1.0], 4),
            Self::Three => (&[1.0], 3),
        };
        ratios
            .iter()
            .flat_map(|&ratio| (0..steps).map(move |k| (ratio, f64::from(k) / f64::from(steps))))
            .collect()
    }
}

/// What a method reached on a part.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Errors against truth.
    pub score: Option<Score>,
    /// Lit pixels, and those of them that are not resolved.
    pub lit: usize,
    /// See `lit`.
    pub unresolved: usize,
    /// RMS of error / predicted σ_z over scored pixels without gross errors.
    pub sigma_ratio: f64,
}

/// A simulated head in front of one part, with what has been learnt of it.
pub struct Runner {
    head: DynHead,
    stage: Stage,
    calibration: Calibration,
    optics: OpticsKind,
}

const TIMEOUT: Duration = Duration::from_secs(5);

impl Runner {
    /// Sets the head up in front of the part.
    ///
    /// # Errors
    /// If the scene cannot be simulated.
    pub fn new(scene: &Scene, optics: OpticsKind) -> Result<Self, BenchError> {
        let scenario = scene.scenario(optics, 1);
        let (head, stage) = hal::sim::head(&scenario)?;
        let (camera, projector) = (&scenario.rig.camera, &scenario.rig.projector);
        let calibration = Calibration {
            camera: (camera.width, camera.height, scenario.bit_depth),
            camera_model: stage.camera_model(),
            projector: (projector.width, projector.height),
            projector_model: stage.projector_model(),
            noise_counts: scenario.noise_sigma_counts(),
            response: None,
        };
        Ok(Self {
            head,
            stage,
            calibration,
            optics,
        })
    }

    fn bench(&mut self) -> Bench<'_> {
        Bench {
            head: &mut self.head,
            calibration: &self.calibration,
            range: None,
            timeout: TIMEOUT,
        }
    }

    fn size(&self) -> (usize, usize) {
        (
            self.calibration.projector.0 as usize,
            self.calibration.projector.1 as usize,
        )
    }

    /// A geometric sequence as the paper has it: levels 1, n, n² with n = √(max Φ_P), N = 4.
    fn geometric(function: &PhaseFunction) -> Vec<(f64, f64)> {
        let max = function.range().max;
        [1.0 / max, 1.0 / max.sqrt(), 1.0]
            .into_iter()
            .flat_map(|ratio| (0..4).map(move |k| (ratio, f64::from(k) / 4.0)))
            .collect()
    }

    fn vertical(&self, fringes: f64) -> Result<PhaseFunction, BenchError> {
        let (columns, rows) = self.size();
        PhaseFunction::vertical(columns, rows, fringes).map_err(|e| BenchError::Rig(e.to_string()))
    }

    /// The preliminary measurement of the better method: one vertical sequence at 20 px pitch.
    fn preliminary(&mut self) -> Result<Measured, BenchError> {
        let pitch = paper::PROJECTOR_PITCH * paper::PRELIMINARY;
        let function = self.vertical(self.size().0 as f64 / pitch)?;
        let frames = Sequence::geometric(function.range(), 3, 4);
        self.bench()
            .measure(&function, &frames, About::Reference, &|_| ())
    }

    /// The paper's preliminary maps: vertical and horizontal at 20 px, each measured by itself.
    fn paper_map(&mut self) -> Result<ProjectorMap, BenchError> {
        let vertical = self.preliminary()?;
        let pitch = paper::PROJECTOR_PITCH * paper::PRELIMINARY;
        let (columns, rows) = self.size();
        let function = PhaseFunction::horizontal(columns, rows, rows as f64 / pitch)
            .map_err(|e| BenchError::Rig(e.to_string()))?;
        let frames = Sequence::geometric(function.range(), 3, 4);
        let horizontal = self
            .bench()
            .measure(&function, &frames, About::Reference, &|_| ())?;
        let points = vertical.phases.phase.iter().zip(&horizontal.phases.phase);
        Ok(ProjectorMap {
            width: vertical.phases.width,
            points: points
                .map(|(v, h)| {
                    if v.is_known() && h.is_known() {
                        [pitch * v.turns(), pitch * h.turns()]
                    } else {
                        [f64::NAN; 2]
                    }
                })
                .collect(),
        })
    }

    /// The optics that the better pattern is made for: as the scenario blurs.
    pub fn optics(&self) -> noise::Optics {
        let blur = self.optics.blur();
        noise::Optics {
            projector_blur: blur.projector_blur_px,
            camera_blur: blur.camera_blur_px,
            projector_pitch: noise::PROJECTOR_PITCH,
            image_pitch: noise::IMAGE_PITCH,
        }
    }

    /// Runs a method with the noise of `seed`.
    ///
    /// # Errors
    /// If the head or the pattern fails.
    pub fn run(&mut self, method: Method, seed: u64) -> Result<Outcome, BenchError> {
        self.stage.reseed(seed);
        let adapt = |error: algo::adaptive::AdaptError| BenchError::Rig(error.to_string());
        let (columns, rows) = self.size();
        match method {
            Method::Fixed { fringes } => {
                let function = self.vertical(fringes)?;
                self.paper_chain(&function)
            }
            Method::Paper { image_pitch } => {
                let map = self.paper_map()?;
                let function = paper::adapt(&map, columns, rows, image_pitch).map_err(adapt)?;
                self.paper_chain(&function)
            }
            Method::Better(shot) => {
                let preliminary = self.preliminary()?;
                let map =
                    ProjectorMap::from_heights(&preliminary.triangulator, &preliminary.heights);
                let function = noise::adapt(&map, columns, rows, &self.optics()).map_err(adapt)?;
                let mut known = expected(&map, &function);
                if !matches!(shot, Shot::Twelve | Shot::Nine) {
                    let golden = self.bench().measure(
                        &function,
                        &Shot::Twelve.frames(),
                        About::Map(&known),
                        &|_| (),
                    )?;
                    known = golden.phases.phase;
                }
                let measured =
                    self.bench()
                        .measure(&function, &shot.frames(), About::Map(&known), &|_| ())?;
                Ok(self.outcome(&measured))
            }
        }
    }

    /// The paper's chain with its own criterion of image pitch.
    fn paper_chain(&mut self, function: &PhaseFunction) -> Result<Outcome, BenchError> {
        let frames = Self::geometric(function);
        let mut measured = self
            .bench()
            .measure(function, &frames, About::Reference, &|_| ())?;
        let fine = too_fine(&measured.phases.phase, measured.phases.width);
        for (trust, fine) in measured.phases.trust.iter_mut().zip(fine) {
            if fine && *trust == Trust::Resolved {
                *trust = Trust::LowModulation;
            }
        }
        Ok(self.outcome(&measured))
    }

    fn outcome(&self, measured: &Measured) -> Outcome {
        let truth = self.stage.truth();
        let known = Truth {
            height: Some(&truth.height),
            class: Some(&truth.class),
        };
        let phases = &measured.phases;
        // As the study counts: over the pixels that truth calls wholly lit.
        let whole = || (0..phases.trust.len()).filter(|&at| known.whole(at));
        let lit = whole().count();
        let resolved = whole()
            .filter(|&at| phases.trust[at] == Trust::Resolved)
            .count();
        let (mut squares, mut count) = (0.0, 0.0);
        for at in 0..truth.height.len() {
            let sigma = f64::from(measured.heights.sigma[at]);
            let error = measured.heights.height[at].mm() - f64::from(truth.height[at]);
            let counts = phases.trust[at] == Trust::Resolved && known.whole(at);
            if counts && error.abs() <= 1.0 && sigma > 0.0 {
                squares += (error / sigma).powi(2);
                count += 1.0;
            }
        }
        Outcome {
            score: known.score(phases, &measured.heights),
            lit,
            unresolved: lit - resolved,
            sigma_ratio: (squares / f64::max(count, 1.0)).sqrt(),
        }
    }
}

/// The phase that each pixel will have if the surface is where it was measured.
fn expected(map: &ProjectorMap, function: &PhaseFunction) -> Vec<AbsolutePhase> {
    map.points
        .iter()
        .map(|[xi, eta]| AbsolutePhase::from_turns(function.at(*xi, *eta)))
        .collect()
}

/// Where the image pitch along u is below 2.5 px, by central differences of Φ.
fn too_fine(phase: &[AbsolutePhase], width: usize) -> Vec<bool> {
    (0..phase.len())
        .map(|at| {
            let u = at % width;
            let inside = u > 0 && u + 1 < width;
            inside && phase[at - 1].is_known() && phase[at + 1].is_known() && {
                let rise = (phase[at + 1] - phase[at - 1]).turns();
                rise.abs() / 2.0 > 1.0 / 2.5
            }
        })
        .collect()
}
