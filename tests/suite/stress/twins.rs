//! A rig for the program and for the textbook: every height of the program is checked with the
//! textbook.

use super::random::between;
use super::rig::{self, PROJECTOR};
use algo::geometry::{HeightRange, Pinhole, PinholeModel, Solution, Triangulator};
use algo::units::AbsolutePhase;
use hal::model::DeviceModel;
use hal::replay::recording::PatternSpec;
use tests::oracle::{Device, Pattern};
use tests::random::Random;

pub const FRINGES: f64 = 60.0;
pub const FRAME: (usize, usize) = (65, 65);
/// A smaller change over the default working range, ± 0.2 × the camera's height, is noise: one
/// level of 4 frames has 7.4e-3 turn (docs/measurement.md, *Noise*).
const LEAST_TURNS: f64 = 0.01;
/// Half a unit of Q16.16.
pub const UNIT: f64 = 0.5 / 65_536.0;
/// The root finder stops within 1e-7 mm.
const HEIGHT_MM: f64 = 2.5e-7;

/// A rig for the program and for the textbook.
pub struct Twins {
    pub solver: Triangulator,
    camera: Device,
    projector: Device,
    pattern: Pattern,
}

fn device(model: &PinholeModel) -> Device {
    Device::new(&DeviceModel {
        fx: model.fx,
        fy: model.fy,
        cx: model.cx,
        cy: model.cy,
        distortion: model.distortion,
        rotation: model.rotation,
        translation_mm: model.translation,
    })
}

impl Twins {
    pub fn new(
        camera: &PinholeModel,
        projector: &PinholeModel,
        range: HeightRange,
    ) -> Result<Self, String> {
        let (columns, rows) = PROJECTOR;
        let check = |model: &PinholeModel, (width, height)| {
            Pinhole::new(*model, width, height).map_err(|error| error.to_string())
        };
        let fringes = PatternSpec::Vertical { fringes: FRINGES };
        let joined = rig::join(
            check(camera, FRAME)?,
            check(projector, PROJECTOR)?,
            FRINGES,
            Some(range),
        );
        Ok(Self {
            solver: joined.map_err(|error| error.to_string())?,
            camera: device(camera),
            projector: device(projector),
            pattern: Pattern::new(fringes, columns as u32, rows as u32),
        })
    }

    /// The textbook's phase of pixel (u, v) at height z.
    pub fn phase(&self, u: f64, v: f64, z: f64) -> f64 {
        let point = self.camera.point_at(u, v, z);
        let (xi, eta) = self.projector.project(point);
        self.pattern.at(xi, eta)
    }

    /// Solves for the height of a pixel with this phase, and checks it.
    pub fn solve(&self, u: f64, v: f64, phase: f64) -> Option<Solution> {
        let solution = self.solver.solve(u, v, phase)?;
        self.check(u, v, phase, &solution);
        Some(solution)
    }

    fn check(&self, u: f64, v: f64, phase: f64, solution: &Solution) {
        let Solution { point, slope } = *solution;
        let place = format!("({u}, {v}) of phase {phase}: {solution:?}");
        let HeightRange { low, high } = self.solver.range();
        assert!(point.length().is_finite() && slope.is_finite(), "{place}");
        assert!(
            point.z >= low - HEIGHT_MM && point.z <= high + HEIGHT_MM,
            "{place}"
        );
        let off = (self.phase(u, v, point.z) - phase).abs();
        assert!(
            off <= slope.abs() * HEIGHT_MM + 1e-9,
            "{place} is lit with {off} more"
        );
        let told = slope.abs() * 0.4 * self.camera.centre()[2];
        assert!(told >= LEAST_TURNS, "{place} is noise");
    }

    /// Solves for surfaces at heights over the whole range and returns how many had a height, which
    /// must be the right one within half a unit of the phase.
    pub fn recovered(&self, random: &mut Random, (u, v): (f64, f64)) -> usize {
        let HeightRange { low, high } = self.solver.range();
        let mut found = 0;
        for _ in 0..8 {
            let z = between(random, low, high);
            let phase = self.phase(u, v, z);
            if !AbsolutePhase::from_turns(phase).is_known() {
                continue;
            }
            for phase in [phase, AbsolutePhase::from_turns(phase).turns()] {
                if let Some(solution) = self.solve(u, v, phase) {
                    // The slope may change by half within half a unit of the phase.
                    let bound = 2.0 * UNIT / solution.slope.abs() + HEIGHT_MM;
                    let error = (solution.point.z - z).abs();
                    assert!(error <= bound, "({u}, {v}) at {z}: off by {error} mm");
                    found += 1;
                }
            }
        }
        found
    }
}
