//! What is compared: the parts, how sharp they are seen, and the methods with the frames of each.

use crate::adapt::split;
use algo::pattern::{PhaseFunction, Shot, Waveform, Waveforms};
use sim::parts::{Cone, Face, Flowerpot, Handset, Sawtooth, Sphere, Spline, Tube};
use sim::scenario::{Noise, Optics};
use sim::{Part, Placement, Scenario};

/// A part of the paper's experiments, placed.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name on the command line.
    pub name: &'static str,
    /// The paper's figure.
    pub figure: &'static str,
    /// The quantity that its measurement is judged by.
    pub judged: Judged,
    /// The part.
    pub part: Part,
    /// Where it lies.
    pub placement: Placement,
    /// Columns and rows of the camera: 512 as in the study; a smaller one sees the middle of the
    /// same picture, with pixels of the same size.
    pub camera: u32,
    /// Bits of the camera: 8 in the study.
    pub bit_depth: u8,
    /// Largest noise of a sample, counts: the paper's in the study.
    pub noise_counts: f64,
}

/// The quantity that a part's figure shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// RMS error over unresolved pixels.
    Error,
    /// Share of resolved pixels over the number of fringes.
    Coverage,
    /// Residual of a cylinder fitted to the point cloud over the number of fringes, also defocused.
    CylinderFit,
}

/// Names of all parts.
pub const PARTS: [&str; 9] = [
    "cone",
    "sawtooth",
    "sphere",
    "spline",
    "cone-tilted",
    "flowerpot",
    "tube",
    "face",
    "handset",
];

/// Columns and rows of the study's camera.
const CAMERA: u32 = 512;
/// Bits of the study's camera.
const BIT_DEPTH: u8 = 8;
/// The paper's tilt about y, degrees.
const TILT: f64 = 7.0;

impl Scene {
    /// The part with this name.
    pub fn named(name: &str) -> Option<Self> {
        let name = *PARTS.iter().find(|known| **known == name)?;
        let (figure, part) = match name {
            "cone" => ("Fig. 12", Part::Cone(Cone::default())),
            "sawtooth" => ("Fig. 13", Part::Sawtooth(Sawtooth::default())),
            "sphere" => ("Fig. 14", Part::Sphere(Sphere::default())),
            "spline" => ("Fig. 15", Part::Spline(Box::<Spline>::default())),
            "cone-tilted" => ("Fig. 12, tilted by 7°", Part::Cone(Cone::default())),
            "flowerpot" => ("Fig. 16", Part::Flowerpot(Flowerpot::default())),
            "face" => ("Fig. 18", Part::Face(Face::default())),
            "handset" => ("Fig. 19", Part::Handset(Handset::default())),
            _ => ("Fig. 17", Part::Tube(Tube::default())),
        };
        let judged = match name {
            "flowerpot" => Judged::Coverage,
            "tube" => Judged::CylinderFit,
            _ => Judged::Error,
        };
        let mut placement = Placement::default();
        if name == "cone-tilted" {
            placement.tilt_deg = [0.0, TILT];
        }
        Some(Self {
            name,
            figure,
            judged,
            part,
            placement,
            camera: CAMERA,
            bit_depth: BIT_DEPTH,
            noise_counts: Noise::PAPER,
        })
    }

    /// The methods that its figure compares; with `sines` the better sequences show sines.
    pub fn methods(&self, sines: bool) -> Vec<Method> {
        match self.judged {
            Judged::Error => Method::table(&[49, 64, 81, 100, 121], sines),
            Judged::Coverage | Judged::CylinderFit => {
                Method::table(&[32, 49, 64, 81, 100, 121, 144], sines)
            }
        }
    }

    /// The optics that its figure shows when `asked` are asked for.
    pub fn optics(&self, asked: OpticsKind) -> Vec<OpticsKind> {
        let mut kinds = vec![asked];
        if self.judged == Judged::CylinderFit && asked != OpticsKind::Defocused {
            kinds.push(OpticsKind::Defocused);
        }
        kinds
    }

    /// The study's scenario with this part, with the paper's uniform noise.
    pub fn scenario(&self, optics: OpticsKind, seed: u64) -> Scenario {
        let mut scenario = Scenario {
            part: self.part.clone(),
            placement: self.placement,
            optics: optics.blur(),
            bit_depth: self.bit_depth,
            ..Scenario::default()
        };
        let camera = &mut scenario.rig.camera;
        let share = f64::from(self.camera) / f64::from(camera.width);
        for fov in &mut camera.fov_deg {
            let half = (fov.to_radians() / 2.0).tan() * share;
            *fov = 2.0 * half.atan().to_degrees();
        }
        (camera.width, camera.height) = (self.camera, self.camera);
        (scenario.noise.noise_counts, scenario.noise.seed) = (Some(self.noise_counts), seed);
        scenario
    }
}

/// How sharp projector and camera are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum OpticsKind {
    /// Projector blur σ 0.5 px.
    Sharp,
    /// Projector blur σ 1.0 px, camera blur σ 0.5 px.
    Real,
    /// Projector blur σ 1.6 px.
    Defocused,
}

