//! The motion that brings measured points onto the golden surface: iterated, robust linear least squares.
//!
//! A point p that is brought back by a motion lies r = z − G(π(p)) above the golden surface G on its own ray π(p). A
//! further shift τ and turn ω about c change that by −m·(τ + ω × (p − c)), m the facet's lift (point to plane: Y. Chen,
//! G. Medioni, 1992). About one motion the problem is linear, and is solved by reweighting: 6 × 6 normal equations along the
//! directions that the shape determines. Only where the solution leads far from there are residuals and lifts worked out
//! anew; about no motion at all they are known beforehand. Weights are Huber's, then Tukey's (c = 1.345 and 4.685: 95 %
//! efficient for normal errors; P. J. Huber, E. M. Ronchetti, *Robust Statistics*): a dent does not pull the part, and a bend
//! is told from a motion by how many points agree with either. Sums run over the points in their order.

use super::Spot;
use super::directions::{Directions, Six, form};
use super::motion::Motion;
use super::normal::{Normal, TUKEY, Weights};
use super::surface::{Facet, GoldenSurface};
use crate::geometry::Vector;
use alloc::vec::Vec;

/// A measured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Where it is, mm.
    pub point: Vector,
    /// Error of its height, mm (1 σ).
    pub sigma: f64,
    /// The spot of the plan whose pixel sees it, and how far above the spot it lies, mm.
    pub over: Option<(usize, f64)>,
}

/// How a part lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Against how it was taught.
    pub motion: Motion,
    /// Covariance of the motion from measurement to measurement in mm²; turns as the way of a point at the radius.
    pub covariance: Six,
    /// That radius, mm.
    pub radius: f64,
    /// Components that the shape does not determine: they are taken as 0.
    pub left_out: [bool; 6],
    /// Points that agree with the motion.
    pub points: usize,
    /// Share of the points that do not.
    pub outliers: f64,
    /// How far the farthest corner of the part went, mm.
    pub reach: f64,
}

impl Placed {
    /// Component 0 to 5 of the motion and its error (1 σ): shifts in mm, turns in degrees; none if the part's shape does not
    /// determine it.
    pub fn component(&self, component: usize) -> Option<(f64, f64)> {
        let determined = !*self.left_out.get(component)?;
        let value = self.motion.values()[component];
        let sigma = libm::sqrt(self.covariance[component][component].max(0.0));
        determined.then(|| match component {
            0..3 => (value, sigma),
            _ => (value.to_degrees(), (sigma / self.radius).to_degrees()),
        })
    }
}

/// With fewer points there is no motion.
const LEAST_POINTS: usize = 24;
/// Steps with each kind of weight; a step below this many mm ends them sooner: a fiftieth of the noise of the motion.
const STEPS: usize = 8;
const SMALL_STEP_MM: f64 = 1e-4;
/// How often residuals and lifts are worked out, and how far from there the linear problem holds: a surface that is bent
/// as a radius of 2 mm leaves its facet by 0.6 µm there.
const ROUNDS: usize = 8;
const NEAR_MM: f64 = 0.05;
/// With a larger share of points that disagree, the motion is doubted.
const SUSPICIOUS: f64 = 0.05;
/// From the median of absolute deviations to σ of a normal distribution.
const MEDIAN_TO_SIGMA: f64 = 1.4826;

/// A point of the linear problem.
#[derive(Debug)]
pub(super) struct Row {
    /// About the motion that the problem is linear about, mm.
    pub residual: f64,
    /// What a further motion takes off it, see [`Fitting::row`].
    pub row: [f64; 6],
    /// Error of the lift, and the lever of the point.
    pub lift_noise: f64,
    pub lever: Vector,
    /// Variance of the point's height, and of that with the surface's, mm².
    pub variance: f64,
    pub both: f64,
}

impl Row {
    /// What a further motion leaves of the residual.
    pub fn left(&self, further: &[f64; 6]) -> f64 {
        let taken: f64 = self.row.iter().zip(further).map(|(r, x)| r * x).sum();
        self.residual - taken
    }
}

/// Room for a fit, for the next one to use again.
#[derive(Debug, Default)]
pub struct Room {
    rows: Vec<Row>,
    sizes: Vec<f64>,
}

/// What the fit needs of the part.
#[derive(Clone, Copy, Debug)]
pub struct Fitting<'a> {
    /// The surface to be met.
    pub golden: GoldenSurface<'a>,
    /// The point that is turned about.
    pub centre: Vector,
    /// Typical distance of the surface from it, mm: turns weigh as the way of a point there.
    pub radius: f64,
    /// Corners of a box around the part.
    pub corners: &'a [Vector],
    /// Where it is looked at.
    pub spots: &'a [Spot],
}

/// Where a descent ended, and the largest residual of a point that agrees, mm.
struct Descended {
    placed: Placed,
    limit: f64,
}

/// A solution of the linear problem.
struct Solved {
    further: [f64; 6],
    directions: Directions,
    normal: Normal,
    scale: f64,
}

