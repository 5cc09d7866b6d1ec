//! A contour from pixels: pieces about where it is expected, their edges, the shape through them,
//! and again about that, until nothing moves.

use super::edge::Edge;
use super::fit::{Fit, Problem, Seen, damp};
use super::piece::{BAND, LENGTH, MARGIN, Pieces, pixel_size};
use super::ring::Ring;
use super::sample::Signals;
use super::shape::Shape;
use super::start::start;
use super::verdict::{Outcome, State, state};
use super::view::{Setup, View};
use crate::math::complex::Complex;
use crate::math::solve::{Point, associate, response};
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Blur of the camera that is looked for, σ in px.
const BLUR: [f64; 2] = [0.05, 2.5];
/// With which the search begins.
const FIRST_BLUR: f64 = 0.45;
/// Rounds at most.
const ROUNDS: usize = 12;
/// Less movement of any place of the contour ends the search, px: the next is a twentieth of it.
const STILL: f64 = 0.02;
/// The same for the change of the blur, px.
const SHARP: f64 = 0.05;
/// After less movement, px, pieces are judged by their noise.
const NEAR: f64 = 0.25;
/// The same for the change of the blur, px: less than its largest step.
const SHARPER: f64 = 0.29;
/// Largest step of the blur, px.
const STEP: f64 = 0.3;
/// Until the contour lies still one of so many pieces is looked at, but so many pieces at least.
const FEW: usize = 8;
const LEAST: usize = 12;
/// The rounds with all pieces end after less movement, px: those before were off by their noise.
const LAST: f64 = 0.1;
/// What light may be off the model until the contour's place and the blur are known, of the
/// material's, and after that: an edge oblique to pixels and to fringes.
const ROUGH: [f64; 2] = [0.1, 0.01];
/// How far from the contour the material's phase is looked at, px.
const FACE: [f64; 2] = [1.0, 4.0];
/// A thickness, in widths of the band as seen head-on, that no wall of a sheet exceeds in the
/// picture unless it fills it.
const THICK: f64 = 3.0;

/// A contour as it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour<const N: usize> {
    /// What became of it.
    pub state: State,
    /// The share of its pieces with an edge.
    pub found: f64,
    /// Its parameters; where it is not found, those that were expected or came nearest.
    pub parameters: [f64; N],
    /// Their covariance by the noise of samples.
    pub covariance: [[f64; N]; N],
    /// σ of the camera's blur at its rim, px.
    pub blur: f64,
    /// RMS of the light at its rim that neither noise nor the model explains, of the material's,
    /// beyond what edges oblique to pixels make: a floor that is lit through another opening.
    pub unexplained: f64,
    /// mm per px.
    pub pixel: f64,
    /// Points of its rim.
    pub points: Vec<Point>,
    /// What became of its pieces, in their order along it.
    pub outcomes: Vec<Outcome>,
    /// By how much the phase of the material next to the rim is off the plane's, turns of ratio 1,
    /// and σ of that by noise: large if the face does not reach the rim.
    pub face: (f64, f64),
    /// Half of the change of the parameters between no wall and a thick one, where the thickness is
    /// not known.
    pub wall: Option<[f64; N]>,
}

/// Finds a contour near its expected parameters.
///
/// Where the sheet's thickness is not known, the parameters are the mean of what no wall and a
/// thick one would make them.
pub fn find<const N: usize>(
    shape: &impl Shape<N>,
    expected: &[f64; N],
    view: &impl View,
    setup: &Setup,
) -> Contour<N> {
    let mut contour = Contour {
        state: State::Unseen,
        found: 0.0,
        parameters: *expected,
        covariance: [[0.0; N]; N],
        blur: FIRST_BLUR,
        unexplained: 0.0,
        pixel: 0.0,
        points: Vec::new(),
        outcomes: Vec::new(),
        face: (0.0, f64::INFINITY),
        wall: None,
    };
    let middle = shape.foot(expected, 0.0);
    let Some(pixel) = pixel_size(view, (middle.x, middle.y)) else {
        return contour;
    };
    contour.pixel = pixel;
    let mut search = Search {
        shape,
        signals: Signals::new(view, setup),
        room: Room {
            pieces: Pieces::default(),
            ring: Ring::default(),
            moved: f64::INFINITY,
            seen: Vec::new(),
            damped: Vec::new(),
            ratios: Vec::new(),
        },
    };
    let about = (shape, expected);
    if let Some(start) = start(about, &search.signals, pixel, &mut search.room.ratios) {
        contour.parameters = start;
    }
    search.run(&mut contour, setup.thickness.unwrap_or(0.0));
    if setup.thickness.is_none() && contour.state == State::Found {
        let mut thick = contour.clone();
        search.run(&mut thick, THICK * BAND * pixel);
        if thick.state == State::Found {
            let mut half = [0.0; N];
            let ends = contour.parameters.iter_mut().zip(thick.parameters);
            for (half, (p, thick)) in half.iter_mut().zip(ends) {
                *half = (thick - *p) / 2.0;
                *p += *half;
            }
            contour.wall = Some(half);
        }
    }
    contour
}

