//! Where a part lies in the picture without fringes.
//!
//! # Idea
//! The mean of all shifts of a level, or of a pair, has no fringes. Golden's modulation is what
//! golden's picture without the ambient light looks like. Both are compared from coarse to fine
//! along the edges of the template, whose points lie on golden's surface (B. D. Lucas, T. Kanade,
//! 1981, with the motion of a rigid body in space in place of one in the picture). No phase is used,
//! so no fringe order is needed.
//!
//! # Equation
//! At the place π(M P) where the motion M takes a point P of the template, with brightness T and
//! gradient ∇T,
//!
//! ```text
//! A(π(M P)) = g T + o + g ∇T · ∂π/∂p · (p − p_true)      p along the directions that are searched
//! ```
//!
//! which is linear in g, o and g (p − p_true).
//!
//! A pair is found from nothing ([`Picture::find`]), in x, y, z and the turn about z: z by the scale
//! of the picture, so to fractions of a mm, which is less than half a fringe and proves the fringe
//! order. Tilts are taken as 0: they are found by the phases. A part that heights have placed is
//! moved along the directions that they leave free, and no others ([`Picture::steer`]).
//!
//! # Accuracy
//! `a_plate_with_holes_is_followed_by_its_picture_where_heights_leave_it_free`: 0.05 pixels.

use super::coarse::Coarse;
use super::fit::Placed;
use super::motion::Motion;
use crate::frame::FrameView;
use crate::geometry::{Triangulator, Vector};
use crate::math::solve::{Normal, solve_symmetric};
use crate::pipeline::KnownSurface;
use crate::simd::Backend;
use alloc::vec::Vec;

/// Unknowns of a motion: x, y, z in mm, turns about x, y, z in rad.
const MOTIONS: usize = 6;
/// With gain and offset.
const UNKNOWNS: usize = MOTIONS + 2;
/// A direction of a motion.
type Direction = [f64; MOTIONS];
/// The directions in which a part that is not tilted is found.
const UPRIGHT: [Direction; 4] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
];
/// Corrections at each scale at most, and the shift in coarse pixels below which they end; the
/// second one ends those at the coarser scales of a part that heights have placed.
const ROUNDS: usize = 10;
const SMALL_PX: f64 = 0.01;
const ROUGH_PX: f64 = 0.1;
/// At the coarsest scale a part is displaced by about so many pixels at most.
const COARSE_PX: f64 = 1.0;
/// Only points of at least this share of the steepest gradient are used, and about so many.
const STEEP: f64 = 0.2;
const POINTS: usize = 3000;
/// Fewer determine nothing.
const LEAST_POINTS: usize = 48;
/// Least share of the picture's variance along golden's edges that golden explains, and of the
/// edges that the frame shows, where the picture of a part is golden's. Rounding takes the first to
/// a little more than 1 at most; that of a picture without contrast is any number.
const ALIKE: core::ops::RangeInclusive<f64> = 0.8..=1.0001;
const SHOWN: f64 = 0.5;
/// Only a picture whose brightness changes by this share of its largest where a part is moved by a
/// pixel of the finest scale has edges that place it along this motion: shading alone does not. The
/// flank of a tube is as steep, but hardly moves where the tube turns about its axis. Of stock parts
/// at 256 and 512 pixels shading changes by up to 0.18, edges by 0.47 and more.
const EDGE: f64 = 0.25;
/// Steps of the derivatives.
const STEP_MM: f64 = 0.01;
const STEP_RAD: f64 = 1e-4;

/// Golden's picture along its edges, at several scales.
#[derive(Clone, Debug)]
pub struct Picture {
    centre: Vector,
    /// From coarse to fine.
    scales: Vec<PictureScale>,
}

#[derive(Clone, Debug)]
struct PictureScale {
    /// Fine pixels per coarse one.
    pixels: usize,
    /// The largest brightness.
    brightest: f64,
    points: Vec<PicturePoint>,
}

/// A point of the template.
#[derive(Clone, Copy, Debug)]
struct PicturePoint {
    at: Vector,
    /// What the picture there depends on: ∇T · ∂π/∂p, T and 1.
    terms: [f64; UNKNOWNS],
}

