//! The board: its corners' places, and where it is found in a picture, by candidates put in rows
//! and columns from one corner to its neighbours.
//!
//! Along an edge of the board the next corner has black and white exchanged, and lies about as far
//! away as the corner before it. A seed is a candidate with such a neighbour in each of the four
//! directions of its edges; from there the grid grows by prediction (from two corners in line, or
//! from the step between two corners beside it), as long as a candidate of the right colours lies
//! within a quarter of a step. Growing by neighbours holds for any perspective and distortion: A.
//! Geiger et al., "Automatic camera and range sensor calibration using a single shot", ICRA 2012,
//! grow with an energy instead.

use super::candidates::{Candidate, GreyPicture, candidates};
use super::corner::{Corner, locate};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Farthest that a corner lies from its prediction, in steps.
const LARGEST_MISS: f64 = 0.25;
/// Seeds that are tried.
const SEEDS: usize = 200;
/// Cosine between harmonics beyond which two candidates have the same colours; below its negative
/// they are exchanged.
const ALIKE: f64 = 0.4;
/// Share of the corners that must be located.
const LEAST_LOCATED: f64 = 0.9;
/// Radius of the window about a corner, as a share of the shortest side of the squares beside it,
/// and its bounds in px.
const WINDOW: f64 = 0.3;
const WINDOW_BOUNDS: (f64, f64) = (4.0, 14.0);
/// How often the picture is halved in search of a large or blurred board.
const HALVINGS: usize = 3;
/// The four directions of the grid.
const AROUND: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Candidates by their place (column, row) in the grid, counted from the seed.
pub(super) type CornerGrid = BTreeMap<(i32, i32), Candidate>;

/// The largest grid among the candidates; one of `enough` corners ends the search.
pub(super) fn grown(candidates: &[Candidate], enough: usize) -> CornerGrid {
    let mut best = CornerGrid::new();
    for seed in candidates.iter().take(SEEDS) {
        // A candidate that an earlier grid contains would make the same grid again.
        let known = best
            .values()
            .any(|known| (known.u, known.v) == (seed.u, seed.v));
        if known {
            continue;
        }
        let Some(mut grid) = seeded(seed, candidates) else {
            continue;
        };
        grow(&mut grid, candidates);
        if grid.len() > best.len() {
            best = grid;
        }
        if best.len() >= enough {
            break;
        }
    }
    best
}

/// A seed with its four neighbours.
fn seeded(seed: &Candidate, candidates: &[Candidate]) -> Option<CornerGrid> {
    let bright = libm::atan2(seed.harmonic.1, seed.harmonic.0) / 2.0;
    let mut grid = CornerGrid::from([((0, 0), *seed)]);
    let mut lengths = [0.0; 4];
    for (quarter, place) in AROUND.into_iter().enumerate() {
        // The edges lie between bright and dark; perspective turns them by less than 30°.
        let angle = bright + core::f64::consts::FRAC_PI_4 * (1.0 + 2.0 * quarter as f64);
        let (x, y) = (libm::cos(angle), libm::sin(angle));
        let ahead = |other: &&Candidate| {
            let (dx, dy) = (other.u - seed.u, other.v - seed.v);
            let along = dx * x + dy * y;
            along > 0.866 * libm::hypot(dx, dy) && seed.alike(other) < -ALIKE
        };
        let distance = |other: &Candidate| libm::hypot(other.u - seed.u, other.v - seed.v);
        let next = candidates
            .iter()
            .filter(ahead)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        lengths[quarter] = distance(next);
        grid.insert(place, *next);
    }
    let even = |a: f64, b: f64| a < 1.6 * b && b < 1.6 * a;
    (even(lengths[0], lengths[2]) && even(lengths[1], lengths[3])).then_some(grid)
}

fn grow(grid: &mut CornerGrid, candidates: &[Candidate]) {
    loop {
        let mut added = Vec::new();
        for (&(column, row), corner) in grid.iter() {
            for (right, down) in AROUND {
                let place = (column + right, row + down);
                if grid.contains_key(&place) || added.iter().any(|&(there, _)| there == place) {
                    continue;
                }
                let Some((at, step)) = predicted(grid, place) else {
                    continue;
                };
                let off = |other: &Candidate| libm::hypot(other.u - at.0, other.v - at.1);
                let nearest = candidates
                    .iter()
                    .filter(|other| corner.alike(other) < -ALIKE)
                    .min_by(|a, b| off(a).total_cmp(&off(b)));
                if let Some(nearest) = nearest
                    && off(nearest) < LARGEST_MISS * step
                {
                    added.push((place, *nearest));
                }
            }
        }
        if added.is_empty() {
            return;
        }
        grid.extend(added);
    }
}

