//! Projector points ξ, η on the board: fits to the phases of small windows inside its squares.
//!
//! A window holds about a hundred pixels, so its fit has a tenth of their noise, and it keeps off
//! the edges of the squares, where the camera's blur mixes the phases of bright and dark pixels
//! with unequal weight.

use super::board::{Board, FoundBoard};
use super::corner::Corner;
use crate::math::solve::Normal;
use crate::pipeline::PhaseMap;
use alloc::vec::Vec;

/// Half the side of a window, as a share of the shortest side of its square.
const HALF: f64 = 0.2;
/// Least pixels of a fit with six coefficients.
const LEAST: usize = 24;
/// Least share of a window's pixels that must be resolved under both patterns.
const LEAST_RESOLVED: f64 = 0.6;
/// Pixels more than this many times the RMS off the first fit are left out of the second.
const OUTLIER: f64 = 3.0;

/// The projector point that lights a place of the camera's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Camera column and row, px.
    pub at: (f64, f64),
    /// ξ, η, projector px.
    pub lit_by: (f64, f64),
    /// Column and row of the square that it lies in, between inner corners.
    pub square: (usize, usize),
}

/// What the camera saw of a board under vertical and horizontal fringes of fixed pitch.
#[derive(Clone, Copy, Debug)]
pub struct Fringes<'a> {
    /// Phases under vertical fringes.
    pub vertical: &'a PhaseMap,
    /// Phases under horizontal fringes.
    pub horizontal: &'a PhaseMap,
    /// Projector pixels per fringe of both.
    pub pitch: (f64, f64),
}

impl Fringes<'_> {
    /// ξ and η at a pixel, where both phases are resolved.
    fn at(&self, u: usize, v: usize) -> Option<(f64, f64)> {
        let of = |map: &PhaseMap| {
            let at = v * map.width + u;
            let resolved = u < map.width && map.trust.get(at)?.has_phase();
            resolved.then(|| map.phase[at].turns())
        };
        Some((
            of(self.vertical)? * self.pitch.0,
            of(self.horizontal)? * self.pitch.1,
        ))
    }

    /// The nodes of a board: up to four in each of its squares.
    pub fn nodes(&self, board: &Board, found: &FoundBoard) -> Vec<Node> {
        let mut nodes = Vec::new();
        for row in 0..board.rows.saturating_sub(1) {
            for column in 0..board.columns.saturating_sub(1) {
                let at = row * board.columns + column;
                let square = [at, at + 1, at + board.columns, at + board.columns + 1];
                let [Some(a), Some(b), Some(c), Some(d)] = square.map(|at| found.corners[at])
                else {
                    continue;
                };
                nodes.extend(
                    quarters([a, b, c, d])
                        .into_iter()
                        .filter_map(|(place, half)| self.node(place, half, (column, row))),
                );
            }
        }
        nodes
    }

    fn node(&self, at: (f64, f64), half: f64, square: (usize, usize)) -> Option<Node> {
        let low = |at: f64| libm::ceil((at - half).max(0.0)) as usize;
        let high = |at: f64| libm::floor(at + half) as usize;
        let (columns, rows) = (low(at.0)..=high(at.0), low(at.1)..=high(at.1));
        let all = columns.clone().count() * rows.clone().count();
        let pixels = rows.flat_map(|v| columns.clone().map(move |u| (u, v)));
        let mut samples: Vec<_> = pixels
            .filter_map(|(u, v)| {
                let place = ((u as f64 - at.0) / half, (v as f64 - at.1) / half);
                Some((place, self.at(u, v)?))
            })
            .collect();
        if samples.len() < LEAST.max((LEAST_RESOLVED * all as f64) as usize) {
            return None;
        }
        let (fit, rms) = quadratic(&samples)?;
        samples.retain(|&(place, lit_by)| {
            let (xi, eta) = off(&fit, place, lit_by);
            libm::hypot(xi, eta) <= OUTLIER * rms
        });
        let (fit, _) = quadratic(&samples)?;
        Some(Node {
            at,
            lit_by: (fit[0][0], fit[1][0]),
            square,
        })
    }
}

/// Centres of the four quarters of a square, and half the side of their windows.
fn quarters([a, b, c, d]: [Corner; 4]) -> [((f64, f64), f64); 4] {
    let side = |p: Corner, q: Corner| libm::hypot(p.u - q.u, p.v - q.v);
    let shortest = side(a, b).min(side(c, d)).min(side(a, c)).min(side(b, d));
    [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)].map(|(x, y)| {
        let mix = |a: f64, b: f64, c: f64, d: f64| {
            (a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y
        };
        (
            (mix(a.u, b.u, c.u, d.u), mix(a.v, b.v, c.v, d.v)),
            HALF * shortest,
        )
    })
}

type Sample = ((f64, f64), (f64, f64));

fn terms((x, y): (f64, f64)) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

fn off(fit: &[[f64; 6]; 2], place: (f64, f64), lit_by: (f64, f64)) -> (f64, f64) {
    let terms = terms(place);
    let at = |fit: &[f64; 6]| -> f64 { fit.iter().zip(&terms).map(|(a, b)| a * b).sum() };
    (lit_by.0 - at(&fit[0]), lit_by.1 - at(&fit[1]))
}

/// Least-squares quadratics of ξ and η, and the RMS distance of the samples from them.
fn quadratic(samples: &[Sample]) -> Option<([[f64; 6]; 2], f64)> {
    let of = |lit_by: fn(&Sample) -> f64| {
        Normal::of(samples.iter().map(|s| (terms(s.0), lit_by(s)))).solve()
    };
    let fit = [of(|(_, (xi, _))| *xi)?, of(|(_, (_, eta))| *eta)?];
    let squares: f64 = samples
        .iter()
        .map(|&(place, lit_by)| {
            let (xi, eta) = off(&fit, place, lit_by);
            xi * xi + eta * eta
        })
        .sum();
    Some((fit, libm::sqrt(squares / samples.len() as f64)))
}
