//! Triangulation: the height of the point on a pixel's ray that is lit with the measured phase.

use super::Pattern;
use super::device::{Device, on_ray};
use hal::replay::Recording;

/// Camera, projector and working range of a recording.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The camera.
    pub camera: Device,
    /// The projector.
    pub projector: Device,
    /// Lowest and highest z, mm.
    pub range: (f64, f64),
}

/// Pieces of the working range in which a sampled phase function is searched for a change of sign;
/// a change in more than one of them leaves the pixel unresolved. Part of the definition.
const PIECES: usize = 16;
/// Halvings of the bracket: 500 mm · 2⁻⁶⁰ is less than any rounding error.
const HALVINGS: usize = 60;
/// If the phase changes by less than this over ± 0.2 × the camera's height, it does not determine a
/// height: one level of 4 frames has 7.4e-3 turn of noise. Part of the definition.
const LEAST_TURNS: f64 = 0.01;
/// Half the distance over which the slope ∂Φ/∂z is computed, mm.
const SLOPE_MM: f64 = 0.005;

impl Rig {
    /// The rig of a recording that has both models.
    pub fn of(recording: &Recording) -> Option<Self> {
        let camera = Device::new(recording.camera_model.as_ref()?);
        let projector = Device::new(recording.projector.model.as_ref()?);
        let range = recording.range_mm.map_or_else(
            || {
                // ± 0.2 × the distance from the camera to the reference plane along its axis.
                let reach = 0.2 * camera.centre()[2] / -camera.axis()[2];
                (-reach, reach)
            },
            |[low, high]| (low, high),
        );
        Some(Self {
            camera,
            projector,
            range,
        })
    }

    /// The phase Φ that pixel (u, v) would see at height z.
    pub fn phase_at(&self, pattern: &Pattern, u: f64, v: f64, z: f64) -> f64 {
        let (xi, eta) = self.projector.project(self.camera.point_at(u, v, z));
        pattern.at(xi, eta)
    }

    /// Φ_R, the phase that a pixel sees on the reference plane z = 0.
    pub fn reference(&self, pattern: &Pattern, u: f64, v: f64) -> f64 {
        self.phase_at(pattern, u, v, 0.0)
    }

    /// The height in the working range at which pixel (u, v) sees `phase`, by bisection, and the
    /// slope ∂Φ/∂z there in turns per mm; none if there is no such height, there are several, or
    /// the phase hardly depends on the height.
    pub fn height(&self, pattern: &Pattern, u: f64, v: f64, phase: f64) -> Option<(f64, f64)> {
        let (eye, ray) = (self.camera.centre(), self.camera.ray(u, v));
        let off = |z: f64| {
            let (xi, eta) = self.projector.project(on_ray(eye, ray, z));
            pattern.at(xi, eta) - phase
        };
        let (low, high) = self.range;
        let pieces = if pattern.is_sampled() { PIECES } else { 1 };
        let edge = |piece: usize| low + (high - low) * piece as f64 / pieces as f64;
        let mut changes = Vec::new();
        for piece in 0..pieces {
            let (a, b) = (edge(piece), edge(piece + 1));
            if (off(a) < 0.0) != (off(b) < 0.0) {
                changes.push((a, b));
            }
        }
        let [(mut a, mut b)] = changes[..] else {
            return None;
        };
        let rising = off(a) < 0.0;
        for _ in 0..HALVINGS {
            let middle = (a + b) / 2.0;
            if (off(middle) < 0.0) == rising {
                a = middle;
            } else {
                b = middle;
            }
        }
        let z = (a + b) / 2.0;
        let slope = (off(z + SLOPE_MM) - off(z - SLOPE_MM)) / (2.0 * SLOPE_MM);
        let change = slope.abs() * 0.4 * eye[2];
        (change >= LEAST_TURNS).then_some((z, slope))
    }
}

/// σ_z = σ_I / (2π |∂Φ/∂z|) · √(2 / Σ N r² B²), with Σ N r² B² the pixel's `information`.
pub fn sigma_z(noise_counts: f64, slope: f64, information: f64) -> f64 {
    noise_counts / (std::f64::consts::TAU * slope.abs()) * (2.0 / information).sqrt()
}