/// Where a corner that is not in the grid should lie, and the length of a step there: from the
/// neighbours on each side, with the step behind them, or, where there is none, with the step in a
/// line beside it.
pub(super) fn predicted(grid: &CornerGrid, (column, row): (i32, i32)) -> Option<((f64, f64), f64)> {
    let neighbour = |right: i32, down: i32| {
        let corner = grid.get(&(column + right, row + down));
        corner.map(|corner| (corner.u, corner.v))
    };
    let (mut sum, mut n, mut steps) = ((0.0, 0.0), 0.0, 0.0);
    for (right, down) in AROUND {
        let Some(near) = neighbour(right, down) else {
            continue;
        };
        let behind = neighbour(2 * right, 2 * down).map(|far| (near.0 - far.0, near.1 - far.1));
        let beside = || {
            [1, -1].into_iter().find_map(|side| {
                let (across, along) = (side * down, side * right);
                let (here, there) = (
                    neighbour(across, along)?,
                    neighbour(right + across, down + along)?,
                );
                Some((here.0 - there.0, here.1 - there.1))
            })
        };
        let Some(step) = behind.or_else(beside) else {
            continue;
        };
        sum = (sum.0 + near.0 + step.0, sum.1 + near.1 + step.1);
        steps += libm::hypot(step.0, step.1);
        n += 1.0;
    }
    (n > 0.0).then(|| ((sum.0 / n, sum.1 / n), steps / n))
}

/// A checkerboard, by its inner corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// Inner corners along x.
    pub columns: usize,
    /// Inner corners along y.
    pub rows: usize,
    /// Side of a square, mm.
    pub square: f64,
}

/// The corners of a board in one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundBoard {
    /// Row by row as [`Board::place`] counts them; `None` for a corner that was not located.
    pub corners: Vec<Option<Corner>>,
    /// Median length of a square's side in the picture, px.
    pub step: f64,
}

/// A picture in which the board was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardError {
    /// There is no grid of corners.
    #[error("no checkerboard is in the picture")]
    None,
    /// The grid has another size.
    #[error("a grid of {} × {} inner corners was found", found.0, found.1)]
    Size {
        /// Corners along the longer and the shorter side, or as found.
        found: (usize, usize),
    },
    /// Too many corners of the grid could not be located.
    #[error("only {located} of {all} corners could be located")]
    Few {
        /// Corners that could be located.
        located: usize,
        /// Corners of the board.
        all: usize,
    },
}

impl Board {
    /// The number of inner corners.
    pub fn corners(&self) -> usize {
        self.columns * self.rows
    }

    /// The place of a corner on the flat board, mm from its centre.
    pub fn place(&self, corner: usize) -> (f64, f64) {
        let columns = self.columns.max(1);
        let (column, row) = (corner % columns, corner / columns);
        let from_centre = |at: usize, all: usize| at as f64 - (all as f64 - 1.0) / 2.0;
        (
            from_centre(column, self.columns) * self.square,
            from_centre(row, self.rows) * self.square,
        )
    }

    /// Finds the board in a picture under even light. x runs along the columns, y such that the
    /// board's z points to the camera; of the two orders of the corners that are left, the one with
    /// x to the right, or down.
    ///
    /// # Errors
    /// If there is no grid of corners, one of another size, or too few of its corners can be
    /// located.
    pub fn find(&self, picture: &GreyPicture) -> Result<FoundBoard, BoardError> {
        let brightest = picture.counts.iter().copied().fold(0.0, f32::max);
        // Noise and stray light of 2 % of the brightest are not to look like print.
        let floor = (0.02 * brightest).max(1.0);
        let mut halved = picture.clone();
        let mut outcome = Err(BoardError::None);
        for halving in 0..=HALVINGS {
            if halving > 0 {
                halved = halved.halved();
            }
            let scale = f64::from(1_u32 << halving);
            let mut found = candidates(&halved.levelled(floor));
            for candidate in &mut found {
                // The centre of a halved pixel lies between four.
                candidate.u = (candidate.u + 0.5) * scale - 0.5;
                candidate.v = (candidate.v + 0.5) * scale - 0.5;
            }
            let grid = grown(&found, self.corners());
            match self.located(picture, &grid) {
                Ok(board) => return Ok(board),
                Err(error) => outcome = Err(worse(outcome, error)),
            }
        }
        outcome
    }

