//! One pose of the board: its points in the projector's raster, whether it can be used, and if not,
//! why.
//!
//! Projector points ξ, η are fits to the phases of small windows inside the board's squares. A
//! window holds about a hundred pixels, so its fit has a tenth of their noise, and it keeps off the
//! edges of the squares, where the camera's blur mixes the phases of bright and dark pixels with
//! unequal weight.

use super::board::{Board, BoardError, FoundBoard};
use super::candidates::GreyPicture;
use super::corner::Corner;
use crate::math::solve::Normal;
use crate::pipeline::PhaseMap;
use alloc::vec::Vec;

/// Half the side of a window, as a share of the shortest side of its square.
const HALF_WINDOW: f64 = 0.2;
/// Least pixels of a fit with six coefficients.
const LEAST_PIXELS: usize = 24;
/// Least share of a window's pixels that must be resolved under both patterns.
const LEAST_RESOLVED: f64 = 0.6;
/// Pixels more than this many times the RMS off the first fit are left out of the second.
const OUTLIER: f64 = 3.0;
/// Largest blur (σ of an edge) that is accepted, as a share of a square's side in the picture; real
/// boards in focus have 0.01.
const MOST_BLUR: f64 = 0.05;
/// RMS distance of a level's corners from the mean of all levels beyond which the board moved, px:
/// noise leaves 0.02.
const MOST_MOTION: f64 = 0.12;
/// Least share of the bright squares that must have a projector point.
const LEAST_COVERED: f64 = 0.9;
/// RMS distance of the corners of two pictures up to which the board lies in one place, as a share
/// of a square's side, and in px: a pose that is nearer repeats the errors of another one and not
/// only its corners, so that the residuals of both say less than they seem to. A board that is only
/// tilted by 8° moves as far.
const SAME_PLACE: (f64, f64) = (0.03, MOST_MOTION);

/// The projector point that lights a place of the camera's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardNode {
    /// Camera column and row, px.
    pub at: (f64, f64),
    /// ξ, η, projector px.
    pub lit_by: (f64, f64),
    /// Column and row of the square that it lies in, between inner corners.
    pub square: (usize, usize),
}

/// One pose of the board as it was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardView {
    /// The corners in the camera.
    pub found: FoundBoard,
    /// The projector's points on the board.
    pub nodes: Vec<BoardNode>,
}

/// What the camera saw of a board under vertical and horizontal fringes of fixed pitch.
#[derive(Clone, Copy, Debug)]
pub struct FringeMaps<'a> {
    /// Phases under vertical fringes.
    pub vertical: &'a PhaseMap,
    /// Phases under horizontal fringes.
    pub horizontal: &'a PhaseMap,
    /// Projector pixels per fringe of both.
    pub pitch: (f64, f64),
}

impl FringeMaps<'_> {
    /// ξ and η at a pixel, where both phases are resolved.
    fn at(&self, u: usize, v: usize) -> Option<(f64, f64)> {
        let turns = |map: &PhaseMap| {
            let pixel = v * map.width + u;
            let resolved = u < map.width && map.trust.get(pixel)?.has_phase();
            resolved.then(|| map.phase[pixel].turns())
        };
        Some((
            turns(self.vertical)? * self.pitch.0,
            turns(self.horizontal)? * self.pitch.1,
        ))
    }

    /// The nodes of a board: up to four in each of its squares.
    pub fn nodes(&self, board: &Board, found: &FoundBoard) -> Vec<BoardNode> {
        let mut nodes = Vec::new();
        for row in 0..board.rows.saturating_sub(1) {
            for column in 0..board.columns.saturating_sub(1) {
                let corner = row * board.columns + column;
                let square = [
                    corner,
                    corner + 1,
                    corner + board.columns,
                    corner + board.columns + 1,
                ];
                let [Some(a), Some(b), Some(c), Some(d)] =
                    square.map(|corner| found.corners[corner])
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

    fn node(&self, at: (f64, f64), half: f64, square: (usize, usize)) -> Option<BoardNode> {
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
        if samples.len() < LEAST_PIXELS.max((LEAST_RESOLVED * all as f64) as usize) {
            return None;
        }
        let (fit, rms) = quadratic(&samples)?;
        samples.retain(|&(place, lit_by)| {
            let (xi, eta) = off(&fit, place, lit_by);
            libm::hypot(xi, eta) <= OUTLIER * rms
        });
        let (fit, _) = quadratic(&samples)?;
        Some(BoardNode {
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
            HALF_WINDOW * shortest,
        )
    })
}

type NodeSample = ((f64, f64), (f64, f64));

fn terms((x, y): (f64, f64)) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

fn off(fit: &[[f64; 6]; 2], place: (f64, f64), lit_by: (f64, f64)) -> (f64, f64) {
    let terms = terms(place);
    let value = |fit: &[f64; 6]| -> f64 { fit.iter().zip(&terms).map(|(a, b)| a * b).sum() };
    (lit_by.0 - value(&fit[0]), lit_by.1 - value(&fit[1]))
}

/// Least-squares quadratics of ξ and η, and the RMS distance of the samples from them.
fn quadratic(samples: &[NodeSample]) -> Option<([[f64; 6]; 2], f64)> {
    let fitted = |lit_by: fn(&NodeSample) -> f64| {
        Normal::of(samples.iter().map(|s| (terms(s.0), lit_by(s)))).solve()
    };
    let fit = [fitted(|(_, (xi, _))| *xi)?, fitted(|(_, (_, eta))| *eta)?];
    let squares: f64 = samples
        .iter()
        .map(|&(place, lit_by)| {
            let (xi, eta) = off(&fit, place, lit_by);
            xi * xi + eta * eta
        })
        .sum();
    Some((fit, libm::sqrt(squares / samples.len() as f64)))
}

/// A pose that cannot be used; [`Self::remedy`] says what to do.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// The board was not found as described.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The camera's picture is blurred.
    #[error(
        "the picture is blurred: edges of the squares have a σ of {blur:.1} px, at most {most:.1} px is accepted"
    )]
    Blurred {
        /// σ of the edges, px.
        blur: f64,
        /// The limit, px.
        most: f64,
    },
    /// The board moved between frames.
    #[error("the board moved by {pixels:.2} px between the frames of different levels")]
    Moved {
        /// How far, px.
        pixels: f64,
    },
    /// The projector does not light all of the board, or its fringes cannot be decoded there.
    #[error("only {:.0} % of the board's bright squares have a phase under both patterns", share * 100.0)]
    OffFringes {
        /// Share of the bright squares that have a projector point.
        share: f64,
    },
}

