//! A renderer for contours: a sheet with an opening above a floor, in fringes.
//!
//! Rays are spread over a pixel and the blur of the lens together, off any lattice, so that light
//! is blurred before it is integrated. It shares no code with what it judges but vectors, complex
//! numbers and the interface.

use crate::geometry::Vector;
use crate::inspect::contour::{Fringes, PlaneSpot, PlaneView, Setup};
use crate::math::complex::Complex;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// Rays of a pixel that may see more than one thing. With half of them the renderer's own error is
/// 1 µm in a hole of 3 mm at 0.41 mm per px.
const RAYS: usize = 768;
/// Rays of a pixel that sees the face only, or nothing.
const FEW_RAYS: usize = 96;
/// From where on a pixel sees one side only, px.
const FACE_PX: f64 = 3.5;
/// Counts of a face: mean and modulation.
const LIGHT: f64 = 90.0;
/// Distance of both devices, mm.
const AWAY: f64 = 600.0;
const PROJECTOR_PX: f64 = 0.47;
const PITCH_PX: f64 = 8.0;

/// A signed distance on the plane, positive on the material.
pub type Opening<'a> = &'a (dyn Fn(f64, f64) -> f64 + Sync);

#[derive(Clone)]
pub struct Scene<'a> {
    pub opening: Opening<'a>,
    /// What is hidden by something that is not the part, as seen on the plane.
    pub hidden: Option<fn(f64, f64) -> bool>,
    pub thickness: f64,
    /// Depth, mm, and light over that of the face.
    pub floor: Option<(f64, f64)>,
    /// Share of full scale.
    pub ambient: f64,
    /// σ, px.
    pub blur: f64,
    pub mm_per_px: f64,
    pub size: usize,
    /// About y and about x, degrees.
    pub tilt: (f64, f64),
    pub noise: Noise,
    pub ratios: &'static [f64],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// ± 2.5 % of full scale, all alike.
    Uniform,
    /// Normal, of 1.5 counts.
    Quiet,
}

impl Noise {
    pub fn sigma(self) -> f64 {
        // Rounding has 1/√12.
        match self {
            Self::Uniform => libm::sqrt(6.375 * 6.375 / 3.0 + 1.0 / 12.0),
            Self::Quiet => libm::sqrt(1.5 * 1.5 + 1.0 / 12.0),
        }
    }

    fn draw(self, chance: &mut Chance) -> f64 {
        match self {
            Self::Uniform => 6.375 * (2.0 * chance.unit() - 1.0),
            Self::Quiet => 1.5 * chance.normal(),
        }
    }
}

pub struct Chance(SplitMix64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn within(&mut self, reach: f64) -> f64 {
        reach * (2.0 * self.unit() - 1.0)
    }

    fn normal(&mut self) -> f64 {
        gauss(1.0 - self.unit(), self.unit()).0
    }
}

fn gauss(one: f64, other: f64) -> (f64, f64) {
    let radius = libm::sqrt(-2.0 * libm::log(one));
    let angle = core::f64::consts::TAU * other;
    (radius * libm::cos(angle), radius * libm::sin(angle))
}

/// A device that looks at the origin.
#[derive(Clone, Copy)]
struct Device {
    centre: Vector,
    right: Vector,
    down: Vector,
    forward: Vector,
    focal: f64,
}

impl Device {
    /// Degrees from z about y, then about x.
    fn new(about_y: f64, about_x: f64, focal: f64) -> Self {
        let (a, b) = (about_y.to_radians(), about_x.to_radians());
        let (sin, cos) = (libm::sin(b), libm::cos(b));
        let turned = |v: Vector| Vector::new(v.x, v.y * cos - v.z * sin, v.y * sin + v.z * cos);
        let centre = turned(Vector::new(libm::sin(a), 0.0, libm::cos(a)) * AWAY);
        Self {
            centre,
            right: turned(Vector::new(libm::cos(a), 0.0, -libm::sin(a))),
            down: turned(Vector::new(0.0, -1.0, 0.0)),
            forward: centre * (-1.0 / AWAY),
            focal,
        }
    }

    fn project(&self, point: Vector) -> (f64, f64) {
        let from = point - self.centre;
        let scale = self.focal / from.dot(self.forward);
        (from.dot(self.right) * scale, from.dot(self.down) * scale)
    }

    fn ray(&self, u: f64, v: f64) -> Vector {
        self.forward * self.focal + self.right * u + self.down * v
    }

    /// Where the line from a point to the device's centre is at height z.
    fn at_height(&self, from: Vector, z: f64) -> Vector {
        from + (self.centre - from) * ((z - from.z) / (self.centre.z - from.z))
    }
}

