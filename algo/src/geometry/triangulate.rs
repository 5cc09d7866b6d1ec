//! Triangulation by the reference phase map (Peng & Gupta 2008, eqs. 10–11).
//!
//! The light ray from the projector through the point X(z), at height z on pixel (u, v)'s ray,
//! meets the reference plane at R(z), which the camera would see at the pixel π(R(z)). So z solves
//! Φ_R(π(R(z))) = Φ(u, v) in the working range, for any pattern and any distortion of either lens.
//! With a reference map computed from the models, Φ_R(π(R(z))) is Φ_P at the projector pixel that
//! lights X(z); with a measured one, at that pixel corrected by what the plane was off the models
//! at π(R(z)).
//!
//! Units: mm and turns. Accuracy: z within 2.5e-7 mm of the textbook for the same phase
//! (`heights_beyond_the_raster_and_about_the_ends_of_the_range_are_the_textbooks`).

use super::{Pinhole, Reference, Vector};
use crate::math::bracketed;
use crate::pattern::PhaseFunction;
use crate::units::{AbsolutePhase, Height};

/// The working range of z in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightRange {
    /// Lowest z.
    pub low: f64,
    /// Highest z.
    pub high: f64,
}

/// A rig (camera, projector and working range) that cannot triangulate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// A device is not above the reference plane or does not look down at it.
    #[error(
        "the {0} is not above the plane z = 0 looking down at it: +z points towards the \
         head and X_device = R·X_world + t"
    )]
    NotAbove(&'static str),
    /// Camera and projector stand in the same place.
    #[error("camera and projector have the same centre: without a baseline there is no height")]
    NoBaseline,
    /// The working range is empty or not finite, reaches up to a device, or lies wholly beyond ±
    /// 2147 mm.
    #[error(
        "the working range {} to {} mm is empty or not finite, reaches up to a device, or lies beyond ±2147 mm",
        .0.low, .0.high
    )]
    Range(HeightRange),
}

/// Turns phase into height for one rig and one phase function.
#[derive(Clone, Debug)]
pub struct Triangulator {
    camera: Pinhole,
    pub(super) projector: Pinhole,
    pub(super) reference: Reference,
    pub(super) function: PhaseFunction,
    range: HeightRange,
    /// The least |∂Φ/∂z| from which a height is computed, turns per mm.
    slope_min: f64,
}

/// A pixel's solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The point of the surface; its z is the height, in mm.
    pub point: Vector,
    /// ∂Φ/∂z along the pixel's ray, turns per mm.
    pub slope: f64,
}

/// The height as a quadratic in the phase about one phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// z in mm.
    pub height: f64,
    /// ∂z/∂Φ in mm per turn.
    pub first: f64,
    /// ∂²z/∂Φ² in mm per turn².
    pub second: f64,
}

/// Tolerance of z, mm.
const HEIGHT_TOLERANCE: f64 = 1e-7;
/// After a secant step of at most this many mm, the height is less than 1e-6 mm off.
const NEAR_TOLERANCE: f64 = 1e-4;
/// A secant step longer than this many mm has left the neighbourhood of the guess.
const MAX_SECANT_STEP: f64 = 2.0;
/// The numeric slope is taken over ± this many mm: small against any fringe, large against
/// rounding. The first secant starts this far below the guess.
const SLOPE_STEP: f64 = 0.01;
/// Pieces of the working range in which a sampled phase function is searched for a change of sign: it
/// need not be monotone along the line of projector pixels that a camera ray crosses.
const PIECES: usize = 16;
/// Largest z component of a usable ray whose component along the optical axis is 1: from a height
/// of 1 m, other rays meet the plane a thousand kilometres away or nowhere.
const FALL: f64 = -1e-6;
/// Where the phase changes by less than this over ± 0.2 × the camera's height, the height is only
/// noise: the phase of one level of 4 frames has σ = 7.4e-3 turn. That happens on rays along the
/// baseline, and everywhere if the fringes run along the baseline.
const LEAST_TURNS: f64 = 0.01;
/// Heights are stored within ± this many mm.
const HEIGHT_REACH: f64 = i32::MAX as f64 / 1e6;
/// Half the default working range, as a share of the camera's distance from the plane along its
/// axis.
const RANGE_SHARE: f64 = 0.2;

