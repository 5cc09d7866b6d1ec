//! Light transport of a placed part: how much of each projector pixel arrives in each camera pixel.
//!
//! A frame is linear in the raster, so the geometry is computed once per placed part: for each of n
//! × n sub-rays per camera pixel the point of the surface, its normal, whether it sees the
//! projector, and the projector point (ξ, η) that lights it. The weights of the projector pixels
//! whose light reaches it (`Spread`), of all sub-rays of a pixel, are merged into one row of a
//! sparse matrix; a frame is then matrix × raster. The model of light is Phong's (1975), I = albedo
//! · (ambient + pattern · (diffuse · max(0, n·l) + specular · max(0, r·v)^shininess)), averaged
//! over the sub-rays, without fall-off with distance: n is the normal, l the direction to the
//! projector, v that to the camera, and r = 2 (n·l) n − l. A surface that faces away from the
//! projector has no highlight. With `bounces` there is also the light that came by way of one other surface
//! (`bounce.rs`), from the projector pixel nearest to where that is lit. Ambient light reaches shadowed points, too; a sub-ray that meets
//! nothing has I = 0. Beyond the raster the projector is dark.
//!
//! The result does not depend on the number of threads: every pixel is computed by itself.

use rayon::prelude::*;

use super::blur::{Spread, split};
use super::footprint::Footprint;
use super::material::{Material, Reflection};
use super::optics::{Lens, Vector, dot, minus, normalised, turned, turned_back};
use super::parts::{Part, Solid};
use super::placement::{Placement, Pose, World};
use super::scenario::Scenario;
use super::trace::{Body, Hit, Traced};

/// A pixel has a depth edge if a sub-ray meets the surface farther than this from the tangent plane
/// at the central ray's hit, measured along the ray, mm.
const DEPTH_EDGE_MM: f64 = 2.0;

/// The ground truth of a placed part, per camera pixel, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// World z in mm where the pixel's central ray meets the part; NaN where camera and projector
    /// do not both see it.
    pub height: Vec<f32>,
    /// 0 unseen, 1 pixel centre lit, 2 whole pixel lit and no depth edge inside.
    pub class: Vec<u8>,
}

/// Printed faces have numbers from here on: no part has so many.
const PRINT: u16 = u16::MAX / 8;
/// Neighbours in a row of the raster whose weights are stored together.
const LANES: usize = 4;
/// A raster is followed by so many dark pixels, which the last taps read with weight 0.
pub(super) const PADDING: usize = LANES - 1;
/// The weight of a pixel that arrives completely, reflected as brightly as the part can: diffuse +
/// specular. Rounding to whole weights changes the light by 3e-5 to 5e-5 of that RMS (36 to 100
/// weights, each off by at most 1/131 070).
const WHOLE: f32 = 65_535.0;

/// The sparse matrix from rasters to frames, and the ground truth: of one camera row, or of all.
/// Light is in units of full scale.
#[derive(Debug)]
pub(super) struct Transport {
    /// Ambient light of each camera pixel.
    ambient: Vec<f32>,
    /// Light of one unit of weight.
    unit: f32,
    /// Where each pixel's taps end; they start where those of the pixel before end.
    ends: Vec<u32>,
    taps: Vec<Tap>,
    /// Where each pixel's light by way of other surfaces ends; empty without.
    bounce_ends: Vec<u32>,
    /// Of that the pixel of the raster, and the light that it gives.
    bounces: Vec<(u32, f32)>,
    /// σ with which the lens blurs the finished picture, camera pixels.
    pub blur_px: f64,
    pub truth: Truth,
}

/// The weights of neighbouring projector pixels in a row.
#[derive(Debug)]
struct Tap {
    /// The first of the pixels, as its index in the raster.
    first: u32,
    weights: [u16; LANES],
}

/// A placed part, and the devices in its coordinates.
pub(super) struct Placed {
    pub pose: Pose,
    pub eye: Vector,
    lamp: Vector,
}

impl Placed {
    fn new(placement: &Placement, camera: &Lens, projector: &Lens) -> Self {
        let pose = placement.pose();
        Self {
            eye: pose.to_part(camera.centre()),
            lamp: pose.to_part(projector.centre()),
            pose,
        }
    }
}