/// What a pixel's rays brought: counts without fringes, and Z of every level.
#[derive(Clone, Default)]
struct Light {
    mean: f64,
    fringes: Vec<Complex>,
}

/// A rendered scene.
pub struct Rendered<'a> {
    scene: Scene<'a>,
    camera: Device,
    projector: Device,
    pixels: Vec<Option<Light>>,
}

/// One noisy capture of it.
pub struct Capture<'a> {
    rendered: &'a Rendered<'a>,
    signals: Vec<Option<Vec<Complex>>>,
}

pub const SHIFTS: usize = 4;

impl<'a> Rendered<'a> {
    /// Pixels within `reach` mm of the opening's border are rendered.
    pub fn new(scene: Scene<'a>, reach: f64, seed: u64) -> Self {
        let (y, x) = scene.tilt;
        let camera = Device::new(20.0 + y, x, AWAY / scene.mm_per_px);
        let projector = Device::new(-7.0 + y, x, AWAY / PROJECTOR_PX);
        let mut rendered = Self {
            scene,
            camera,
            projector,
            pixels: Vec::new(),
        };
        let mut chance = Chance::new(seed);
        let size = rendered.scene.size;
        for v in 0..size {
            for u in 0..size {
                let (u, v) = (u as f64, v as f64);
                let spot = rendered.spot(u, v);
                let d = spot.map_or(f64::INFINITY, |at| (rendered.scene.opening)(at.x, at.y));
                let is_face = d > FACE_PX * rendered.scene.mm_per_px;
                // Below the wall of the sheet nothing is seen.
                let wall = 2.0 * rendered.scene.thickness;
                let is_nothing = rendered.scene.floor.is_none()
                    && -d > FACE_PX * rendered.scene.mm_per_px + wall;
                let is_plain = is_face || is_nothing;
                let rays = match is_plain && rendered.scene.hidden.is_none() {
                    true => FEW_RAYS,
                    false => RAYS,
                };
                let pixel = (d.abs() < reach).then(|| rendered.pixel((u, v), rays, &mut chance));
                rendered.pixels.push(pixel);
            }
        }
        rendered
    }

    fn middle(&self) -> f64 {
        (self.scene.size - 1) as f64 / 2.0
    }

    fn pixel(&self, (u, v): (f64, f64), rays: usize, chance: &mut Chance) -> Light {
        // Roberts' sequence of four dimensions, shifted by chance.
        const G: f64 = 1.167_303_978_261_418_7;
        let start: [f64; 4] = core::array::from_fn(|_| chance.unit());
        let mut light = Light {
            mean: 0.0,
            fringes: std::vec![Complex::default(); self.scene.ratios.len()],
        };
        for ray in 0..rays {
            let mut power = 1.0;
            let at: [f64; 4] = core::array::from_fn(|i| {
                power /= G;
                (start[i] + ray as f64 * power).fract()
            });
            let (du, dv) = gauss(1.0 - at[2], at[3]);
            let blur = self.scene.blur;
            let (u, v) = (u + at[0] - 0.5 + blur * du, v + at[1] - 0.5 + blur * dv);
            self.trace(u - self.middle(), v - self.middle(), &mut light);
        }
        let share = 1.0 / rays as f64;
        light.mean *= share;
        for z in &mut light.fringes {
            *z = *z * share;
        }
        light
    }

    fn trace(&self, u: f64, v: f64, light: &mut Light) {
        let ray = self.camera.ray(u, v);
        let down = |z: f64| self.camera.centre + ray * ((z - self.camera.centre.z) / ray.z);
        let top = down(0.0);
        let open = |at: Vector| (self.scene.opening)(at.x, at.y) < 0.0;
        if self.scene.hidden.is_some_and(|hidden| hidden(top.x, top.y)) {
            let texture = 0.6 + 0.3 * libm::sin(3.1 * top.x) * libm::cos(2.3 * top.y);
            return self.add(down(25.0), texture, texture, light);
        }
        if !open(top) {
            return self.add(top, 1.0, 1.0, light);
        }
        let thickness = self.scene.thickness;
        let bottom = down(-thickness);
        if !open(bottom) {
            let (mut above, mut below) = (0.0, -thickness);
            for _ in 0..30 {
                let z = (above + below) / 2.0;
                if open(down(z)) { above = z } else { below = z }
            }
            let point = down(below);
            let d = |x: f64, y: f64| (self.scene.opening)(point.x + x, point.y + y);
            let into = (d(1e-4, 0.0) - d(-1e-4, 0.0), d(0.0, 1e-4) - d(0.0, -1e-4));
            let length = libm::sqrt(into.0 * into.0 + into.1 * into.1);
            let way = self.projector.centre - point;
            let lit = -(into.0 * way.x + into.1 * way.y) / length / way.z;
            // Light comes through the opening, or is hidden by the far rim.
            let lit = match open(self.projector.at_height(point, 0.0)) {
                true => lit.max(0.0),
                false => 0.0,
            };
            return self.add(point, lit, 1.0, light);
        }
        let Some((depth, bright)) = self.scene.floor else {
            return;
        };
        let floor = down(-depth);
        let lit = [0.0, -thickness]
            .iter()
            .all(|&z| open(self.projector.at_height(floor, z)));
        self.add(floor, if lit { bright } else { 0.0 }, bright, light);
    }