impl HeightRange {
    /// The default working range of a rig: ± 0.2 × the camera's distance from the reference plane
    /// along its axis, the upper end at most 0.9 × the lower device's z.
    pub fn of(camera: &Pinhole, projector: &Pinhole) -> Self {
        let (eye, lamp) = (camera.centre(), projector.centre());
        let reach = RANGE_SHARE * eye.z / -camera.axis().z;
        Self {
            low: -reach,
            high: reach.min(0.9 * eye.z.min(lamp.z)),
        }
    }
}

impl Triangulator {
    /// Joins the rig, the reference and the phase function. The default range is
    /// [`HeightRange::of`]. Any range is cut to the heights that can be stored, ± 2147 mm, without
    /// an error.
    ///
    /// # Errors
    /// If the devices do not look down at the plane from two different places, or the range is
    /// unusable.
    pub fn new(
        camera: Pinhole,
        projector: Pinhole,
        reference: Reference,
        function: PhaseFunction,
        range: Option<HeightRange>,
    ) -> Result<Self, RigError> {
        for (name, device) in [("camera", &camera), ("projector", &projector)] {
            if !(device.centre().z > 0.0 && device.axis().z < 0.0) {
                return Err(RigError::NotAbove(name));
            }
        }
        let (eye, lamp) = (camera.centre(), projector.centre());
        if !((eye - lamp).length() > 1e-3) {
            return Err(RigError::NoBaseline);
        }
        let range = range.unwrap_or_else(|| HeightRange::of(&camera, &projector));
        let stored = HeightRange {
            low: range.low.max(-HEIGHT_REACH),
            high: range.high.min(HEIGHT_REACH),
        };
        let usable = range.low.is_finite() && range.high.is_finite() && stored.low < stored.high;
        if !(usable && range.high < eye.z.min(lamp.z)) {
            return Err(RigError::Range(range));
        }
        let slope_min = LEAST_TURNS / (2.0 * RANGE_SHARE * eye.z);
        Ok(Self {
            camera,
            projector,
            reference,
            function,
            range: stored,
            slope_min,
        })
    }

    /// The same geometry with the same camera, which may know the rays of its pixels or not.
    #[must_use]
    pub fn seen_by(self, camera: Pinhole) -> Self {
        Self { camera, ..self }
    }

    /// The working range.
    pub fn range(&self) -> HeightRange {
        self.range
    }

    /// Φ_P.
    pub fn function(&self) -> &PhaseFunction {
        &self.function
    }

    /// The camera.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// The projector.
    pub fn projector(&self) -> &Pinhole {
        &self.projector
    }

    /// The ray of pixel (u, v), if it meets every height once.
    #[inline]
    pub(super) fn falling_ray(&self, u: f64, v: f64) -> Option<Vector> {
        self.camera.ray(u, v).filter(|ray| ray.z < FALL)
    }

    /// The point at height `z` on a ray from the camera.
    #[inline]
    pub(super) fn on_ray(&self, ray: Vector, z: f64) -> Vector {
        let eye = self.camera.centre();
        eye + ray * ((z - eye.z) / ray.z)
    }

    /// The projector point (ξ, η), in pixels of its raster, that lights a point of space.
    #[inline]
    pub fn projector_point(&self, point: Vector) -> Option<(f64, f64)> {
        match &self.reference {
            Reference::Models => self.projector.project(point),
            Reference::Measured { xi, eta } => {
                let lamp = self.projector.centre();
                let down = point - lamp;
                let on_plane = lamp + down * (-lamp.z / down.z);
                let (u, v) = self.camera.project(on_plane)?;
                let by_models = self.projector.project(on_plane)?;
                Some((by_models.0 + xi.at(u, v), by_models.1 + eta.at(u, v)))
            }
        }
    }

