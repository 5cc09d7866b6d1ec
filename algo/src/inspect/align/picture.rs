//! Where a part lies in the picture: shift and turn about z, from the picture without fringes
//! alone.
//!
//! # Idea
//! The mean of a pair has no fringes. Golden's modulation is what golden's picture without the
//! ambient light looks like. Both are compared from coarse to fine along the edges of the template,
//! whose points lie on golden's surface (B. D. Lucas, T. Kanade, 1981, with the motion of a rigid
//! body in space in place of one in the picture). No phase is used, so no fringe order is needed.
//!
//! # Equation
//! At the place π(M P) where the motion M takes a point P of the template, with brightness T and
//! gradient ∇T,
//!
//! ```text
//! A(π(M P)) = g T + o + g ∇T · ∂π/∂p · (p − p_true)      p = x, y, z, turn about z
//! ```
//!
//! which is linear in g, o and g (p − p_true).
//!
//! z is found by the scale of the picture, so to fractions of a mm: less than half a fringe, which
//! proves the fringe order. Tilts are taken as 0: they are found by the phases.

use super::coarse::Coarse;
use super::motion::Motion;
use crate::frame::FrameView;
use crate::geometry::{Triangulator, Vector};
use crate::math::solve::Normal;
use crate::pipeline::KnownSurface;
use alloc::vec::Vec;

/// Unknowns of the motion: x, y, z in mm, turn about z in rad.
const MOTIONS: usize = 4;
/// With gain and offset.
const UNKNOWNS: usize = MOTIONS + 2;
/// Corrections at each scale at most, and the shift in coarse pixels below which they end.
const ROUNDS: usize = 10;
const SMALL_PX: f64 = 0.01;
/// At the coarsest scale a part is displaced by about so many pixels at most.
const COARSE_PX: f64 = 1.0;
/// Only points of at least this share of the steepest gradient are used, and about so many.
const STEEP: f64 = 0.2;
const POINTS: usize = 3000;
/// Steps of the derivatives.
const STEP_MM: f64 = 0.01;
const STEP_RAD: f64 = 1e-4;

/// Golden's picture along its edges, at several scales.
#[derive(Clone, Debug)]
pub struct Picture {
    centre: Vector,
    /// From coarse to fine.
    scales: Vec<Scale>,
}

#[derive(Clone, Debug)]
struct Scale {
    /// Fine pixels per coarse one.
    pixels: usize,
    points: Vec<Point>,
}

/// A point of the template.
#[derive(Clone, Copy, Debug)]
struct Point {
    at: Vector,
    /// What the picture there depends on: ∇T · ∂π/∂p, T and 1.
    terms: [f64; UNKNOWNS],
}

/// How a part was found to lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Where it was moved to.
    pub motion: Motion,
    /// Share of the picture's variance along the edges that golden explains, at most 1.
    pub likeness: f64,
}

impl Picture {
    /// Of golden's modulation in counts (row-major), for parts that lie up to `tolerance_px` pixels
    /// off. None without edges.
    pub fn new(
        triangulator: &Triangulator,
        surface: &KnownSurface,
        modulation: &[f32],
        centre: Vector,
        tolerance_px: f64,
    ) -> Option<Self> {
        let mut picture = Coarse {
            width: surface.width,
            height: modulation.len() / surface.width.max(1),
            brightness: modulation.to_vec(),
        };
        let mut scales = Vec::new();
        let mut pixels = 1;
        while scales.is_empty() || (pixels as f64) < tolerance_px / COARSE_PX {
            let mut half = Coarse::default();
            half.become_half(&picture);
            picture = half;
            pixels *= 2;
            let scale = Scale::new(triangulator, surface, (&picture, pixels), centre);
            if scale.points.len() < 8 * UNKNOWNS {
                break;
            }
            scales.push(scale);
        }
        scales.reverse();
        (!scales.is_empty()).then_some(Self { centre, scales })
    }