impl Transport {
    /// Traces `part`, made of `material` or reflecting as the lighting says, at `placement` with
    /// the rig and lighting of `scenario`; `progress` is called with the share done, 0…1, from any
    /// thread.
    pub fn build(
        scenario: &Scenario,
        part: &Part,
        material: Option<Material>,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Self {
        let camera = scenario.rig.camera.lens();
        let projector = scenario.rig.projector.lens();
        let placed = Placed::new(placement, &camera, &projector);
        let surface = part.surface();
        let thin = surface.as_deref().map(Traced::new);
        let solid = part.solid();
        let body = body_of(&thin, &solid);
        // The next part stays when this one is taken away or damaged.
        let mut designed = match part {
            Part::Empty {} => scenario.part.clone(),
            part => part.clone(),
        };
        designed.defects_mut().map(Vec::clear);
        // A board is held in the air.
        let ground = scenario.floor.as_ref();
        let ground = ground.filter(|_| !matches!(part, Part::Board(_)));
        let another = ground.and_then(|ground| ground.next_mm).map(|_| &designed);
        let surface_of_next = another.and_then(Part::surface);
        let solid_of_next = another.and_then(Part::solid);
        let thin_of_next = surface_of_next.as_deref().map(Traced::new);
        let light = &scenario.light;
        let light = material.map_or(*light, |made| made.under(light));
        let reflection = Reflection::new(&light, scenario.print);
        let mut tracer = Tracer {
            scenario,
            camera: &camera,
            projector: &projector,
            spread: Spread::new(split(scenario.optics.projector_blur_px).0),
            placed: &placed,
            reflection: &reflection,
            body,
            world: ground.map(|ground| {
                let next = body_of(&thin_of_next, &solid_of_next);
                World::below(designed.lowest(), ground, next)
            }),
            footprint: Footprint::bare(scenario.sub_rays),
        };
        let (width, height) = (scenario.rig.camera.width, scenario.rig.camera.height);
        let lens_px = scenario.optics.camera_blur_px;
        if solid.is_some() {
            let pixels = (0..width * height).into_par_iter();
            let labels: Vec<u16> = pixels
                .map(|at| tracer.label(at % width, at / width))
                .collect();
            let columns = width as usize;
            tracer.footprint = Footprint::blurred(scenario.sub_rays, lens_px, &labels, columns);
        }
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
        let mut whole = Self::join(rows);
        whole.unit = reflection.brightest as f32 / WHOLE;
        whole.blur_px = match solid {
            Some(_) => 0.0,
            None => lens_px,
        };
        whole
    }

    fn join(rows: Vec<Self>) -> Self {
        let pixels = rows.iter().map(|row| row.ambient.len()).sum();
        let taps = rows.iter().map(|row| row.taps.len()).sum();
        let mut whole = Self::with_capacity(pixels, taps);
        for row in rows {
            let before = whole.taps.len() as u32;
            whole.ends.extend(row.ends.iter().map(|end| before + end));
            let before = whole.bounces.len() as u32;
            let ends = row.bounce_ends.iter().map(|end| before + end);
            whole.bounce_ends.extend(ends);
            whole.bounces.extend(row.bounces);
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
            unit: 0.0,
            ends: Vec::with_capacity(pixels),
            taps: Vec::with_capacity(taps),
            bounce_ends: Vec::new(),
            bounces: Vec::new(),
            blur_px: 0.0,
            truth: Truth {
                height: Vec::with_capacity(pixels),
                class: Vec::with_capacity(pixels),
            },
        }
    }

    /// The light of each camera pixel while the projector shows `raster` (light per projector
    /// pixel, 1 = white, and [`PADDING`]), or is dark.
    pub fn light(&self, raster: Option<&[f32]>, picture: &mut [f32]) {
        let Some(raster) = raster else {
            picture.copy_from_slice(&self.ambient);
            return;
        };
        let mut start = 0;
        for ((pixel, ambient), end) in picture.iter_mut().zip(&self.ambient).zip(&self.ends) {
            let end = *end as usize;
            let taps = &self.taps[start..end];
            start = end;
            let mut sums = [0.0_f32; LANES];
            for tap in taps {
                let lit = &raster[tap.first as usize..][..LANES];
                for ((sum, weight), lit) in sums.iter_mut().zip(tap.weights).zip(lit) {
                    *sum += f32::from(weight) * lit;
                }
            }
            *pixel = ambient + self.unit * sums.iter().sum::<f32>();
        }
        let mut start = 0;
        for (pixel, end) in picture.iter_mut().zip(&self.bounce_ends) {
            let ways = self.bounces[start..*end as usize].iter();
            *pixel += ways
                .map(|(at, share)| share * raster[*at as usize])
                .sum::<f32>();
            start = *end as usize;
        }
    }
}

/// What the tracing of a row needs.
pub(super) struct Tracer<'a> {
    pub scenario: &'a Scenario,
    camera: &'a Lens,
    projector: &'a Lens,
    spread: Spread,
    pub placed: &'a Placed,
    pub reflection: &'a Reflection,
    pub body: Option<&'a dyn Body>,
    pub world: Option<World<'a>>,
    footprint: Footprint,
}

