//! Light transport of a placed part: how much of each projector pixel arrives in each camera pixel.
//!
//! A frame is linear in the raster, so the geometry is computed once per placed part: for each of n × n sub-rays per
//! camera pixel the point of the surface, its normal, whether it sees the projector, and the projector
//! point (ξ, η) that lights it. The bilinear taps of all sub-rays of a pixel are merged into one row of a sparse
//! matrix; a frame is then matrix × raster. The model of light is
//! I = albedo · (ambient + diffuse · max(0, n·l) · pattern), averaged over the sub-rays, without fall-off with distance. Ambient light
//! reaches shadowed points, too; a sub-ray that meets nothing has I = 0.
//!
//! The result does not depend on the number of threads: every pixel is computed by itself.

use rayon::prelude::*;

use super::optics::{Lens, Vector, dot, minus, normalised, plus, turn, turned, turned_back};
use super::parts::Part;
use super::scenario::{Placement, Scenario};
use super::trace::{Hit, Traced, facing};

/// A pixel has a depth edge if a sub-ray meets the surface farther than this from the tangent plane at the central ray's hit,
/// measured along the ray, mm.
const DEPTH_EDGE_MM: f64 = 2.0;

/// The ground truth of a placed part, per camera pixel, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// World z in mm where the pixel's central ray meets the part; NaN where camera and projector do not both see it.
    pub height: Vec<f32>,
    /// 0 unseen, 1 pixel centre lit, 2 whole pixel lit and no depth edge inside.
    pub class: Vec<u8>,
}

/// The sparse matrix from rasters to frames, and the ground truth: of one camera row, or of all. Light is in units of full scale.
#[derive(Debug)]
pub(super) struct Transport {
    /// Ambient light of each camera pixel.
    ambient: Vec<f32>,
    /// Where each pixel's taps end; they start where those of the pixel before end.
    ends: Vec<u32>,
    /// Projector pixel and weight.
    taps: Vec<(u32, f32)>,
    pub truth: Truth,
}

/// The devices in the coordinates of a placed part.
struct Placed {
    rotation: [f64; 9],
    shift: Vector,
    eye: Vector,
    lamp: Vector,
}

impl Placed {
    fn new(placement: &Placement, camera: &Lens, projector: &Lens) -> Self {
        let rotation = rotation_of(placement);
        let to_part = |point| turned_back(&rotation, minus(point, placement.shift_mm));
        let (eye, lamp) = (to_part(camera.centre()), to_part(projector.centre()));
        Self {
            rotation,
            shift: placement.shift_mm,
            eye,
            lamp,
        }
    }

    fn to_world(&self, point: Vector) -> Vector {
        plus(turned(&self.rotation, point), self.shift)
    }
}

/// Rz(rotation) · Ry(tilt y) · Rx(tilt x).
pub(crate) fn rotation_of(placement: &Placement) -> [f64; 9] {
    let [x, y] = placement.tilt_deg;
    turn([x, y, placement.rotation_deg])
}

impl Transport {
    /// Traces `part` at `placement` with the rig and lighting of `scenario`; `progress` is called with the share done, 0…1, from
    /// any thread.
    pub fn build(
        scenario: &Scenario,
        part: &Part,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Self {
        let camera = scenario.rig.camera.lens();
        let projector = scenario.rig.projector.lens();
        let placed = Placed::new(placement, &camera, &projector);
        let surface = part.surface();
        let tracer = Tracer {
            scenario,
            camera: &camera,
            projector: &projector,
            placed: &placed,
            traced: surface.as_deref().map(Traced::new),
        };
        let height = scenario.rig.camera.height;
        let done = std::sync::atomic::AtomicU32::new(0);
        let rows: Vec<Self> = (0..height)
            .into_par_iter()
            .map(|v| {
                let row = tracer.row(v);
                let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(f64::from(done) / f64::from(height));
                row
            })
            .collect();
        Self::join(rows)
    }

    fn join(rows: Vec<Self>) -> Self {
        let pixels = rows.iter().map(|row| row.ambient.len()).sum();
        let taps = rows.iter().map(|row| row.taps.len()).sum();
        let mut whole = Self::with_capacity(pixels, taps);
        for row in rows {
            let before = whole.taps.len() as u32;
            whole.ends.extend(row.ends.iter().map(|end| before + end));
            whole.ambient.extend(row.ambient);
            whole.taps.extend(row.taps);
            whole.truth.height.extend(row.truth.height);
            whole.truth.class.extend(row.truth.class);
        }
        whole
    }

    fn with_capacity(pixels: usize, taps: usize) -> Self {
        Self {
            ambient: Vec::with_capacity(pixels),
            ends: Vec::with_capacity(pixels),
            taps: Vec::with_capacity(taps),
            truth: Truth {
                height: Vec::with_capacity(pixels),
                class: Vec::with_capacity(pixels),
            },
        }
    }

    /// The light of each camera pixel while the projector shows `raster` (light per projector pixel, 1 = white), or
    /// is dark.
    pub fn light(&self, raster: Option<&[f32]>, picture: &mut [f32]) {
        let Some(raster) = raster else {
            picture.copy_from_slice(&self.ambient);
            return;
        };
        let mut start = 0;
        for ((pixel, ambient), end) in picture.iter_mut().zip(&self.ambient).zip(&self.ends) {
            let taps = &self.taps[start..*end as usize];
            start = *end as usize;
            let lit: f32 = taps
                .iter()
                .map(|(index, weight)| weight * raster[*index as usize])
                .sum();
            *pixel = ambient + lit;
        }
    }
}

/// What tracing a row needs.
struct Tracer<'a> {
    scenario: &'a Scenario,
    camera: &'a Lens,
    projector: &'a Lens,
    placed: &'a Placed,
    traced: Option<Traced<'a>>,
}

