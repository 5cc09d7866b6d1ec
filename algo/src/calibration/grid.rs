//! Candidates put in rows and columns, from one corner to its neighbours.
//!
//! Along an edge of the board the next corner has black and white exchanged, and lies about as far
//! away as the corner before it. A seed is a candidate with such a neighbour in each of the four
//! directions of its edges; from there the grid grows by prediction (from two corners in line, or
//! from the step between two corners beside it), as long as a candidate of the right colours lies
//! within a quarter of a step. Growing by neighbours holds for any perspective and distortion: A.
//! Geiger et al., "Automatic camera and range sensor calibration using a single shot", ICRA 2012,
//! grow with an energy instead.

use super::candidates::Candidate;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Farthest that a corner lies from its prediction, in steps.
const REACH: f64 = 0.25;
/// Seeds that are tried.
const SEEDS: usize = 200;
/// Cosine between harmonics beyond which two candidates have the same colours; below its negative
/// they are exchanged.
const ALIKE: f64 = 0.4;
/// The four directions of the grid.
const AROUND: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Candidates by their place (column, row) in the grid, counted from the seed.
pub(super) type Grid = BTreeMap<(i32, i32), Candidate>;

/// The largest grid among the candidates; one of `enough` corners ends the search.
pub(super) fn grown(candidates: &[Candidate], enough: usize) -> Grid {
    let mut best = Grid::new();
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
fn seeded(seed: &Candidate, candidates: &[Candidate]) -> Option<Grid> {
    let bright = libm::atan2(seed.harmonic.1, seed.harmonic.0) / 2.0;
    let mut grid = Grid::from([((0, 0), *seed)]);
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

fn grow(grid: &mut Grid, candidates: &[Candidate]) {
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
                    && off(nearest) < REACH * step
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
pub(super) fn predicted(grid: &Grid, (column, row): (i32, i32)) -> Option<((f64, f64), f64)> {
    let at = |right: i32, down: i32| {
        let corner = grid.get(&(column + right, row + down));
        corner.map(|corner| (corner.u, corner.v))
    };
    let (mut sum, mut n, mut steps) = ((0.0, 0.0), 0.0, 0.0);
    for (right, down) in AROUND {
        let Some(near) = at(right, down) else {
            continue;
        };
        let behind = at(2 * right, 2 * down).map(|far| (near.0 - far.0, near.1 - far.1));
        let beside = || {
            [1, -1].into_iter().find_map(|side| {
                let (across, along) = (side * down, side * right);
                let (here, there) = (at(across, along)?, at(right + across, down + along)?);
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
