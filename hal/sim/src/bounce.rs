//! Light that comes to a point of the part by way of one other surface.
//!
//! # Idea
//! A surface is lit by the projector and by what other surfaces reflect of it. Of that, the light that
//! was reflected once before is worked out, where a pixel's central ray meets the part.
//!
//! # Equation
//! With I(ω) the light, in the units of a picture, that the surface in direction ω reflects towards the
//! point, and the light model of [`super::transport`],
//!
//! ```text
//! I = 1/π ∫ (diffuse · n·ω + specular · max(0, m·ω)^shininess) I(ω) dω        m = 2 (n·v) n − v
//! ```
//!
//! over the directions above the surface (J. T. Kajiya, *The rendering equation*, SIGGRAPH 1986, with
//! one reflection between). Directions are those of a Fibonacci lattice, spread as n·ω for the first
//! term and as (m·ω)^shininess for the second one, where the integral is a mean.

use super::material::Lighting;
use super::optics::{Vector, along, dot, minus, normalised, turned};
use super::trace::Hit;
use super::transport::Tracer;
use std::f64::consts::TAU;

/// Directions of the diffuse term.
const DIFFUSE: u32 = 768;
/// Directions of the mirrored one.
const MIRRORED: u32 = 128;

/// 2 / (1 + √5): turns from each direction to the next.
const GOLDEN_SECTION: f64 = 0.618_033_988_749_894_9;
/// Rays from a surface to others start at this distance from it, mm.
const LIFT_MM: f64 = 0.02;
/// Of a surface from which none of every so many directions meets another one, no others are looked at.
const PROBED: usize = 24;

impl Tracer<'_> {
    /// The light that comes to a point of the part by way of one other surface, and on to the camera.
    pub fn bounces(&self, hit: &Hit, bounces: &mut Vec<(u32, f32)>) {
        let eye = normalised(minus(self.placed.eye, hit.point));
        let light = self.reflection.at(hit.point, true);
        let start = along(hit.point, hit.normal, LIFT_MM);
        let others = directions(light, hit.normal, eye);
        let mut probed = others.clone().step_by(PROBED);
        if probed.all(|(direction, _)| self.other(start, direction).is_none()) {
            return;
        }
        let strength = self.reflection.brightest * self.reflection.brightest * hit.albedo;
        for (direction, share) in others {
            let back = direction.map(|along| -along);
            let other = self.other(start, direction);
            if let Some(lit) = other.and_then(|other| self.lit(&other, back)) {
                let [column, row] = lit.raster.map(|place| (place + 0.5) as u32);
                let at = row * self.scenario.rig.projector.width + column;
                bounces.push((at, (strength * share * lit.share) as f32));
            }
        }
    }

    /// What a ray from one point of the part meets, of the part or the world around it.
    fn other(&self, start: Vector, direction: Vector) -> Option<Hit> {
        let met = self.body.and_then(|body| body.first_hit(start, direction));
        let pose = &self.placed.pose;
        let (origin, ray) = (pose.to_world(start), turned(&pose.rotation, direction));
        let world = self.world.as_ref();
        match (met, world.and_then(|world| world.meets(origin, ray, pose))) {
            (Some(met), Some((t, _))) if dot(minus(met.point, start), direction) <= t => Some(met),
            (_, Some((_, world))) => Some(world),
            (met, None) => met,
        }
    }
}

/// Where light may come from to a surface with this normal that is seen from `eye`, each with what the
/// light from there counts.
fn directions(
    light: &Lighting,
    normal: Vector,
    eye: Vector,
) -> impl Iterator<Item = (Vector, f64)> + Clone {
    let mirrored = 2.0 * dot(normal, eye);
    let mirror = [0, 1, 2].map(|axis| mirrored * normal[axis] - eye[axis]);
    let exponent = light.shininess + 1.0;
    let diffuse = light.diffuse / f64::from(DIFFUSE);
    let specular = light.specular * 2.0 / exponent / f64::from(MIRRORED);
    let count = |share: f64, count: u32| if share > 0.0 { count } else { 0 };
    let spread = move |at| about(normal, lattice(at, DIFFUSE), 0.5);
    let lobe = move |at| about(mirror, lattice(at, MIRRORED), 1.0 / exponent);
    let all = (0..count(diffuse, DIFFUSE)).map(move |at| (spread(at), diffuse));
    let all = all.chain((0..count(specular, MIRRORED)).map(move |at| (lobe(at), specular)));
    all.filter(move |(direction, _)| dot(*direction, normal) > 0.0)
}

/// A point of the unit square, of so many that fill it evenly: a Fibonacci lattice.
fn lattice(at: u32, count: u32) -> [f64; 2] {
    let turns = f64::from(at) * GOLDEN_SECTION;
    [(f64::from(at) + 0.5) / f64::from(count), turns.fract()]
}

/// The direction whose cosine to an axis is u to this power.
fn about(axis: Vector, [u, turns]: [f64; 2], power: f64) -> Vector {
    let cosine = u.powf(power);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let other = match axis[1].abs() < 0.9 {
        true => [0.0, 1.0, 0.0],
        false => [1.0, 0.0, 0.0],
    };
    let right = normalised(cross(other, axis));
    let up = cross(axis, right);
    let (sin, cos) = (TAU * turns).sin_cos();
    [0, 1, 2].map(|i| cosine * axis[i] + sine * (cos * right[i] + sin * up[i]))
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
