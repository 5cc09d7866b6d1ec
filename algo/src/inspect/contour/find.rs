//! A contour from pixels: pieces about where it is expected, their edges, the shape through them,
//! and again about that, until nothing moves.

use super::edge::Edge;
use super::fit::{Buffers, Fit, Problem};
use super::piece::{BAND, Pieces, pixel_size};
use super::sample::Samples;
use super::shape::Shape;
use super::verdict::{Outcome, State, state};
use super::view::{Setup, View};
use crate::math::associate::{Point, associate, response};
use alloc::vec::Vec;

/// Blur of the camera that is looked for, σ in px.
const BLUR: [f64; 2] = [0.3, 2.5];
/// With which the search begins.
const FIRST_BLUR: f64 = 0.6;
/// Rounds at most.
const ROUNDS: usize = 12;
/// Less movement of any place of the contour ends the search, px.
const STILL: f64 = 0.002;
/// Less change of the blur ends the search, px.
const SHARP: f64 = 0.02;
/// After less movement, px, pieces are judged by their noise only.
const NEAR: f64 = 0.02;
/// The same for the change of the blur, px.
const SHARPER: f64 = 0.05;
/// What light may be off the model until the contour's place and the blur are known, of the
/// material's.
const ROUGH: f64 = 0.1;
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
    let search = Search {
        shape,
        view,
        setup,
        expected,
    };
    if let Some(thickness) = setup.thickness {
        return search.run(thickness);
    }
    let mut thin = search.run(0.0);
    let thick = search.run(THICK * BAND * thin.pixel);
    if thin.state == State::Found && thick.state == State::Found {
        let mut half = [0.0; N];
        for ((half, thin), thick) in half
            .iter_mut()
            .zip(&mut thin.parameters)
            .zip(thick.parameters)
        {
            *half = (thick - *thin) / 2.0;
            *thin += *half;
        }
        thin.wall = Some(half);
    }
    thin
}

/// A search for a contour.
struct Search<'a, const N: usize, S, V> {
    shape: &'a S,
    view: &'a V,
    setup: &'a Setup,
    expected: &'a [f64; N],
}

/// How the blur would have to change, from all pieces.
#[derive(Clone, Copy, Debug, Default)]
struct Sharpness {
    matrix: f64,
    right: f64,
}

impl<const N: usize, S: Shape<N>, V: View> Search<'_, N, S, V> {
    fn run(&self, thickness: f64) -> Contour<N> {
        let mut contour = Contour {
            state: State::Unseen,
            found: 0.0,
            parameters: *self.expected,
            covariance: [[0.0; N]; N],
            blur: FIRST_BLUR,
            pixel: 0.0,
            points: Vec::new(),
            outcomes: Vec::new(),
            face: (0.0, f64::INFINITY),
            wall: None,
        };
        let middle = self.shape.foot(self.expected, 0.0);
        let Some(pixel) = pixel_size(self.view, (middle.x, middle.y)) else {
            return contour;
        };
        contour.pixel = pixel;
        let reach = self.setup.reach / pixel;
        let about = (self.shape, self.expected);
        let looked = (BAND + 2.0 * reach + 2.0) * pixel;
        let samples = Samples::about(about, self.view, self.setup, looked);
        let mut room = Room::default();
        // The first time the edge may lie anywhere within reach.
        let (mut reach, mut rough) = (reach, ROUGH);
        for _ in 0..ROUNDS {
            let before = (contour.parameters, contour.blur);
            let limits = (reach, rough);
            self.look(&mut contour, thickness, &samples, limits, &mut room);
            let shape = self.shape;
            let points = &mut contour.points;
            let found = associate(shape, &mut contour.parameters, points, &mut room.ratios);
            let Some(covariance) = found else {
                contour.parameters = before.0;
                break;
            };
            contour.covariance = covariance;
            let mut moved = 0.0_f64;
            for point in &contour.points {
                let d = |p| shape.distance(p, point.x, point.y);
                moved = moved.max(libm::fabs(d(&contour.parameters) - d(&before.0)));
            }
            let sharper = libm::fabs(contour.blur - before.1);
            let is_still = moved < STILL * pixel && sharper < SHARP;
            if is_still && rough == 0.0 {
                break;
            }
            if is_still || moved < NEAR * pixel && sharper < SHARPER {
                rough = 0.0;
            }
            reach = 0.0;
        }
        self.judge(&mut contour);
        contour
    }

    /// Divides the contour into pieces, fits their edges, makes points of them, and adapts the
    /// blur.
    fn look(
        &self,
        contour: &mut Contour<N>,
        thickness: f64,
        samples: &Samples,
        (reach, rough): (f64, f64),
        room: &mut Room,
    ) {
        let band = BAND + reach;
        room.pieces.divide(
            (self.shape, &contour.parameters),
            self.view,
            (self.setup, thickness),
            samples,
            (contour.pixel, band),
        );
        contour.points.clear();
        contour.outcomes.clear();
        let (mut sharpness, mut face) = (Sharpness::default(), [0.0; 2]);
        for piece in &room.pieces.all {
            let problem = Problem {
                piece,
                pixels: &room.pieces.pixels[piece.pixels.clone()],
                samples,
                setup: self.setup,
                blur: contour.blur,
            };
            let fit = match problem.pixels.is_empty() {
                true => None,
                false => problem.solve(reach, &mut room.fit),
            };
            let outcome = Outcome::of(&problem, fit.as_ref(), (band, rough));
            contour.outcomes.push(outcome);
            if let Some(fit) = fit.filter(|_| outcome == Outcome::Accepted) {
                sharpness.add(&fit);
                contour.points.push(point(&problem, &fit));
                add_face(&problem, &fit, &mut face);
            }
        }
        contour.blur = sharpness.adapted(contour.blur);
        contour.face = (face[0] / face[1], 1.0 / libm::sqrt(face[1]));
    }

    /// Says what became of the contour.
    fn judge(&self, contour: &mut Contour<N>) {
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
#[derive(Default)]
struct Room {
    pieces: Pieces,
    fit: Buffers,
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
        let step = (self.right / self.matrix).clamp(-0.3, 0.3);
        (blur + step).clamp(BLUR[0], BLUR[1])
    }
}

/// The edge of a piece as a point of the plane. Blur moves what is seen of a curved edge towards
/// its centre of curvature by κσ²/2, dark or bright.
fn point(problem: &Problem<'_>, fit: &Fit) -> Point {
    let piece = problem.piece;
    let (foot, scale) = (piece.foot, piece.scale);
    let variance = Edge::new(piece.normal, problem.blur).variance();
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
fn add_face(problem: &Problem<'_>, fit: &Fit, sums: &mut [f64; 2]) {
    for (level, fringes) in problem.setup.levels.iter().enumerate() {
        let variance = fringes.variance(problem.setup.noise);
        for pixel in problem.pixels {
            let d = pixel.d - fit.edge;
            if (FACE[0]..FACE[1]).contains(&d) {
                let light = problem.samples.light(pixel.sample, level);
                let per_turn = core::f64::consts::TAU * fringes.ratio;
                let weight = light.square() / variance * per_turn * per_turn;
                sums[0] += weight * light.turns() / fringes.ratio;
                sums[1] += weight;
            }
        }
    }
}