/// A search for a part.
struct Search<'a> {
    from: Motion,
    along: &'a [Direction],
    /// The way, mm, that a turn by 1 rad counts for where a correction ends the search.
    lever: f64,
    /// The shift that ends it at all scales but the finest, coarse pixels.
    rough_px: f64,
}

/// What a search at one scale corrects.
struct Correction {
    /// p − p_true, as a motion.
    step: Direction,
    likeness: f64,
    /// Share of the template's points that the frame shows.
    shown: f64,
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
            let scale = PictureScale::new(triangulator, surface, (&picture, pixels), centre);
            if scale.points.len() < LEAST_POINTS {
                break;
            }
            scales.push(scale);
        }
        scales.reverse();
        (!scales.is_empty()).then_some(Self { centre, scales })
    }

    /// The directions that heights leave free and along which edges place the part.
    pub fn steerable(
        &self,
        triangulator: &Triangulator,
        placed: &Placed,
    ) -> heapless::Vec<Direction, MOTIONS> {
        let mut along = placed.free.clone();
        for turn in along.iter_mut().flat_map(|direction| &mut direction[3..]) {
            *turn /= placed.radius;
        }
        let finest = self.scales.last();
        along.retain(|way| finest.is_some_and(|finest| finest.has_edges(triangulator, way)));
        along
    }

    /// Finds a part that is hardly tilted in the mean of these frames; none where the edges do not
    /// determine it.
    pub fn find(
        &self,
        triangulator: &Triangulator,
        (backend, frames): (Backend, &[FrameView<'_>]),
        pictures: &mut Vec<Coarse>,
    ) -> Option<Found> {
        self.show((backend, frames), pictures);
        let search = Search {
            from: Motion::none(self.centre),
            along: &UPRIGHT,
            lever: 0.0,
            rough_px: SMALL_PX,
        };
        let (motion, Correction { likeness, .. }) =
            self.descend(triangulator, &search, pictures)?;
        Some(Found { motion, likeness })
    }

    /// Where a part that heights have placed lies in the mean of these frames, if it is moved along
    /// the directions that they leave free; none unless the picture is like golden's there.
    pub fn steer(
        &self,
        triangulator: &Triangulator,
        (backend, frames): (Backend, &[FrameView<'_>]),
        placed: &Placed,
        pictures: &mut Vec<Coarse>,
    ) -> Option<Motion> {
        let along = self.steerable(triangulator, placed);
        if along.is_empty() {
            return None;
        }
        self.show((backend, frames), pictures);
        let search = Search {
            from: placed.motion,
            along: &along,
            lever: placed.radius,
            rough_px: ROUGH_PX,
        };
        let (motion, last) = self.descend(triangulator, &search, pictures)?;
        (ALIKE.contains(&last.likeness) && last.shown >= SHOWN).then_some(motion)
    }

    /// The mean of frames at all scales, from fine to coarse.
    fn show(&self, (backend, frames): (Backend, &[FrameView<'_>]), pictures: &mut Vec<Coarse>) {
        pictures.resize_with(self.scales.len(), Coarse::default);
        let Some((mut before, coarser)) = pictures.split_first_mut() else {
            return;
        };
        before.become_mean(backend, frames);
        for picture in coarser {
            picture.become_half(before);
            before = picture;
        }
    }

    /// The motion that a search finds, and its last correction.
    fn descend(
        &self,
        triangulator: &Triangulator,
        search: &Search<'_>,
        pictures: &[Coarse],
    ) -> Option<(Motion, Correction)> {
        let mut motion = search.from;
        let mut last = None;
        for (scale, picture) in self.scales.iter().zip(pictures.iter().rev()) {
            let small = match scale.pixels {
                2 => SMALL_PX,
                _ => search.rough_px,
            };
            for _ in 0..ROUNDS {
                let found = scale.correction(triangulator, &motion, picture, search.along)?;
                let [x, y, z, a, b, c] = found.step;
                motion = Motion::new(
                    motion.centre,
                    motion.shift - Vector::new(x, y, z),
                    motion.turn - Vector::new(a, b, c),
                );
                last = Some(found);
                let turn = Vector::new(a, b, c).length();
                let way = libm::hypot(libm::hypot(x, y), turn * search.lever);
                if way < small * scale.pixels as f64 * scale.pixel_mm(triangulator) {
                    break;
                }
            }
        }
        Some((motion, last?))
    }
}

impl PictureScale {
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
        let steepest = places().map(steep).fold(0.0, f64::max);
        let brightest = picture.brightness.iter().copied().fold(0.0, f32::max);
        let least = STEEP * steepest;
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
                let [x, y, z, a, b, c] = moved;
                let motion = Motion::new(centre, Vector::new(x, y, z), Vector::new(a, b, c));
                triangulator.camera().project(motion.apply(point))
            };
            let mut terms = [0.0; UNKNOWNS];
            for (axis, term) in terms.iter_mut().take(MOTIONS).enumerate() {
                let step = if axis < 3 { STEP_MM } else { STEP_RAD };
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
            Some(PicturePoint { at: point, terms })
        };
        Self {
            pixels,
            brightest: f64::from(brightest),
            points: chosen.iter().step_by(every).filter_map(point).collect(),
        }
    }

    /// Whether edges change the picture where the part is moved along a direction of 1 mm.
    fn has_edges(&self, triangulator: &Triangulator, direction: &Direction) -> bool {
        let change = |point: &PicturePoint| {
            let terms = point.terms.iter().zip(direction);
            terms.map(|(term, way)| term * way).sum::<f64>()
        };
        let changes = self.points.iter().map(|point| libm::fabs(change(point)));
        let by_a_pixel = self.pixels as f64 * self.pixel_mm(triangulator);
        changes.fold(0.0, f64::max) * by_a_pixel >= EDGE * self.brightest
    }

    /// What the picture corrects along these directions, where the motion takes the points.
    fn correction(
        &self,
        triangulator: &Triangulator,
        motion: &Motion,
        picture: &Coarse,
        along: &[Direction],
    ) -> Option<Correction> {
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
        let (solution, explained) = solve_along(&normal, along)?;
        let mean = sum * sum / f64::max(count, 1.0);
        let gain = solution[MOTIONS];
        (gain > 0.0).then(|| Correction {
            step: core::array::from_fn(|i| solution[i] / gain),
            likeness: (explained - mean) / (squares - mean).max(f64::MIN_POSITIVE),
            shown: count / self.points.len() as f64,
        })
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

/// The unknowns whose motion lies along these directions, and the sum of squares that they explain.
fn solve_along(normal: &Normal<UNKNOWNS>, along: &[Direction]) -> Option<([f64; UNKNOWNS], f64)> {
    let mut columns: heapless::Vec<[f64; UNKNOWNS], UNKNOWNS> = heapless::Vec::new();
    for direction in along {
        let mut column = [0.0; UNKNOWNS];
        column[..MOTIONS].copy_from_slice(direction);
        columns.push(column).ok()?;
    }
    for light in MOTIONS..UNKNOWNS {
        let column = core::array::from_fn(|i| if i == light { 1.0 } else { 0.0 });
        columns.push(column).ok()?;
    }
    let n = columns.len();
    let (mut matrix, mut right) = ([0.0; UNKNOWNS * UNKNOWNS], [0.0; UNKNOWNS]);
    let dot = |u: &[f64; UNKNOWNS], v: &[f64; UNKNOWNS]| -> f64 {
        u.iter().zip(v).map(|(u, v)| u * v).sum()
    };
    for (j, v) in columns.iter().enumerate() {
        let row = |a: usize| {
            let entry = |b: usize| normal.matrix[a.max(b)][a.min(b)] * v[b];
            (0..UNKNOWNS).map(entry).sum::<f64>()
        };
        let product = core::array::from_fn(row);
        right[j] = dot(v, &normal.right);
        for (i, u) in columns.iter().enumerate() {
            matrix[i * n + j] = dot(u, &product);
        }
    }
    let before = right;
    solve_symmetric(&mut matrix[..n * n], &mut right[..n])?;
    let explained = right.iter().zip(before).map(|(x, b)| x * b).sum();
    let mut solution = [0.0; UNKNOWNS];
    for (x, column) in right.iter().zip(&columns) {
        for (sum, share) in solution.iter_mut().zip(column) {
            *sum += x * share;
        }
    }
    Some((solution, explained))
}