/// A point of the part that the projector lights: its place on the raster, and the share of the
/// light that it reflects.
pub(super) struct Lit {
    pub raster: [f64; 2],
    pub share: f64,
}

/// Memory for the weights of one pixel.
#[derive(Default)]
struct Weights {
    /// The weights along ξ and along η, of one point.
    axes: [Vec<f32>; 2],
    /// The sums of weights of all projector pixels in a rectangle, row by row.
    sums: Vec<f32>,
}

impl Tracer<'_> {
    fn row(&self, v: u32) -> Transport {
        let device = &self.scenario.rig.camera;
        let width = device.width as usize;
        let mut row = Transport::with_capacity(width, width * 12);
        let mut points: Vec<Lit> = Vec::new();
        let mut rays = Vec::new();
        let mut weights = Weights::default();
        for u in 0..device.width {
            points.clear();
            self.footprint
                .rays(v as usize * width + u as usize, &mut rays);
            let share = 1.0 / rays.len() as f64;
            let (u, v) = (f64::from(u), f64::from(v));
            let centre = self.hit(u, v);
            let mut whole = true;
            let mut bright = 0.0;
            for [right, down] in &rays {
                let Some((hit, direction)) = self.hit(u + right, v + down) else {
                    whole = false;
                    continue;
                };
                bright += hit.albedo;
                whole &= centre
                    .as_ref()
                    .is_some_and(|(at, _)| !depth_edge(at, &hit, direction));
                match self.seen_lit(&hit) {
                    Some(lit) => points.push(lit),
                    None => whole = false,
                }
            }
            let seen = centre
                .as_ref()
                .and_then(|(hit, _)| self.seen_lit(hit).map(|_| hit.point));
            let class = match seen {
                None => 0,
                Some(_) if whole => 2,
                Some(_) => 1,
            };
            row.truth.class.push(class);
            row.truth
                .height
                .push(seen.map_or(f32::NAN, |point| self.placed.pose.to_world(point)[2] as f32));
            row.ambient
                .push((self.scenario.light.ambient * bright * share) as f32);
            self.taps(&points, share, &mut weights, &mut row.taps);
            row.ends.push(row.taps.len() as u32);
            if self.scenario.bounces > 0 {
                if let Some((hit, _)) = centre.filter(|(hit, _)| !hit.is_of_world()) {
                    self.bounces(&hit, &mut row.bounces);
                }
                row.bounce_ends.push(row.bounces.len() as u32);
            }
        }
        row
    }

    /// Where the ray of camera point (u, v) meets the part or the world around it, in the part's coordinates.
    fn hit(&self, u: f64, v: f64) -> Option<(Hit, Vector)> {
        let Placed { pose, eye, .. } = self.placed;
        let ray = self.camera.ray(u, v);
        let direction = turned_back(&pose.rotation, ray);
        let met = self.body.and_then(|body| body.first_hit(*eye, direction));
        let world = self.world.as_ref();
        let world = world.and_then(|world| world.meets(self.camera.centre(), ray, pose));
        let hit = match (met, world) {
            (Some(met), Some((t, _))) if dot(minus(met.point, *eye), direction) <= t => met,
            (_, Some((_, world))) => world,
            (met, None) => met?,
        };
        Some((hit, direction))
    }

    /// What the central ray of a pixel sees: the same number for the same face in the same light.
    fn label(&self, u: u32, v: u32) -> u16 {
        let hit = self.hit(f64::from(u), f64::from(v));
        hit.map_or(0, |(hit, _)| {
            let is_printed = !hit.is_of_world() && self.reflection.printed(hit.point).is_some();
            let face = hit.face + u16::from(is_printed) * PRINT;
            1 + 2 * face + u16::from(self.seen_lit(&hit).is_some())
        })
    }

    /// How the projector lights this point for the camera; none if it does not.
    fn seen_lit(&self, hit: &Hit) -> Option<Lit> {
        self.lit(hit, normalised(minus(self.placed.eye, hit.point)))
    }

    /// How the projector lights this point for one in direction `eye`; none if it does not.
    pub fn lit(&self, hit: &Hit, eye: Vector) -> Option<Lit> {
        let towards = normalised(minus(self.placed.lamp, hit.point));
        let light = self.reflection.at(hit.point, !hit.is_of_world());
        let share = light.share(hit.normal, towards, eye)? * hit.albedo;
        let raster = self
            .projector
            .project(self.placed.pose.to_world(hit.point))?;
        let device = &self.scenario.rig.projector;
        let on = |place: f64, pixels: u32| (-0.5..f64::from(pixels) - 0.5).contains(&place);
        if !on(raster[0], device.width) || !on(raster[1], device.height) {
            return None;
        }
        let is_shadowed = self.body.is_some_and(|body| match hit.is_of_world() {
            true => body.first_hit(hit.point, towards).is_some(),
            false => body.shadowed(hit, towards),
        });
        let is_shaded = self.world.as_ref().is_some_and(|world| {
            let [normal, towards] =
                [hit.normal, towards].map(|way| turned(&self.placed.pose.rotation, way));
            world.shades(self.placed.pose.to_world(hit.point), normal, towards)
        });
        (!is_shadowed && !is_shaded).then_some(Lit { raster, share })
    }

    /// The taps of a camera pixel whose sub-rays, each of so large a `share`, meet these points.
    fn taps(&self, points: &[Lit], share: f64, weights: &mut Weights, taps: &mut Vec<Tap>) {
        let device = &self.scenario.rig.projector;
        let pixels = |lit: &Lit, axis: usize| {
            let [first, end] = self.spread.pixels(lit.raster[axis]);
            let count = [device.width, device.height][axis];
            [first.max(0), end.min(i64::from(count))]
        };
        let bounds = |axis: usize| {
            let spans = points.iter().map(|lit| pixels(lit, axis));
            spans.reduce(|[first, end], [f, e]| [first.min(f), end.max(e)])
        };
        let (Some([left, right]), Some([top, bottom])) = (bounds(0), bounds(1)) else {
            return;
        };
        let columns = ((right - left) as usize).next_multiple_of(LANES);
        let Weights { axes, sums } = weights;
        sums.clear();
        sums.resize(columns * (bottom - top) as usize, 0.0);
        for lit in points {
            let spans = [0, 1].map(|axis| pixels(lit, axis));
            for axis in 0..2 {
                let [first, end] = spans[axis];
                axes[axis].resize((end - first) as usize, 0.0);
                self.spread
                    .weights(lit.raster[axis], first, &mut axes[axis]);
            }
            let strength = (lit.share * share) as f32 * WHOLE;
            let rows = sums.chunks_exact_mut(columns);
            for (row, down) in rows.skip((spans[1][0] - top) as usize).zip(&axes[1]) {
                let row = &mut row[(spans[0][0] - left) as usize..];
                for (sum, across) in row.iter_mut().zip(&axes[0]) {
                    *sum += strength * down * across;
                }
            }
        }
        for (row, sums) in (top..).zip(sums.chunks_exact(columns)) {
            for (column, sums) in (left..).step_by(LANES).zip(sums.chunks_exact(LANES)) {
                // The shares of a pixel's sub-rays add up to at most 1, and the spread of each
                // to 1.
                debug_assert!(sums.iter().all(|sum| *sum < WHOLE + 0.5));
                let weights = std::array::from_fn(|lane| sums[lane].round() as u16);
                if weights != [0; LANES] {
                    let first = (row * i64::from(device.width) + column) as u32;
                    taps.push(Tap { first, weights });
                }
            }
        }
    }
}

/// A thin surface or a solid as what rays meet.
fn body_of<'a>(thin: &'a Option<Traced<'_>>, solid: &'a Option<Solid>) -> Option<&'a dyn Body> {
    match (thin, solid) {
        (Some(thin), _) => Some(thin as &dyn Body),
        (None, solid) => solid.as_ref().map(|solid| solid as &dyn Body),
    }
}

/// Whether `hit` is off the tangent plane at `at`, along `direction`, by more than
/// [`DEPTH_EDGE_MM`].
fn depth_edge(at: &Hit, hit: &Hit, direction: Vector) -> bool {
    let off = dot(at.normal, minus(hit.point, at.point));
    let along_ray = off / dot(at.normal, direction).abs().max(1e-3);
    along_ray.abs() > DEPTH_EDGE_MM
}