    /// Φ_P in turns at the projector point that lights `point`.
    #[inline]
    pub(crate) fn phase_at(&self, point: Vector) -> Option<f64> {
        let (xi, eta) = self.projector_point(point)?;
        Some(self.function.at(xi, eta))
    }

    /// Φ_R(u, v) in turns: the phase of the reference plane, also outside the frame.
    pub fn reference_phase(&self, u: f64, v: f64) -> Option<f64> {
        let ray = self.falling_ray(u, v)?;
        let phase = self.phase_at(self.on_ray(ray, 0.0))?;
        phase.is_finite().then_some(phase)
    }

    /// One row of the reference phase map, [`AbsolutePhase::UNKNOWN`] where a pixel does not look
    /// at the plane.
    pub fn reference_row(&self, v: usize, out: &mut [AbsolutePhase]) {
        for (u, phase) in out.iter_mut().enumerate() {
            *phase = self
                .reference_phase(u as f64, v as f64)
                .map_or(AbsolutePhase::UNKNOWN, AbsolutePhase::from_turns);
        }
    }

    /// The largest |Φ − Φ_R| of pixel (u, v) in turns over the working range, and z in mm of the
    /// end of the range that has it.
    pub fn phase_reach(&self, u: f64, v: f64) -> Option<(f64, f64)> {
        let (ray, reference) = (self.falling_ray(u, v)?, self.reference_phase(u, v)?);
        let ends = [self.range.low, self.range.high].into_iter();
        let apart = ends.filter_map(|z| {
            let phase = self.phase_at(self.on_ray(ray, z))?;
            Some((libm::fabs(phase - reference), z))
        });
        apart.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The surface point that pixel (u, v) sees if its phase is `phase` (turns), or `None` where no
    /// height in the working range has that phase, several have, or the phase hardly depends on the
    /// height. Several are noticed only where they lie in different sixteenths of the range, and
    /// only for a sampled phase function.
    pub fn solve(&self, u: f64, v: f64, phase: f64) -> Option<Solution> {
        let ray = self.falling_ray(u, v)?;
        let off = |z: f64| Some(self.phase_at(self.on_ray(ray, z))? - phase);
        let pieces = match self.function.is_sampled() {
            true => PIECES,
            false => 1,
        };
        let HeightRange { low, high } = self.range;
        let mut bracket = None;
        let mut before = (low, off(low)?);
        for piece in 1..=pieces {
            let z = low + (high - low) * piece as f64 / pieces as f64;
            let next = (z, off(z)?);
            if (before.1 < 0.0) != (next.1 < 0.0) {
                if bracket.is_some() {
                    return None;
                }
                bracket = Some((before, next));
            }
            before = next;
        }
        let (a, b) = bracket?;
        let z = bracketed(off, a, b, HEIGHT_TOLERANCE)?;
        self.solution(ray, z)
    }

    /// As [`Self::solve`], starting from a height that is nearly right: about 5 evaluations of the
    /// phase instead of 10, or 25 for a sampled function. Where several heights have the phase, the
    /// one near the guess, unless the secant method does not converge: then the answer is that of
    /// [`Self::solve`].
    pub fn solve_near(&self, u: f64, v: f64, phase: f64, guess: f64) -> Option<Solution> {
        let ray = self.falling_ray(u, v)?;
        let off = |z: f64| Some(self.phase_at(self.on_ray(ray, z))? - phase);
        // The secant from a guess that is off by micrometres converges at the first or second step;
        // where it does not converge, `solve` decides.
        let (mut before, mut z) = (guess - SLOPE_STEP, guess);
        let mut missed = off(before).unwrap_or(f64::NAN);
        for _ in 0..4 {
            let miss = off(z).unwrap_or(f64::NAN);
            let slope = (miss - missed) / (z - before);
            let step = miss / slope;
            if !(libm::fabs(step) <= MAX_SECANT_STEP) {
                break;
            }
            (before, missed) = (z, miss);
            z -= step;
            if libm::fabs(step) <= NEAR_TOLERANCE {
                let inside = z >= self.range.low && z <= self.range.high;
                return inside.then(|| self.solution(ray, z)).flatten();
            }
        }
        self.solve(u, v, phase)
    }

    fn solution(&self, ray: Vector, z: f64) -> Option<Solution> {
        let phase = |z: f64| self.phase_at(self.on_ray(ray, z));
        let rise = phase(z + SLOPE_STEP)? - phase(z - SLOPE_STEP)?;
        let slope = rise / (2.0 * SLOPE_STEP);
        (libm::fabs(slope) >= self.slope_min).then(|| Solution {
            point: self.on_ray(ray, z),
            slope,
        })
    }

    /// The expansion z(Φ + δ) ≈ z + z′δ + z″δ²/2 of the height about a phase at pixel (u, v), in mm
    /// per turn and turn²; the second derivative by central differences of ± ¼ turn, 0 where there
    /// is no height for one of these two phases. `near` is about the height of the phase, as in
    /// [`Self::solve_near`].
    pub fn expand(&self, u: f64, v: f64, phase: f64, near: f64) -> Option<Expansion> {
        const STEP: f64 = 0.25;
        let Solution { point, slope } = self.solve_near(u, v, phase, near)?;
        let z = point.z;
        let beside = |delta| {
            let solution = self.solve_near(u, v, phase + delta, z + delta / slope)?;
            Some(solution.point.z)
        };
        let second = match (beside(-STEP), beside(STEP)) {
            (Some(below), Some(above)) => (above - 2.0 * z + below) / (STEP * STEP),
            _ => 0.0,
        };
        Some(Expansion {
            height: z,
            first: 1.0 / slope,
            second,
        })
    }

    /// The point at height `height` that pixel (u, v) looks at.
    pub fn point(&self, u: usize, v: usize, height: Height) -> Option<Vector> {
        let ray = self.falling_ray(u as f64, v as f64)?;
        height.is_known().then(|| self.on_ray(ray, height.mm()))
    }

    /// The point `rise` mm higher than another one on the same ray of the camera.
    pub fn higher(&self, point: Vector, rise: f64) -> Vector {
        let from = point - self.camera.centre();
        point + from * (rise / from.z)
    }
}

/// The line of sight of one pixel, prepared once for any number of heights: its point at height z
/// is start + z · rise.
///
/// With a reference from the device models, start and rise are in the projector's coordinates, from
/// its centre: a point's projector pixel then needs the lens model only. Else they are in the
/// world's coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    triangulator: &'a Triangulator,
    start: Vector,
    rise: Vector,
}