    /// Adds a ray's light: projected, and from all around.
    fn add(&self, at: Vector, projected: f64, around: f64, light: &mut Light) {
        light.mean += LIGHT * projected + 255.0 * self.scene.ambient * around;
        let phase = self.phase(at);
        for (sum, ratio) in light.fringes.iter_mut().zip(self.scene.ratios) {
            *sum += Complex::turned(ratio * phase) * (LIGHT * projected);
        }
    }

    fn phase(&self, at: Vector) -> f64 {
        self.projector.project(at).0 / PITCH_PX
    }

    /// What is known of the scene.
    pub fn setup(&self) -> Setup {
        let ray = self.camera.ray(0.0, 0.0);
        let deep = ray * (-1.0 / ray.z);
        let origin = self.phase(Vector::default());
        Setup {
            camera: self.camera.centre,
            projector: self.projector.centre,
            turns_per_mm: (self.phase(deep * 0.01) - origin) / 0.01,
            levels: self
                .scene
                .ratios
                .iter()
                .map(|&ratio| Fringes {
                    ratio,
                    shifts: SHIFTS,
                    taught: 0.95 * LIGHT,
                })
                .collect(),
            noise: self.scene.noise.sigma(),
            least: (4.3 * self.scene.noise.sigma()).max(4.0),
            thickness: Some(self.scene.thickness),
            floor: self.scene.floor.map(|(depth, _)| depth),
            deepest: 30.0,
            reach: 0.6,
        }
    }

    /// A capture with noise and 8 bits.
    pub fn capture(&'a self, seed: u64) -> Capture<'a> {
        let mut chance = Chance::new(seed);
        let signals = self.pixels.iter().map(|pixel| {
            let pixel = pixel.as_ref()?;
            let mut all = Vec::new();
            for z in &pixel.fringes {
                let mut signal = Complex::default();
                for k in 0..SHIFTS {
                    let shift = Complex::turned(k as f64 / SHIFTS as f64);
                    let sample = pixel.mean + z.re * shift.im + z.im * shift.re;
                    let sample = sample + self.scene.noise.draw(&mut chance);
                    if sample > 254.5 {
                        return None;
                    }
                    let sample = sample.max(0.0).round();
                    signal += Complex::new(shift.im, shift.re) * (sample * 2.0 / SHIFTS as f64);
                }
                all.push(signal);
            }
            Some(all)
        });
        Capture {
            rendered: self,
            signals: signals.collect(),
        }
    }

    fn spot(&self, u: f64, v: f64) -> Option<PlaneSpot> {
        let ray = self.camera.ray(u - self.middle(), v - self.middle());
        let at = self.camera.centre + ray * (-self.camera.centre.z / ray.z);
        Some(PlaneSpot {
            x: at.x,
            y: at.y,
            phase: self.phase(at),
        })
    }
}

impl PlaneView for Capture<'_> {
    fn size(&self) -> (usize, usize) {
        let size = self.rendered.scene.size;
        (size, size)
    }

    fn spot(&self, u: f64, v: f64) -> Option<PlaneSpot> {
        self.rendered.spot(u, v)
    }

    fn pixel(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let (u, v) = self.rendered.camera.project(Vector::new(x, y, 0.0));
        Some((u + self.rendered.middle(), v + self.rendered.middle()))
    }

    fn signals(&self, (u, v): (usize, usize), level: usize, row: &mut [Complex]) {
        let first = v * self.rendered.scene.size + u;
        for (signal, place) in row.iter_mut().zip(first..) {
            let levels = self.signals[place].as_ref();
            *signal = levels.map_or(Complex::UNKNOWN, |levels| levels[level]);
        }
    }
}
