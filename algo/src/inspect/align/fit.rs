//! The motion that brings measured points onto the golden surface: iterated, robust linear least
//! squares.
//!
//! # Idea
//! Iteratively reweighted least squares of residuals along the camera's rays: a dent does not pull
//! the part, and a bend is told from a motion by how many points agree with either.
//!
//! # Equations
//! A point p, after a motion is taken back, lies r = z − G(π(p)) above the golden surface G on its
//! own ray π(p). A further shift τ and turn ω about c change that by −m·(τ + ω × (p − c)), m the
//! facet's lift (point to plane: Y. Chen, G. Medioni, 1992). About one motion the problem is
//! linear: 6 × 6 normal equations, solved along the directions that the shape determines. Residuals
//! and lifts are worked out anew only where the solution leads far from that motion; about no
//! motion at all they are planned beforehand. Weights are Huber's, then Tukey's (c = 1.345 and
//! 4.685: 95 % efficient for normal errors; P. J. Huber, E. M. Ronchetti, *Robust Statistics*).
//!
//! # Shapes and units
//! The unknowns are shifts in mm and turns as the way, in mm, of a point at the part's radius. Sums
//! run over the points in their order.
//!
//! # Accuracy
//! `a_motion_of_a_shape_that_determines_it_is_found_in_all_six_components`,
//! `a_dent_over_a_tenth_of_the_part_does_not_pull_it`.

use super::directions::{Directions, Matrix6, form};
use super::equations::{Equation, Equations, TUKEY, WeightFunction};
use super::motion::Motion;
use super::surface::{Alignment, Facet, GoldenSurface};
use crate::geometry::Vector;

/// A measured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightSample {
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
    /// The motion from where it was taught.
    pub motion: Motion,
    /// Covariance of the motion over repeated measurements, mm²; turns as the way of a point at the
    /// radius.
    pub covariance: Matrix6,
    /// The part's radius, mm.
    pub radius: f64,
    /// Components that neither the shape nor contours determine: they are taken as 0, or are `steered`.
    pub left_out: [bool; 6],
    /// The directions that are not determined: unit vectors in the coordinates of the
    /// covariance, which is 0 along them though their variance is infinite. What depends on them is
    /// not known.
    pub free: heapless::Vec<[f64; 6], 6>,
    /// Whether the picture or contours say how far the part is moved along directions that its shape leaves open, so
    /// that regions follow; else it is taken not to be.
    pub steered: bool,
    /// Points that agree with the motion.
    pub points: usize,
    /// Share of the points that do not.
    pub outliers: f64,
    /// How far the motion takes the corner of the part's box that it takes farthest, mm: of all
    /// motions that differ along directions that the shape does not determine, the one that takes
    /// it least far.
    pub reach: f64,
    /// The error of that way, mm (1 σ).
    pub reach_sigma: f64,
}

impl Placed {
    /// A part that lies as taught and turns about this point, 50 mm large.
    #[cfg(test)]
    pub fn lying(centre: Vector, covariance: Matrix6) -> Self {
        Self {
            motion: Motion::none(centre),
            covariance,
            radius: 50.0,
            left_out: [false; 6],
            free: heapless::Vec::new(),
            steered: false,
            points: 100,
            outliers: 0.0,
            reach: 0.0,
            reach_sigma: 0.0,
        }
    }

    /// Component 0 to 5 of the motion and its error (1 σ): shifts in mm, turns in degrees; none if
    /// the part's shape does not determine it.
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

/// Fewer points determine no motion.
const LEAST_POINTS: usize = 24;
/// Reweightings with each kind of weight, and the change of the solution below which they end: a
/// fiftieth of the noise of the motion.
const REWEIGHTINGS: usize = 8;
const SMALL_CHANGE_MM: f64 = 1e-4;
/// How often the problem is linearised, and how far from there it is taken to be linear: a surface
/// with a radius of curvature of 2 mm is 0.6 µm off its facet there.
const ROUNDS: usize = 8;
const NEAR_MM: f64 = 0.05;
/// Corners of a box, and halvings until the least farthest way is known to a thousandth.
const CORNERS: usize = 8;
const HALVINGS: usize = 10;
/// With a larger share of outliers a bent part may have been taken for a moved one.
const SUSPICIOUS: f64 = 0.05;

/// The fit of measured points to a part.
#[derive(Clone, Copy, Debug)]
pub struct Fitting<'a> {
    /// The surface to be met.
    pub golden: GoldenSurface<'a>,
    /// At which spots the surface is measured, and the point that motions turn about.
    pub plan: &'a Alignment,
}

/// Where a descent ended.
struct Descended {
    placed: Placed,
    /// The largest residual of a point that agrees, mm.
    limit: f64,
}