impl OpticsKind {
    /// For tables and file names.
    pub fn word(self) -> &'static str {
        match self {
            Self::Sharp => "sharp",
            Self::Real => "real",
            Self::Defocused => "defocused",
        }
    }

    /// The simulator's blur.
    pub fn blur(self) -> Optics {
        let (projector_blur_px, camera_blur_px) = match self {
            Self::Sharp => (0.5, 0.0),
            Self::Real => (1.0, 0.5),
            Self::Defocused => (1.6, 0.0),
        };
        Optics {
            projector_blur_px,
            camera_blur_px,
            ..Optics::default()
        }
    }
}

/// A way to measure a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Fixed pitch, three geometric levels of four shifts.
    Fixed {
        /// Fringes over the projector's width.
        fringes: u32,
    },
    /// The paper's adaptive pattern, three geometric levels of four shifts.
    Paper {
        /// p_I in camera pixels.
        image_pitch: u32,
    },
    /// The better pattern.
    Better(BetterSequence),
}

/// A sequence of the better method: as many levels and shifts as [`split`] divides the frames
/// among.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BetterSequence {
    /// Number of frames: 3 to 27.
    pub frames: usize,
    /// Whether all levels show sines instead of the brightest waveforms.
    pub sines: bool,
}

/// There is no better sequence of this number of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{frames} frames make no sequence")]
pub struct NoSequence {
    /// How many.
    pub frames: usize,
}

/// The fixed and the adaptive pattern that pictures show.
pub const SHOWN: [Method; 2] = [
    Method::Fixed { fringes: 100 },
    Method::Better(BetterSequence::TWELVE),
];
/// The run that ratios refer to: the paper's adaptive pattern with its own image pitch.
pub const PAPER: Method = Method::Paper { image_pitch: 5 };

impl Method {
    /// The methods of a figure with these fixed patterns; the paper's pattern is among them. With
    /// `sines` the better sequences show sines.
    pub fn table(fringes: &[u32], sines: bool) -> Vec<Self> {
        let fixed = fringes.iter().map(|&fringes| Self::Fixed { fringes });
        let papers = [PAPER, Self::Paper { image_pitch: 4 }];
        let better = BetterSequence::all(sines).map(Self::Better);
        fixed.chain(papers).chain(better).collect()
    }

    /// The method's name in tables: `fixed-49`, `paper-5`, `better-12`.
    pub fn name(self) -> String {
        match self {
            Self::Fixed { fringes } => format!("fixed-{fringes}"),
            Self::Paper { image_pitch } => format!("paper-{image_pitch}"),
            Self::Better(sequence) => format!("better-{}", sequence.frames),
        }
    }

    /// Frames of a measurement by the method, without the preliminary frames that are taken once
    /// per part.
    pub fn frame_count(self) -> usize {
        match self {
            Self::Fixed { .. } | Self::Paper { .. } => 12,
            Self::Better(sequence) => sequence.frames,
        }
    }

    /// What each frame of a measurement by the method shows. Geometric levels are the paper's: 1,
    /// n, n² with n = √(max Φ_P), N = 4.
    ///
    /// # Errors
    /// As [`BetterSequence::shots`].
    pub fn shots(self, function: &PhaseFunction) -> Result<Vec<Shot>, NoSequence> {
        if let Self::Better(sequence) = self {
            return sequence.shots();
        }
        let max = function.range().max;
        let ratios = [1.0 / max, 1.0 / max.sqrt(), 1.0].into_iter();
        Ok(ratios.flat_map(|ratio| Shot::level(ratio, 4)).collect())
    }
}

impl BetterSequence {
    /// 12 frames.
    pub const TWELVE: Self = Self::new(12);

    /// The sequence of `frames` frames, with the brightest waveforms.
    pub const fn new(frames: usize) -> Self {
        let sines = false;
        Self { frames, sines }
    }

    /// All sequences that are compared with the paper's pattern.
    fn all(sines: bool) -> impl Iterator<Item = Self> {
        let counts = [24, 12, 9, 6, 5, 4, 3].into_iter();
        counts.map(move |frames| Self { frames, sines })
    }

    /// Whether the sequence is unwrapped about the golden map, not about the preliminary map.
    pub fn needs_golden(self) -> bool {
        self.frames < 9
    }

    /// What each frame shows.
    ///
    /// # Errors
    /// [`NoSequence`]
    pub fn shots(self) -> Result<Vec<Shot>, NoSequence> {
        let waveforms: Waveforms = match self.sines {
            true => Waveform::sine,
            false => Waveform::brightest,
        };
        split(self.frames, waveforms)
            .map(|split| split.shots(waveforms))
            .ok_or(NoSequence {
                frames: self.frames,
            })
    }
}

/// The first frame of the finest level.
pub fn finest(shots: &[Shot]) -> usize {
    let ratio = shots.iter().map(|shot| shot.ratio).fold(0.0, f64::max);
    let found = shots.iter().position(|shot| shot.ratio == ratio);
    found.unwrap_or(0)
}
