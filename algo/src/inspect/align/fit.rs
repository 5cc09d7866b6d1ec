//! The motion that brings measured points onto the golden surface: iterated, robust linear least squares.
//!
//! A point p that is brought back by a motion lies r = z − G(π(p)) above the golden surface G on its own ray π(p). A
//! further shift τ and turn ω about c change that by −m·(τ + ω × (p − c)), m the facet's lift (point to plane: Y. Chen,
//! G. Medioni, 1992). Each step solves the 6 × 6 normal equations along the directions that the shape determines. Weights
//! are Huber's, then Tukey's (c = 1.345 and 4.685: 95 % efficient for normal errors; P. J. Huber, E. M. Ronchetti,
//! *Robust Statistics*): a dent does not pull the part. Sums run over the points in their order.

use super::directions::{Directions, Six};
use super::motion::Motion;
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
/// Where Huber's weights begin to fall, and where Tukey's are 0, in σ of the residuals.
const HUBER: f64 = 1.345;
const TUKEY: f64 = 4.685;
/// From the median of absolute deviations to σ of a normal distribution.
const MEDIAN_TO_SIGMA: f64 = 1.4826;

#[derive(Clone, Copy, PartialEq)]
enum Weights {
    Huber,
    Tukey,
}

impl Weights {
    /// Of a residual in σ.
    fn of(self, residual: f64) -> f64 {
        let size = libm::fabs(residual);
        match self {
            Self::Huber if size <= HUBER => 1.0,
            Self::Huber => HUBER / size,
            Self::Tukey if size >= TUKEY => 0.0,
            Self::Tukey => {
                let rest = 1.0 - (size / TUKEY) * (size / TUKEY);
                rest * rest
            }
        }
    }
}

/// A point as a step sees it: its residual and how that depends on the motion.
#[derive(Debug)]
struct Row {
    residual: f64,
    row: [f64; 6],
    /// Error of the lift, and the lever of the point.
    lift_noise: f64,
    lever: Vector,
    /// Variance of the point's height, and of that with the surface's, mm².
    variance: f64,
    both: f64,
}

/// Room for a fit, for the next one to use again.
#[derive(Debug, Default)]
pub struct Room {
    rows: Vec<Row>,
    facets: Vec<Option<Facet>>,
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
}

impl Fitting<'_> {
    /// The motion; none if too few points lie on the surface.
    pub fn fit(&self, samples: &[Sample], room: &mut Room) -> Option<Placed> {
        let mut motion = Motion::none(self.centre);
        let Room {
            rows,
            facets,
            sizes,
        } = room;
        facets.clear();
        facets.resize(samples.len(), None);
        let mut last = None;
        for weights in [Weights::Huber, Weights::Tukey] {
            for step in 0..STEPS {
                if weights == Weights::Huber && step % 3 == 0 || step == 0 {
                    self.face(samples, &motion, facets);
                }
                self.rows(samples, facets, &motion, rows);
                if rows.len() < LEAST_POINTS {
                    return None;
                }
                let predicted = rows.iter().map(|row| row.both).sum::<f64>() / rows.len() as f64;
                let predicted = libm::sqrt(predicted);
                let scale = scale(rows, sizes).max(predicted);
                let normal = Normal::of(rows, weights, scale);
                let directions = Directions::of(&normal.matrix, &normal.noise, predicted);
                let step = directions.solve(&normal.right);
                let turn = Vector::new(step[3], step[4], step[5]) * (1.0 / self.radius);
                let shift = Vector::new(step[0], step[1], step[2]);
                motion = Motion::new(self.centre, motion.shift + shift, motion.turn + turn);
                let size = libm::sqrt(step.iter().map(|x| x * x).sum::<f64>());
                last = Some((directions, normal));
                if size < SMALL_STEP_MM {
                    break;
                }
            }
        }
        let (directions, normal) = last?;
        let farthest = |corner: &Vector| (motion.apply(*corner) - *corner).length();
        Some(Placed {
            motion,
            covariance: directions.covariance(&normal.covariance),
            radius: self.radius,
            left_out: directions.left_out,
            points: normal.inside,
            outliers: 1.0 - normal.inside as f64 / rows.len() as f64,
            reach: self.corners.iter().map(farthest).fold(0.0, f64::max),
        })
    }

    /// −∂r/∂x of a facet at a point: what a shift and a turn (as the way at the radius) take off its residual.
    pub fn row(&self, lift: Vector, point: Vector) -> [f64; 6] {
        let turning = (point - self.centre).cross(lift) * (1.0 / self.radius);
        [lift.x, lift.y, lift.z, turning.x, turning.y, turning.z]
    }

    /// How the surface faces where each point is seen.
    fn face(&self, samples: &[Sample], motion: &Motion, facets: &mut [Option<Facet>]) {
        for (sample, facet) in samples.iter().zip(facets) {
            let point = motion.undo(sample.point);
            let seen = self.golden.triangulator.camera().project(point);
            *facet = seen.and_then(|at| self.golden.facet(point, at));
        }
    }

    fn rows(
        &self,
        samples: &[Sample],
        facets: &[Option<Facet>],
        motion: &Motion,
        rows: &mut Vec<Row>,
    ) {
        rows.clear();
        let row = |(sample, facet): (&Sample, &Option<Facet>)| {
            let facet = (*facet)?;
            let point = motion.undo(sample.point);
            let variance = sample.sigma * sample.sigma;
            Some(Row {
                residual: self.golden.above(point)?,
                row: self.row(facet.lift, point),
                lift_noise: facet.lift_noise,
                lever: (point - self.centre) * (1.0 / self.radius),
                variance,
                both: variance + facet.sigma * facet.sigma,
            })
        };
        rows.extend(samples.iter().zip(facets).filter_map(row));
    }
}

/// σ of the residuals by their median.
fn scale(rows: &[Row], sizes: &mut Vec<f64>) -> f64 {
    sizes.clear();
    sizes.extend(rows.iter().map(|row| libm::fabs(row.residual)));
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    MEDIAN_TO_SIGMA * *median
}

/// The normal equations of one step.
struct Normal {
    matrix: Six,
    right: [f64; 6],
    /// What errors of the lifts add to the matrix.
    noise: Six,
    /// Covariance of the right side.
    covariance: Six,
    /// Points with a weight.
    inside: usize,
}

impl Normal {
    fn of(rows: &[Row], weights: Weights, scale: f64) -> Self {
        let mut normal = Self {
            matrix: [[0.0; 6]; 6],
            right: [0.0; 6],
            noise: [[0.0; 6]; 6],
            covariance: [[0.0; 6]; 6],
            inside: 0,
        };
        for row in rows {
            let weight = weights.of(row.residual / scale);
            normal.inside += usize::from(weights.of(row.residual / scale) > 0.0);
            let noise = weight * row.lift_noise * row.lift_noise;
            let (q, r) = (row.lever, &row.row);
            // What m gains in x and in y, as rows.
            let x = [1.0, 0.0, 0.0, 0.0, q.z, -q.y];
            let y = [0.0, 1.0, 0.0, -q.z, 0.0, q.x];
            for i in 0..6 {
                normal.right[i] += weight * row.residual * r[i];
                for j in 0..6 {
                    let square = r[i] * r[j];
                    normal.matrix[i][j] += weight * square;
                    normal.covariance[i][j] += weight * weight * row.variance * square;
                    normal.noise[i][j] += noise * (x[i] * x[j] + y[i] * y[j]);
                }
            }
        }
        normal
    }
}