impl Triangulator {
    /// The point at height 0 that pixel (u, v) sees, and how far its line of sight takes a point
    /// that rises by 1 mm; `None` if it does not meet every height once.
    pub fn line(&self, u: f64, v: f64) -> Option<(Vector, Vector)> {
        let ray = self.falling_ray(u, v)?;
        Some((self.on_ray(ray, 0.0), ray * (1.0 / ray.z)))
    }

    /// The line of sight of pixel (u, v), or `None` if it does not meet every height once.
    pub fn sight(&self, u: f64, v: f64) -> Option<Sight<'_>> {
        self.line(u, v).map(|line| self.sight_along(line))
    }

    /// The same along a [`Self::line`].
    pub fn sight_along(&self, (on_plane, rise): (Vector, Vector)) -> Sight<'_> {
        let (start, rise) = match &self.reference {
            Reference::Models => {
                let lamp = &self.projector;
                let start = lamp.turned(on_plane - lamp.centre());
                (start, lamp.turned(rise))
            }
            Reference::Measured { .. } => (on_plane, rise),
        };
        Sight {
            triangulator: self,
            start,
            rise,
        }
    }
}

impl Sight<'_> {
    /// Φ in turns of a surface at height `z` mm; `None` if the projector does not light it.
    #[inline]
    pub fn phase(&self, z: f64) -> Option<f64> {
        let point = self.start + self.rise * z;
        let triangulator = self.triangulator;
        let (xi, eta) = match triangulator.reference {
            Reference::Models => triangulator.projector.pixel(point),
            Reference::Measured { .. } => triangulator.projector_point(point),
        }?;
        Some(triangulator.function.at(xi, eta))
    }
}