/// A search for a contour.
struct Search<'a, S, V> {
    shape: &'a S,
    signals: Signals<'a, V>,
    room: Room,
}

/// How the blur would have to change, from all pieces.
#[derive(Clone, Copy, Debug, Default)]
struct Sharpness {
    matrix: f64,
    right: f64,
}

impl<S, V: View> Search<'_, S, V> {
    /// Goes on from where a contour is until nothing moves, with few pieces and then with all.
    fn run<const N: usize>(&mut self, contour: &mut Contour<N>, thickness: f64)
    where
        S: Shape<N>,
    {
        let pieces = self.shape.length(&contour.parameters) / (LENGTH * contour.pixel);
        // Casts cut off, and keep to the range of their type.
        let few = (pieces as usize / LEAST).clamp(1, FEW);
        let near = self.approach(contour, thickness, ROUGH[0], few, STILL);
        if few > 1 && near {
            self.approach(contour, thickness, ROUGH[1], 1, LAST);
        } else if few > 1 {
            self.approach(contour, thickness, ROUGH[0], 1, STILL);
        }
        self.judge(contour);
    }

    /// Goes on with one of `some` pieces, until no place moves by `still` px. Whether the pieces
    /// determine the contour.
    fn approach<const N: usize>(
        &mut self,
        contour: &mut Contour<N>,
        thickness: f64,
        mut rough: f64,
        some: usize,
        still: f64,
    ) -> bool
    where
        S: Shape<N>,
    {
        let shape = self.shape;
        for _ in 0..ROUNDS {
            let before = (contour.parameters, contour.blur);
            let room = &mut self.room;
            let of = (shape, &contour.parameters);
            if !(room.moved < MARGIN) {
                room.pieces.divide(of, &self.signals, contour.pixel);
                room.ring.gather(of, &self.signals, &mut room.pieces);
                room.moved = 0.0;
            }
            room.pieces.place(of, self.signals.setup, thickness, some);
            self.look(contour, rough, some);
            let room = &mut self.room;
            let points = &mut contour.points;
            let found = associate(shape, &mut contour.parameters, points, &mut room.ratios);
            let Some(covariance) = found else {
                contour.parameters = before.0;
                return false;
            };
            contour.covariance = covariance;
            let mut moved = 0.0_f64;
            for piece in room.pieces.all.iter().step_by(some) {
                let d = shape.distance(&contour.parameters, piece.foot.x, piece.foot.y);
                moved = moved.max(libm::fabs(d) / contour.pixel);
            }
            room.moved += moved;
            let sharper = libm::fabs(contour.blur - before.1);
            if rough == ROUGH[1] && moved < still && sharper < SHARP {
                break;
            }
            if moved < NEAR && sharper < SHARPER {
                rough = ROUGH[1];
            }
        }
        true
    }

    /// Fits the edges of one of `some` pieces, makes points of them, and adapts the blur.
    fn look<const N: usize>(&mut self, contour: &mut Contour<N>, rough: f64, some: usize) {
        contour.points.clear();
        contour.outcomes.clear();
        let (mut sharpness, mut face) = (Sharpness::default(), [0.0; 2]);
        let (mut unexplained, mut strength) = (0.0, 0.0);
        let Room {
            pieces,
            seen,
            damped,
            ..
        } = &mut self.room;
        for piece in pieces.all.iter().step_by(some) {
            let edge = Edge::new(piece.normal, contour.blur);
            damp(piece, &edge, &self.signals.setup.levels, damped);
            let problem = Problem {
                piece,
                pixels: &pieces.pixels[piece.pixels.clone()],
                signals: &self.signals,
                edge,
                damped,
            };
            let fit = match problem.pixels.is_empty() {
                true => None,
                false => problem.solve(seen),
            };
            let outcome = Outcome::of(&problem, fit.as_ref(), rough);
            contour.outcomes.push(outcome);
            if let Some(fit) = fit.filter(|_| outcome == Outcome::Accepted) {
                sharpness.add(&fit);
                unexplained += fit.cost - fit.freedom - rough * rough * fit.strength;
                strength += fit.strength;
                contour.points.push(point(&problem, &fit));
                add_face(&problem, &fit, &mut face);
            }
        }
        contour.blur = sharpness.adapted(contour.blur);
        contour.unexplained = match unexplained > 0.0 {
            true => libm::sqrt(unexplained / strength),
            false => 0.0,
        };
        contour.face = (face[0] / face[1], 1.0 / libm::sqrt(face[1]));
    }

    /// Says what became of the contour.
    fn judge<const N: usize>(&self, contour: &mut Contour<N>)
    where
        S: Shape<N>,
    {
        let mut points = contour.points.iter();
        for outcome in &mut contour.outcomes {
            if *outcome == Outcome::Accepted && points.next().is_none_or(|p| p.weight == 0.0) {
                *outcome = Outcome::Outlier;
            }
        }
        let (is_closed, gap) = (self.shape.is_closed(), self.shape.largest_gap());
        (contour.state, contour.found) = state(&contour.outcomes, is_closed, gap);
    }
}

