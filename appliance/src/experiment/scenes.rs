//! Parts and optics of the experiments.

use hal::sim::parts::{Cone, Flowerpot, Sawtooth, Sphere, Spline, Tube};
use hal::sim::scenario::Optics;
use hal::sim::{Part, Placement, Scenario};

/// A part of the paper's experiments, placed.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name on the command line.
    pub name: &'static str,
    /// The paper's figure.
    pub figure: &'static str,
    /// The part.
    pub part: Part,
    /// Where it lies.
    pub placement: Placement,
}

/// Names of all parts.
pub const PARTS: [&str; 7] = [
    "cone",
    "sawtooth",
    "sphere",
    "spline",
    "cone-tilted",
    "flowerpot",
    "tube",
];

impl Scene {
    /// The part of a name.
    pub fn named(name: &str) -> Option<Self> {
        let tilted = Placement {
            tilt_deg: [0.0, 7.0],
            ..Placement::default()
        };
        let level = Placement::default();
        let (name, figure, part, placement) = match name {
            "cone" => ("cone", "Fig. 12", Part::Cone(Cone::default()), level),
            "sawtooth" => (
                "sawtooth",
                "Fig. 13",
                Part::Sawtooth(Sawtooth::default()),
                level,
            ),
            "sphere" => ("sphere", "Fig. 14", Part::Sphere(Sphere::default()), level),
            "spline" => (
                "spline",
                "Fig. 15",
                Part::Spline(Box::<Spline>::default()),
                level,
            ),
            "cone-tilted" => (
                "cone-tilted",
                "Fig. 15",
                Part::Cone(Cone::default()),
                tilted,
            ),
            "flowerpot" => (
                "flowerpot",
                "Fig. 16",
                Part::Flowerpot(Flowerpot::default()),
                level,
            ),
            "tube" => ("tube", "Fig. 17", Part::Tube(Tube::default()), level),
            _ => return None,
        };
        Some(Self {
            name,
            figure,
            part,
            placement,
        })
    }

    /// The study's scenario with this part.
    pub fn scenario(&self, optics: OpticsKind, seed: u64) -> Scenario {
        let mut scenario = Scenario {
            part: self.part.clone(),
            placement: self.placement,
            optics: optics.blur(),
            ..Scenario::default()
        };
        scenario.noise.seed = seed;
        scenario
    }
}

/// How sharp projector and camera are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum OpticsKind {
    /// No blur but the pixels' own.
    Ideal,
    /// Projector blur σ 1.0 px, camera blur σ 0.5 px.
    Real,
    /// Projector blur σ 1.6 px.
    Defocused,
}

impl OpticsKind {
    /// For tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Real => "real",
            Self::Defocused => "defocused",
        }
    }

    /// The simulator's blur.
    pub fn blur(self) -> Optics {
        let (projector_blur_px, camera_blur_px) = match self {
            Self::Ideal => (0.0, 0.0),
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