/// A point of the part that the projector lights: its place on the raster, and the share of the light that it reflects.
struct Lit {
    raster: [f64; 2],
    share: f64,
}

impl Tracer<'_> {
    fn row(&self, v: u32) -> Transport {
        let device = &self.scenario.rig.camera;
        let n = self.scenario.sub_rays;
        let share = 1.0 / f64::from(n * n);
        let width = device.width as usize;
        let mut row = Transport::with_capacity(width, width * 8);
        let mut pixel: Vec<(u32, f64)> = Vec::with_capacity((4 * n * n) as usize);
        for u in 0..device.width {
            pixel.clear();
            let (u, v) = (f64::from(u), f64::from(v));
            let centre = self.hit(u, v);
            let mut whole = true;
            let mut bright = 0.0;
            for sub in 0..n * n {
                let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                let Some((hit, direction)) = self.hit(u + offset(sub % n), v + offset(sub / n))
                else {
                    whole = false;
                    continue;
                };
                bright += hit.albedo;
                whole &= centre
                    .as_ref()
                    .is_some_and(|(at, _)| !depth_edge(at, &hit, direction));
                match self.lit(&hit) {
                    Some(lit) => self.taps(&lit, share, &mut pixel),
                    None => whole = false,
                }
            }
            let seen = centre
                .as_ref()
                .and_then(|(hit, _)| self.lit(hit).map(|_| hit.point));
            let class = match seen {
                None => 0,
                Some(_) if whole => 2,
                Some(_) => 1,
            };
            row.truth.class.push(class);
            row.truth
                .height
                .push(seen.map_or(f32::NAN, |point| self.placed.to_world(point)[2] as f32));
            row.ambient
                .push((self.scenario.light.ambient * bright * share) as f32);
            merge(&mut pixel, &mut row.taps);
            row.ends.push(row.taps.len() as u32);
        }
        row
    }

    /// Where the ray of camera point (u, v) meets the part, in the part's coordinates.
    fn hit(&self, u: f64, v: f64) -> Option<(Hit, Vector)> {
        let direction = turned_back(&self.placed.rotation, self.camera.ray(u, v));
        let hit = self
            .traced
            .as_ref()?
            .first_hit(self.placed.eye, direction)?;
        Some((hit, direction))
    }

    /// How the projector lights this point; none if it does not.
    fn lit(&self, hit: &Hit) -> Option<Lit> {
        let towards = normalised(minus(self.placed.lamp, hit.point));
        let cosine = facing(hit.normal, towards)?;
        let raster = self.projector.project(self.placed.to_world(hit.point))?;
        let device = &self.scenario.rig.projector;
        let on = |place: f64, pixels: u32| (-0.5..f64::from(pixels) - 0.5).contains(&place);
        if !on(raster[0], device.width) || !on(raster[1], device.height) {
            return None;
        }
        let share = cosine * hit.albedo;
        (!self.traced.as_ref()?.shadowed(hit, towards)).then_some(Lit { raster, share })
    }

    /// The four bilinear taps of a lit point; beyond the outermost pixel centres the edge pixels are repeated.
    fn taps(&self, lit: &Lit, share: f64, pixel: &mut Vec<(u32, f64)>) {
        let device = &self.scenario.rig.projector;
        let split = |place: f64, pixels: u32| {
            let place = place.clamp(0.0, f64::from(pixels - 1));
            let first = (place.floor() as u32).min(pixels.saturating_sub(2));
            (first, (first + 1).min(pixels - 1), place - f64::from(first))
        };
        let (left, right, x) = split(lit.raster[0], device.width);
        let (top, bottom, y) = split(lit.raster[1], device.height);
        let strength = self.scenario.light.diffuse * lit.share * share;
        for (row, wy) in [(top, 1.0 - y), (bottom, y)] {
            for (column, wx) in [(left, 1.0 - x), (right, x)] {
                pixel.push((row * device.width + column, strength * wx * wy));
            }
        }
    }
}

/// Whether `hit` is off the tangent plane at `at`, along `direction`, by more than [`DEPTH_EDGE_MM`].
fn depth_edge(at: &Hit, hit: &Hit, direction: Vector) -> bool {
    let off = dot(at.normal, minus(hit.point, at.point));
    let along_ray = off / dot(at.normal, direction).abs().max(1e-3);
    along_ray.abs() > DEPTH_EDGE_MM
}

/// Appends the taps of one pixel to those of the row, each projector pixel once and in order.
fn merge(pixel: &mut [(u32, f64)], taps: &mut Vec<(u32, f32)>) {
    // A stable sort, so that equal indices are always summed in the same order.
    pixel.sort_by_key(|(index, _)| *index);
    for group in pixel.chunk_by(|a, b| a.0 == b.0) {
        let weight: f64 = group.iter().map(|(_, weight)| weight).sum();
        if let Some((index, _)) = group.first()
            && weight > 0.0
        {
            taps.push((*index, weight as f32));
        }
    }
}