/// A solution of the linear problem.
struct SolvedMotion {
    further: [f64; 6],
    directions: Directions,
    /// σ of the residuals, mm.
    scale: f64,
    /// Points with a weight above 0.
    inside: usize,
}

impl Fitting<'_> {
    /// How the part lies; none if too few points lie on the surface. The fit begins with the motion
    /// `from`, without one if `None`; along directions that the shape does not determine it is kept.
    ///
    /// Where many points disagree, a bent part may have been taken for a moved one: a second
    /// descent with Tukey's weights alone stays near the part as taught, and the motion with which
    /// more points agree is taken.
    pub fn fit(
        &self,
        from: Option<Motion>,
        samples: &[HeightSample],
        equations: &mut Equations,
    ) -> Option<Placed> {
        let moved = self.descend(WeightFunction::Huber, from, samples, equations)?;
        if moved.placed.outliers <= SUSPICIOUS {
            return Some(moved.placed);
        }
        let Some(bent) = self.descend(WeightFunction::Tukey, from, samples, equations) else {
            return Some(moved.placed);
        };
        let limit = moved.limit.min(bent.limit);
        let mut agreeing = |motion: &Motion| {
            self.linearise(samples, motion, false, equations);
            equations.agreeing(limit)
        };
        let found = match agreeing(&bent.placed.motion) > agreeing(&moved.placed.motion) {
            true => bent,
            false => moved,
        };
        Some(found.placed)
    }

    /// The motion that is found from the motion `from`, beginning with these weights.
    fn descend(
        &self,
        mut weights: WeightFunction,
        from: Option<Motion>,
        samples: &[HeightSample],
        equations: &mut Equations,
    ) -> Option<Descended> {
        let mut motion = from.unwrap_or(Motion::none(self.plan.centre));
        for round in 1..=ROUNDS {
            let still = round == 1 && from.is_none();
            self.linearise(samples, &motion, still, equations);
            if equations.len() < LEAST_POINTS {
                return None;
            }
            let mut solved = self.solve(weights, [0.0; 6], equations);
            if weights == WeightFunction::Huber && (is_near(&solved.further) || 2 * round >= ROUNDS)
            {
                weights = WeightFunction::Tukey;
                solved = self.solve(weights, solved.further, equations);
            }
            motion = self.then(&motion, &solved.further);
            let found = weights == WeightFunction::Tukey && is_near(&solved.further);
            if found || round == ROUNDS {
                return Some(Descended {
                    placed: self.placed(motion, &solved, equations),
                    limit: TUKEY * solved.scale,
                });
            }
        }
        None
    }

    /// A motion followed by a further one.
    pub fn then(&self, motion: &Motion, further: &[f64; 6]) -> Motion {
        let [x, y, z, a, b, c] = *further;
        let turn = Vector::new(a, b, c) * (1.0 / self.plan.radius);
        let shift = Vector::new(x, y, z);
        Motion::new(self.plan.centre, motion.shift + shift, motion.turn + turn)
    }

    fn placed(&self, motion: Motion, solved: &SolvedMotion, equations: &mut Equations) -> Placed {
        let spread = equations.covariance(&solved.further, solved.scale);
        let covariance = solved.directions.covariance(&spread);
        let (reach, reach_sigma) = self.reach(&motion, &solved.directions.free, &covariance);
        Placed {
            motion,
            covariance,
            radius: self.plan.radius,
            left_out: solved.directions.left_out,
            free: solved.directions.free.clone(),
            steered: false,
            points: solved.inside,
            outliers: 1.0 - solved.inside as f64 / equations.len() as f64,
            reach,
            reach_sigma,
        }
    }

    /// The same where the directions that the shape leaves open are determined otherwise, with this covariance along them.
    pub fn determined(&self, placed: &Placed, along_open: &Matrix6) -> Placed {
        let sum = |i: usize, j: usize| placed.covariance[i][j] + along_open[i][j];
        let covariance = core::array::from_fn(|i| core::array::from_fn(|j| sum(i, j)));
        let (reach, reach_sigma) = self.reach(&placed.motion, &[], &covariance);
        Placed {
            covariance,
            left_out: [false; 6],
            free: heapless::Vec::new(),
            steered: true,
            reach,
            reach_sigma,
            ..placed.clone()
        }
    }

    /// See [`Placed::reach`], and its σ; `free` are the directions that the shape does not
    /// determine.
    fn reach(&self, motion: &Motion, free: &[[f64; 6]], covariance: &Matrix6) -> (f64, f64) {
        let mut ways: heapless::Vec<Vector, CORNERS> = heapless::Vec::new();
        let corners = self.plan.corners.iter();
        ways.extend(corners.map(|corner| motion.apply(*corner) - *corner));
        let farthest = |ways: &[Vector]| ways.iter().map(|way| way.length()).fold(0.0, f64::max);
        let mut reach = farthest(&ways);
        // The farthest way is a convex function of the share of each direction: the interval about
        // its least value is halved, direction by direction.
        let mut step = reach / 2.0;
        for _ in 0..HALVINGS {
            for direction in free {
                for share in [-step, step] {
                    let mut moved = ways.clone();
                    for (way, corner) in moved.iter_mut().zip(&self.plan.corners) {
                        *way = *way + self.way(direction, *corner) * share;
                    }
                    let found = farthest(&moved);
                    if found < reach {
                        (ways, reach) = (moved, found);
                        break;
                    }
                }
            }
            step /= 2.0;
        }
        let far = ways.iter().zip(&self.plan.corners);
        let Some((way, corner)) = far.max_by(|a, b| a.0.length().total_cmp(&b.0.length())) else {
            return (reach, 0.0);
        };
        let towards = *way * (1.0 / reach.max(f64::MIN_POSITIVE));
        let along = |axis: usize| {
            let unit = core::array::from_fn(|i| if i == axis { 1.0 } else { 0.0 });
            self.way(&unit, *corner).dot(towards)
        };
        let g = core::array::from_fn(along);
        (reach, libm::sqrt(form(&g, covariance, &g).max(0.0)))
    }

    /// How far a small motion takes a point.
    pub fn way(&self, &[x, y, z, a, b, c]: &[f64; 6], point: Vector) -> Vector {
        let turn = Vector::new(a, b, c) * (1.0 / self.plan.radius);
        Vector::new(x, y, z) + turn.cross(point - self.plan.centre)
    }

    /// Variance, mm², of how far the error of a motion lifts a facet at a point.
    pub fn lift_variance(&self, placed: &Placed, facet: &Facet, point: Vector) -> f64 {
        let jacobian = facet.jacobian(point, (self.plan.centre, self.plan.radius));
        form(&jacobian, &placed.covariance, &jacobian).max(0.0)
    }

    /// The linear problem about a motion; `still` if the part lies as taught, for which facets are
    /// planned.
    fn linearise(
        &self,
        samples: &[HeightSample],
        motion: &Motion,
        still: bool,
        equations: &mut Equations,
    ) {
        equations.clear();
        for sample in samples {
            if let Some(equation) = self.equation(sample, motion, still) {
                equations.push(equation);
            }
        }
    }

    fn equation(&self, sample: &HeightSample, motion: &Motion, still: bool) -> Option<Equation> {
        if let (true, Some((at, above))) = (still, sample.over) {
            let spot = self.plan.spots.get(at)?;
            return Some(self.of_facet(sample, &spot.facet, spot.point, above));
        }
        let point = motion.undo(sample.point);
        let seen = self.golden.triangulator.camera().project(point)?;
        let above = point.z - self.golden.height_at(seen.0, seen.1)?;
        let facet = self.golden.quiet_facet(point, seen)?;
        Some(self.of_facet(sample, &facet, point, above))
    }

    fn of_facet(
        &self,
        sample: &HeightSample,
        facet: &Facet,
        point: Vector,
        above: f64,
    ) -> Equation {
        let variance = sample.sigma * sample.sigma;
        Equation {
            residual: above,
            jacobian: facet.jacobian(point, (self.plan.centre, self.plan.radius)),
            lift_variance: facet.lift_variance,
            lever: (point - self.plan.centre) * (1.0 / self.plan.radius),
            variance,
            both: variance + facet.sigma * facet.sigma,
        }
    }

    /// Solves the linear problem by reweighting, from a first guess.
    fn solve(
        &self,
        weights: WeightFunction,
        guess: [f64; 6],
        equations: &mut Equations,
    ) -> SolvedMotion {
        let predicted = equations.predicted();
        let mut further = guess;
        let mut left = REWEIGHTINGS;
        loop {
            let scale = equations.weigh(weights, &further, predicted);
            let sums = equations.sums();
            let directions = Directions::of(&sums.matrix(), &sums.lift_noise(), predicted);
            let next = directions.solve(&sums.right_side());
            let change: f64 = next
                .iter()
                .zip(further)
                .map(|(a, b)| (a - b) * (a - b))
                .sum();
            further = next;
            left -= 1;
            if left == 0 || libm::sqrt(change) < SMALL_CHANGE_MM {
                return SolvedMotion {
                    further,
                    directions,
                    scale,
                    inside: equations.inside(),
                };
            }
        }
    }
}

/// Whether the linear problem still holds after a further motion.
fn is_near(further: &[f64; 6]) -> bool {
    further.iter().map(|x| x * x).sum::<f64>() < NEAR_MM * NEAR_MM
}