impl Fitting<'_> {
    /// The motion; none if too few points lie on the surface.
    ///
    /// Where many points disagree, a bent part may have been taken for a moved one: what then agrees better with a part that
    /// lies about as it was taught is taken to lie so.
    pub fn fit(&self, samples: &[Sample], room: &mut Room) -> Option<Placed> {
        let moved = self.descend(Weights::Huber, samples, room)?;
        if moved.placed.outliers <= SUSPICIOUS {
            return Some(moved.placed);
        }
        let Some(bent) = self.descend(Weights::Tukey, samples, room) else {
            return Some(moved.placed);
        };
        let limit = moved.limit.min(bent.limit);
        let mut agreeing = |motion: &Motion| {
            self.linearise(samples, motion, false, &mut room.rows);
            let agrees = |row: &&Row| libm::fabs(row.residual) < limit;
            room.rows.iter().filter(agrees).count()
        };
        let found = match agreeing(&bent.placed.motion) > agreeing(&moved.placed.motion) {
            true => bent,
            false => moved,
        };
        Some(found.placed)
    }

    /// The motion that is found from none at all, beginning with these weights.
    fn descend(
        &self,
        mut weights: Weights,
        samples: &[Sample],
        room: &mut Room,
    ) -> Option<Descended> {
        let mut motion = Motion::none(self.centre);
        for round in 1..=ROUNDS {
            self.linearise(samples, &motion, round == 1, &mut room.rows);
            if room.rows.len() < LEAST_POINTS {
                return None;
            }
            let mut solved = solve(weights, [0.0; 6], room);
            if weights == Weights::Huber && (is_near(&solved.further) || 2 * round >= ROUNDS) {
                weights = Weights::Tukey;
                solved = solve(weights, solved.further, room);
            }
            motion = self.then(&motion, &solved.further);
            let found = weights == Weights::Tukey && is_near(&solved.further);
            if found || round == ROUNDS {
                return Some(Descended {
                    placed: self.placed(motion, &solved, &room.rows),
                    limit: TUKEY * solved.scale,
                });
            }
        }
        None
    }

    /// A motion with a further one on top.
    fn then(&self, motion: &Motion, further: &[f64; 6]) -> Motion {
        let [x, y, z, a, b, c] = *further;
        let turn = Vector::new(a, b, c) * (1.0 / self.radius);
        let shift = Vector::new(x, y, z);
        Motion::new(self.centre, motion.shift + shift, motion.turn + turn)
    }

    fn placed(&self, motion: Motion, solved: &Solved, rows: &[Row]) -> Placed {
        let spread = Normal::covariance(rows, &solved.further, solved.scale);
        let farthest = |corner: &Vector| (motion.apply(*corner) - *corner).length();
        let inside = solved.normal.inside;
        Placed {
            motion,
            covariance: solved.directions.covariance(&spread),
            radius: self.radius,
            left_out: solved.directions.left_out,
            points: inside,
            outliers: 1.0 - inside as f64 / rows.len() as f64,
            reach: self.corners.iter().map(farthest).fold(0.0, f64::max),
        }
    }

    /// −∂r/∂x of a facet at a point: what a shift and a turn (as the way at the radius) take off its residual.
    pub fn row(&self, lift: Vector, point: Vector) -> [f64; 6] {
        let turning = (point - self.centre).cross(lift) * (1.0 / self.radius);
        [lift.x, lift.y, lift.z, turning.x, turning.y, turning.z]
    }

    /// Variance, mm², of how far the error of a motion lifts a facet at a point.
    pub fn lift_variance(&self, placed: &Placed, lift: Vector, point: Vector) -> f64 {
        let row = self.row(lift, point);
        form(&row, &placed.covariance, &row).max(0.0)
    }

    /// The linear problem about a motion; `still` where that is the part as taught.
    fn linearise(&self, samples: &[Sample], motion: &Motion, still: bool, rows: &mut Vec<Row>) {
        rows.clear();
        rows.extend(samples.iter().filter_map(|sample| {
            if let (true, Some((at, above))) = (still, sample.over) {
                let spot = self.spots.get(at)?;
                return Some(self.of_facet(sample, &spot.facet, spot.point, above));
            }
            let point = motion.undo(sample.point);
            let seen = self.golden.triangulator.camera().project(point)?;
            let above = point.z - self.golden.height_at(seen.0, seen.1)?;
            let facet = self.golden.quiet_facet(point, seen)?;
            Some(self.of_facet(sample, &facet, point, above))
        }));
    }

    fn of_facet(&self, sample: &Sample, facet: &Facet, point: Vector, above: f64) -> Row {
        let variance = sample.sigma * sample.sigma;
        Row {
            residual: above,
            row: self.row(facet.lift, point),
            lift_noise: facet.lift_noise,
            lever: (point - self.centre) * (1.0 / self.radius),
            variance,
            both: variance + facet.sigma * facet.sigma,
        }
    }
}

/// Solves the linear problem by reweighting, from a first guess.
fn solve(weights: Weights, guess: [f64; 6], room: &mut Room) -> Solved {
    let Room { rows, sizes } = room;
    let predicted = rows.iter().map(|row| row.both).sum::<f64>() / rows.len() as f64;
    let predicted = libm::sqrt(predicted);
    let mut further = guess;
    let mut left = STEPS;
    loop {
        let scale = scale(rows, &further, sizes).max(predicted);
        let normal = Normal::of(rows, weights, &further, scale);
        let directions = Directions::of(&normal.matrix, &normal.noise, predicted);
        let next = directions.solve(&normal.right);
        let change: f64 = next
            .iter()
            .zip(further)
            .map(|(a, b)| (a - b) * (a - b))
            .sum();
        further = next;
        left -= 1;
        if left == 0 || libm::sqrt(change) < SMALL_STEP_MM {
            return Solved {
                further,
                directions,
                normal,
                scale,
            };
        }
    }
}

/// Whether the linear problem still holds after a further motion.
fn is_near(further: &[f64; 6]) -> bool {
    further.iter().map(|x| x * x).sum::<f64>() < NEAR_MM * NEAR_MM
}

/// σ of the residuals by their median.
fn scale(rows: &[Row], further: &[f64; 6], sizes: &mut Vec<f64>) -> f64 {
    sizes.clear();
    sizes.extend(rows.iter().map(|row| libm::fabs(row.left(further))));
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    MEDIAN_TO_SIGMA * *median
}