impl<const N: usize> Contour<N> {
    /// By how much the parameters change if every point of the rim lies farther towards the
    /// material by `shift` mm.
    pub fn response(&self, shape: &impl Shape<N>, shift: impl Fn(&Point) -> f64) -> [f64; N] {
        response(
            shape,
            &self.parameters,
            &self.covariance,
            &self.points,
            shift,
        )
    }
}

/// Buffers of a search.
struct Room {
    pieces: Pieces,
    ring: Ring,
    /// How far the contour has moved since its pieces' pixels were gathered, px.
    moved: f64,
    seen: Vec<Seen>,
    damped: Vec<f64>,
    ratios: Vec<f64>,
}

impl Sharpness {
    fn add(&mut self, fit: &Fit) {
        let [ee, es, ss] = fit.matrix;
        self.matrix += ss - es * es / ee;
        self.right += fit.right[1] - es / ee * fit.right[0];
    }

    fn adapted(&self, blur: f64) -> f64 {
        if !(self.matrix > 0.0) {
            return blur;
        }
        let step = (self.right / self.matrix).clamp(-STEP, STEP);
        (blur + step).clamp(BLUR[0], BLUR[1])
    }
}

/// The edge of a piece as a point of the plane. Blur moves what is seen of a curved edge towards
/// its centre of curvature by κσ²/2, dark or bright.
fn point(problem: &Problem<'_, impl View>, fit: &Fit) -> Point {
    let piece = problem.piece;
    let (foot, scale) = (piece.foot, piece.scale);
    let variance = problem.edge.variance();
    let off = fit.edge * scale + foot.curvature * variance * scale * scale / 2.0;
    Point {
        x: foot.x + off * foot.normal.0,
        y: foot.y + off * foot.normal.1,
        variance: fit.variance() * scale * scale,
        weight: 1.0,
    }
}

/// Adds what the phase of the material next to the rim is off the plane's: the sum with weights
/// one over the variance, and the weights.
fn add_face(problem: &Problem<'_, impl View>, fit: &Fit, sums: &mut [f64; 2]) {
    let (mut light, mut count) = (Complex::default(), 0.0);
    for pixel in problem.pixels {
        if (FACE[0]..FACE[1]).contains(&(pixel.d - fit.edge)) {
            light += pixel.light;
            count += 1.0;
        }
    }
    if count > 0.0 {
        let per_turn = TAU * problem.signals.ratio;
        let variance = count * problem.signals.variance;
        let weight = light.square() / variance * per_turn * per_turn;
        sums[0] += weight * light.turns() / problem.signals.ratio;
        sums[1] += weight;
    }
}