    /// Locates the corners of a grid that has the board's size.
    fn located(&self, picture: &GreyPicture, grid: &CornerGrid) -> Result<FoundBoard, BoardError> {
        let (columns, rows) = (
            extent(grid.keys().map(|at| at.0)),
            extent(grid.keys().map(|at| at.1)),
        );
        let found = (columns.1, rows.1);
        if found.0 < 2 || found.1 < 2 {
            return Err(BoardError::None);
        }
        let swapped = found == (self.rows, self.columns) && self.rows != self.columns;
        if !swapped && found != (self.columns, self.rows) {
            return Err(BoardError::Size { found });
        }
        let place = |column: usize, row: usize| {
            let (along, across) = if swapped {
                (row, column)
            } else {
                (column, row)
            };
            (columns.0 + along as i32, rows.0 + across as i32)
        };
        let places: Vec<_> = (0..self.rows)
            .flat_map(|row| (0..self.columns).map(move |column| (column, row)))
            .collect();
        let mut corners: Vec<Option<Corner>> = Vec::new();
        let mut steps = Vec::new();
        for &(column, row) in &places {
            let (edges, step) = edges(grid, place(column, row));
            let expected = grid
                .get(&place(column, row))
                .map(|candidate| (candidate.u, candidate.v))
                .or_else(|| predicted(grid, place(column, row)).map(|(expected, _)| expected));
            let corner = expected.zip(edges).and_then(|(expected, edges)| {
                let radius = (WINDOW * step).clamp(WINDOW_BOUNDS.0, WINDOW_BOUNDS.1);
                steps.push(step);
                locate(picture, expected, edges, radius)
            });
            corners.push(corner);
        }
        self.enough(&corners)?;
        self.turn(&mut corners);
        Ok(FoundBoard {
            corners,
            step: median(steps.into_iter()),
        })
    }

    /// Checks that enough corners were located.
    pub(super) fn enough(&self, corners: &[Option<Corner>]) -> Result<(), BoardError> {
        let (located, all) = (corners.iter().flatten().count(), self.corners());
        if (located as f64) < LEAST_LOCATED * all as f64 {
            return Err(BoardError::Few { located, all });
        }
        Ok(())
    }

    /// Orders the corners so that the board's z points to the camera and x to the right, or down.
    fn turn(&self, corners: &mut [Option<Corner>]) {
        let mean = |step: usize, inside: &dyn Fn(usize) -> bool| {
            let pairs = (0..corners.len()).filter(|&at| inside(at));
            let pairs = pairs.filter_map(|at| corners[at].zip(*corners.get(at + step)?));
            pairs.fold((0.0, 0.0), |sum, (a, b)| {
                (sum.0 + b.u - a.u, sum.1 + b.v - a.v)
            })
        };
        let x = mean(1, &|at| (at + 1) % self.columns != 0);
        let y = mean(self.columns, &|_| true);
        // Rows of the picture run down: a right-handed board that faces the camera has a negative
        // cross product.
        if x.0 * y.1 - x.1 * y.0 > 0.0 {
            let flipped: Vec<_> = corners
                .chunks(self.columns)
                .rev()
                .flatten()
                .copied()
                .collect();
            corners.copy_from_slice(&flipped);
        }
        let (right, down) = (x.0, x.1);
        let away = if right.abs() >= down.abs() {
            right < 0.0
        } else {
            down < 0.0
        };
        if away {
            corners.reverse();
        }
    }
}

/// The first number and how many there are up to the last.
fn extent(numbers: impl Iterator<Item = i32> + Clone) -> (i32, usize) {
    let (low, high) = (
        numbers.clone().min().unwrap_or(0),
        numbers.max().unwrap_or(-1),
    );
    (low, usize::try_from(high - low + 1).unwrap_or(0))
}

/// Directions of the two edges through a corner, from its neighbours in the grid, and the length of
/// the shorter side beside it.
fn edges(grid: &CornerGrid, (column, row): (i32, i32)) -> (Option<[(f64, f64); 2]>, f64) {
    let neighbour = |right: i32, down: i32| grid.get(&(column + right, row + down));
    let mut shortest = f64::INFINITY;
    let mut edge = |right: i32, down: i32| {
        let ends = [
            neighbour(-right, -down),
            neighbour(0, 0),
            neighbour(right, down),
        ];
        let mut known = ends
            .iter()
            .enumerate()
            .filter_map(|(i, end)| Some((i, (*end)?)));
        let (first, from) = known.next()?;
        let (last, to) = known.next_back()?;
        let step = (to.u - from.u, to.v - from.v);
        let squares = (last - first) as f64;
        shortest = shortest.min(libm::hypot(step.0, step.1) / squares);
        Some(step)
    };
    let edges = edge(1, 0).zip(edge(0, 1)).map(|(a, b)| [a, b]);
    (edges, shortest)
}

/// The middle one of some numbers; 0 of none.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Of two errors, the one that says more.
fn worse(before: Result<FoundBoard, BoardError>, now: BoardError) -> BoardError {
    match (before, now) {
        (Err(before @ BoardError::Few { .. }), _) => before,
        (Err(before @ BoardError::Size { .. }), BoardError::None) => before,
        (Err(BoardError::Size { found }), BoardError::Size { found: other })
            if found.0 * found.1 >= other.0 * other.1 =>
        {
            BoardError::Size { found }
        }
        (_, now) => now,
    }
}

impl FoundBoard {
    /// Median σ of the edges' blur, px.
    pub fn blur(&self) -> f64 {
        median(self.corners.iter().flatten().map(|corner| corner.blur))
    }

    /// The corners that were located.
    pub fn located(&self) -> usize {
        self.corners.iter().flatten().count()
    }
}