    /// Finds the part in the mean of a pair; none where the edges do not determine it.
    pub fn find(
        &self,
        triangulator: &Triangulator,
        frames: [FrameView<'_>; 2],
        pictures: &mut Vec<Coarse>,
    ) -> Option<Found> {
        pictures.resize_with(self.scales.len(), Coarse::default);
        let (finest, coarser) = pictures.split_first_mut()?;
        finest.become_mean(frames);
        let mut before = &*finest;
        for picture in coarser {
            picture.become_half(before);
            before = picture;
        }
        let mut motion = [0.0; MOTIONS];
        let mut likeness = 0.0;
        for (scale, picture) in self.scales.iter().zip(pictures.iter().rev()) {
            for _ in 0..ROUNDS {
                let moved = self.motion(&motion);
                let (further, alike) = scale.correction(triangulator, &moved, picture)?;
                for (value, further) in motion.iter_mut().zip(further) {
                    *value -= further;
                }
                likeness = alike;
                let way = libm::hypot(further[0], further[1]);
                if way < SMALL_PX * scale.pixels as f64 * scale.pixel_mm(triangulator) {
                    break;
                }
            }
        }
        Some(Found {
            motion: self.motion(&motion),
            likeness,
        })
    }

    fn motion(&self, [x, y, z, turn]: &[f64; MOTIONS]) -> Motion {
        let (shift, turn) = (Vector::new(*x, *y, *z), Vector::new(0.0, 0.0, *turn));
        Motion::new(self.centre, shift, turn)
    }
}

impl Scale {
    fn new(
        triangulator: &Triangulator,
        surface: &KnownSurface,
        (picture, pixels): (&Coarse, usize),
        centre: Vector,
    ) -> Self {
        let slope = |at: usize, step: usize| {
            f64::from(picture.brightness[at + step] - picture.brightness[at - step]) / 2.0
        };
        let inside = |at: &usize| {
            let (u, v) = (at % picture.width, at / picture.width);
            u > 0 && v > 0 && u + 1 < picture.width && v + 1 < picture.height
        };
        let gradient = |at: usize| [slope(at, 1), slope(at, picture.width)];
        let steep = |at: usize| libm::hypot(gradient(at)[0], gradient(at)[1]);
        let places = || (0..picture.brightness.len()).filter(inside);
        let least = STEEP * places().map(steep).fold(0.0, f64::max);
        let chosen: Vec<usize> = places()
            .filter(|&at| least > 0.0 && steep(at) >= least)
            .collect();
        let every = chosen.len().div_ceil(POINTS).max(1);
        let point = |&at: &usize| {
            let (u, v) = (at % picture.width, at / picture.width);
            let fine = |at: usize| at * pixels + pixels / 2 - 1;
            let place = (fine(u), fine(v));
            let height = surface.height[place.1 * surface.width + place.0];
            let point = triangulator.point(place.0, place.1, height)?;
            let seen = |moved: [f64; MOTIONS]| {
                let [x, y, z, turn] = moved;
                let turn = Vector::new(0.0, 0.0, turn);
                let motion = Motion::new(centre, Vector::new(x, y, z), turn);
                triangulator.camera().project(motion.apply(point))
            };
            let mut terms = [0.0; UNKNOWNS];
            for (axis, term) in terms.iter_mut().take(MOTIONS).enumerate() {
                let step = if axis + 1 == MOTIONS {
                    STEP_RAD
                } else {
                    STEP_MM
                };
                let mut moved = [0.0; MOTIONS];
                moved[axis] = step;
                let plus = seen(moved)?;
                moved[axis] = -step;
                let minus = seen(moved)?;
                let [along, down] = gradient(at);
                let change = along * (plus.0 - minus.0) + down * (plus.1 - minus.1);
                *term = change / (2.0 * step * pixels as f64);
            }
            terms[MOTIONS] = f64::from(picture.brightness[at]);
            terms[MOTIONS + 1] = 1.0;
            Some(Point { at: point, terms })
        };
        Self {
            pixels,
            points: chosen.iter().step_by(every).filter_map(point).collect(),
        }
    }

    /// p − p_true, and the likeness, from the picture where the motion takes the points.
    fn correction(
        &self,
        triangulator: &Triangulator,
        motion: &Motion,
        picture: &Coarse,
    ) -> Option<([f64; MOTIONS], f64)> {
        let mut normal = Normal::default();
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for point in &self.points {
            let seen = triangulator.camera().project(motion.apply(point.at));
            // The template is that of the coarse pixel's middle, half a pixel after the one that
            // its point lies on.
            let coarse = |at: f64| (at + 1.0) / self.pixels as f64 - 0.5;
            let Some(value) = seen.and_then(|(u, v)| picture.at(coarse(u), coarse(v))) else {
                continue;
            };
            normal.add(&point.terms, value);
            sum += value;
            squares += value * value;
            count += 1.0;
        }
        let solution = normal.solve()?;
        let explained: f64 = solution.iter().zip(normal.right).map(|(x, b)| x * b).sum();
        let mean = sum * sum / f64::max(count, 1.0);
        let likeness = (explained - mean) / (squares - mean).max(f64::MIN_POSITIVE);
        let gain = solution[MOTIONS];
        if gain <= 0.0 {
            return None;
        }
        Some((core::array::from_fn(|i| solution[i] / gain), likeness))
    }

    /// About the size of a camera's pixel on the part, mm.
    fn pixel_mm(&self, triangulator: &Triangulator) -> f64 {
        let Some(point) = self.points.first().map(|point| point.at) else {
            return 1.0;
        };
        let camera = triangulator.camera();
        let beside = camera.project(point + Vector::new(STEP_MM, 0.0, 0.0));
        let way = camera.project(point).zip(beside);
        way.map_or(1.0, |(a, b)| STEP_MM / libm::hypot(a.0 - b.0, a.1 - b.1))
    }
}