impl PoseError {
    /// What to do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Board(BoardError::None) => {
                "light the whole board, and show it sharp and less tilted"
            }
            Self::Board(BoardError::Size { .. }) => {
                "show the whole board, in even light without reflections, or correct --board"
            }
            Self::Board(BoardError::Few { .. }) => {
                "show the board sharp, in even light without reflections"
            }
            Self::Blurred { .. } => "focus, or bring the board nearer to where it is sharp",
            Self::Moved { .. } => "hold it still, or put it down, while frames are taken",
            Self::OffFringes { .. } => {
                "move the board into the projector's light, without shadow or reflection"
            }
        }
    }
}

/// Finds the board in the offset of each level, and its points in the projector's raster.
///
/// # Errors
/// Why the pose cannot be used.
pub fn look(
    board: &Board,
    levels: &[GreyPicture],
    fringes: &FringeMaps<'_>,
) -> Result<BoardView, PoseError> {
    let mut each = Vec::with_capacity(levels.len());
    for level in levels {
        each.push(board.find(level)?);
    }
    let found = mean(&each).ok_or(BoardError::None)?;
    board.enough(&found.corners)?;
    // Blur comes first: a board that is blurred seems to move as well.
    let (blur, most) = (found.blur(), MOST_BLUR * found.step);
    if blur > most {
        return Err(PoseError::Blurred { blur, most });
    }
    let pixels = each
        .iter()
        .map(|level| apart(level, &found))
        .fold(0.0, f64::max);
    if pixels > MOST_MOTION {
        return Err(PoseError::Moved { pixels });
    }
    let nodes = fringes.nodes(board, &found);
    let share = covered(
        board,
        &nodes.iter().map(|node| node.square).collect::<Vec<_>>(),
    );
    if share < LEAST_COVERED {
        return Err(PoseError::OffFringes { share });
    }
    Ok(BoardView { found, nodes })
}

impl FoundBoard {
    /// Whether the board lies where it lies in another picture of the same camera, whichever way
    /// round.
    pub fn lies_as_in(&self, other: &Self) -> bool {
        let round = Self {
            corners: other.corners.iter().rev().copied().collect(),
            step: other.step,
        };
        let pixels = apart(self, other).min(apart(self, &round));
        pixels <= (SAME_PLACE.0 * self.step).max(SAME_PLACE.1)
    }
}

/// Each corner's mean over the levels that all have it.
fn mean(each: &[FoundBoard]) -> Option<FoundBoard> {
    let first = each.first()?;
    let share = 1.0 / each.len() as f64;
    let corner = |at: usize| {
        let mut sum = Corner::default();
        for level in each {
            let corner = level.corners[at]?;
            sum.u += share * corner.u;
            sum.v += share * corner.v;
            sum.blur += share * corner.blur;
        }
        Some(sum)
    };
    Some(FoundBoard {
        corners: (0..first.corners.len()).map(corner).collect(),
        step: first.step,
    })
}

/// RMS distance between the corners that were located in both pictures, px; infinite if there are
/// none.
fn apart(a: &FoundBoard, b: &FoundBoard) -> f64 {
    let pairs = a.corners.iter().zip(&b.corners);
    let (mut squares, mut n) = (0.0, 0.0);
    for (a, b) in pairs.filter_map(|(a, b)| (*a).zip(*b)) {
        squares += (a.u - b.u) * (a.u - b.u) + (a.v - b.v) * (a.v - b.v);
        n += 1.0;
    }
    if n > 0.0 {
        libm::sqrt(squares / n)
    } else {
        f64::INFINITY
    }
}

/// Share of the bright squares between inner corners that have a node. The bright
/// squares are those of the colour with more nodes.
fn covered(board: &Board, squares: &[(usize, usize)]) -> f64 {
    let (columns, rows) = (board.columns - 1, board.rows - 1);
    let share = |colour: usize| {
        let of_colour = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .filter(|(column, row)| (column + row) % 2 == colour);
        let (mut have, mut all) = (0.0, 0.0);
        for square in of_colour {
            all += 1.0;
            have += f64::from(u8::from(squares.contains(&square)));
        }
        have / f64::max(all, 1.0)
    };
    share(0).max(share(1))
}
