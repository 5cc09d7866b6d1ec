//! What became of a piece of a contour, and of all of them.

use super::fit::{CHI_SQUARE, EdgeFit, Problem};
use super::light::PlaneView;
use super::piece::BAND;
use super::shape::Shape;
use crate::math::complex::Complex;

/// Fewest pixels of a piece.
const PIXELS: usize = 8;
/// An edge this near to the border of the band is not inside it, px.
const MARGIN: f64 = 1.5;
/// Largest σ of an edge, px: more means that there is no contrast.
const SIGMA: f64 = 0.25;
/// Largest angle of the material's light from that of the plane, turns.
const OFF: f64 = 0.125;
/// The share of the taught modulation that a material which goes on has on both sides.
pub const CONTINUES: f64 = 0.8;
/// By so much an edge beside a background as bright as the material must explain its pixels better
/// than a face that goes on, in χ²: noise alone has as much once in 10⁵.
const CLEAR: f64 = 25.0;
/// A background of less light, of the material's, is dark.
const LIT: f64 = 0.1;
/// A narrower shadow does not matter, px: it moves the edge by half of this, less than the model of
/// the edge is uncertain.
const NARROW: f64 = 0.03;
/// Nearer to the contour pixels are mixed, px.
const MIXED: f64 = 1.5;
/// The least share of a contour that is found, of its pieces.
const FOUND: f64 = 0.4;
/// The least share in which the material of an absent contour goes on, of the pieces that could show it, and of all.
const ABSENT: f64 = 0.5;
const ABSENT_OF_ALL: f64 = 0.25;
/// The largest share of pieces with an edge of an absent contour.
const EDGES: f64 = 0.1;

/// What became of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Its edge is a point of the contour.
    Accepted,
    /// The material goes on where it should end.
    Continues,
    /// Too few of its pixels are seen without overexposure.
    Unseen,
    /// The material is too dark, or its light is not in phase with the plane.
    Dark,
    /// There is no contrast, or the edge is not near where it is expected.
    Edgeless,
    /// The pixels do not look like an edge: a shadow's border, another edge.
    Disturbed,
    /// A lit floor, whose depth is not known, may have a narrow shadow beside the edge, which would
    /// be taken for a part of the opening or not.
    Shadowed,
    /// Its edge lies off the contour of the others.
    Outlier,
}

/// What became of a contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It has a place and a size.
    Found,
    /// The material goes on where it should be.
    Absent,
    /// Too little of it is seen, or an edge is elsewhere.
    Unseen,
}

impl Outcome {
    /// Of a piece whose light may be off the model by a share `rough` of the material's.
    pub fn of(problem: &Problem<'_, impl PlaneView>, fit: Option<&EdgeFit>, rough: f64) -> Self {
        if problem.pixels.len() < PIXELS {
            return Self::Unseen;
        }
        let Some(fit) = fit else {
            return Self::edgeless(problem);
        };
        let is_sharp = fit.variance() <= SIGMA * SIGMA;
        if !(is_sharp && libm::fabs(fit.edge) <= BAND - MARGIN) {
            Self::edgeless(problem)
        } else if !(fit.material >= problem.signals.setup.least && fit.off <= OFF) {
            Self::Dark
        } else if fit.background > CONTINUES && problem.face_cost() <= fit.cost + CLEAR {
            // What a face without an edge explains as well is no edge.
            Self::edgeless(problem)
        } else if fit.cost > CHI_SQUARE * (fit.freedom + rough * rough * fit.strength) {
            Self::Disturbed
        } else if problem.signals.setup.floor.is_none()
            && fit.background > LIT
            && problem.piece.shadow * problem.signals.setup.deepest > NARROW
        {
            // Where the material goes on there is no edge that a shadow could lie beside.
            match Self::edgeless(problem) {
                Self::Continues => Self::Continues,
                _ => Self::Shadowed,
            }
        } else {
            Self::Accepted
        }
    }

    /// Whether the material goes on: its light is on both sides as it was taught, in every level.
    fn edgeless(problem: &Problem<'_, impl PlaneView>) -> Self {
        let (signals, setup) = (problem.signals, problem.signals.setup);
        for (level, fringes) in setup.levels.iter().enumerate() {
            let (mut sums, mut counts) = ([Complex::default(); 2], [0.0; 2]);
            for pixel in problem.pixels {
                if libm::fabs(pixel.d) < MIXED || libm::fabs(pixel.d) > BAND {
                    continue;
                }
                let side = usize::from(pixel.d > 0.0);
                if let Some(light) = signals.level(pixel.at, &pixel.spot, level) {
                    sums[side] += light;
                    counts[side] += 1.0;
                }
            }
            for (sum, count) in sums.iter().zip(counts) {
                if count == 0.0 {
                    return Self::Unseen;
                }
                let noise = 2.0 * libm::sqrt(fringes.variance(setup.noise) / count);
                let least = (CONTINUES * fringes.taught - noise).max(setup.least);
                if sum.re / count < least {
                    return match sum.re / count < setup.least {
                        true => Self::Dark,
                        false => Self::Edgeless,
                    };
                }
            }
        }
        Self::Continues
    }
}

/// Whether the material goes on in enough of the pieces that are not hidden. A dark place hides nothing: it may be
/// the opening, elsewhere.
fn is_absent(share: impl Fn(Outcome) -> f64) -> bool {
    let hidden = share(Outcome::Unseen) + share(Outcome::Shadowed);
    let continues = share(Outcome::Continues);
    continues >= ABSENT_OF_ALL && continues >= ABSENT * (1.0 - hidden)
}

/// The state of a contour by its pieces, and the share of pieces with an edge. The material goes on
/// along this share of the contour's normals as far as it is looked for.
pub fn state(outcomes: &[Outcome], shape: &dyn Shape, continues: f64) -> (State, f64) {
    let is_closed = shape.is_closed();
    let count = outcomes.len().max(1) as f64;
    let share = |of: Outcome| outcomes.iter().filter(|&&is| is == of).count() as f64 / count;
    let found = share(Outcome::Accepted);
    // A stretch of a closed contour may begin before its first piece.
    let turns = if is_closed { 2 } else { 1 };
    let (mut missing, mut longest) = (0, 0);
    for outcome in outcomes.iter().cycle().take(outcomes.len() * turns) {
        missing = if *outcome == Outcome::Accepted {
            0
        } else {
            missing + 1
        };
        longest = longest.max(missing);
    }
    let state = if found >= FOUND && longest as f64 <= shape.largest_gap() * count {
        State::Found
    } else if (is_closed || continues >= ABSENT) && is_absent(share) && found <= EDGES {
        // Where the material goes on beyond an edge the part has it elsewhere, unless it goes on as
        // far as the edge may lie.
        State::Absent
    } else {
        State::Unseen
    };
    (state, found)
}
