//! Parts and optics of the experiments, and what each part is judged by.

use super::methods::Method;
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
