//! How far a part's placement can change the phase of each pixel.
//!
//! A single level cannot prove its fringe order: it is right only where the phase stays within half
//! a turn of the golden map. Two dense levels reach further. The golden
//! surface and the declared tolerance of placement decide which pixels are safe.

use crate::geometry::{Triangulator, Vector};
use crate::math::around;
use crate::pipeline::{KnownSurface, for_each_row, map_rows};
use alloc::vec;
use alloc::vec::Vec;

/// Directions of the moves that are tried: the 26 neighbours of a cube's centre.
const DIRECTIONS: usize = 26;
/// Shares of the tolerance that are tried along each direction, because smaller moves count as well.
const SHARES: [f64; 2] = [1.0, 0.5];

/// Rows whose moved points are kept at a time: enough for all threads, in little memory.
const BAND: usize = 64;

/// The largest |ΔΦ| in turns of each pixel when the part is moved by up to `tolerance` mm
/// in any direction; infinite where golden is unknown within reach of the move.
///
/// Every golden point is moved along 26 directions and projected. Its phase there, extrapolated by the golden gradient to each
/// of the four pixels around it, is compared with the golden phase of that pixel. Occlusion is neglected, which can only make the
/// result larger.
pub fn phase_reach(triangulator: &Triangulator, golden: &KnownSurface, tolerance: f64) -> Vec<f32> {
    let width = golden.width.max(1);
    let rows = golden.height.len() / width;
    let points = points(triangulator, golden);
    let mut reach = vec![0.0_f32; golden.height.len()];
    let mut furthest = 1_usize;
    for step in moves(tolerance) {
        let moved = |v: usize, u: usize| {
            let moved = points[v * width + u]? + step;
            let (xi, eta) = triangulator.projector_point(moved)?;
            Some(Moved {
                from: (u, v),
                to: triangulator.camera().project(moved)?,
                phase: triangulator.function().at(xi, eta),
                gradient: gradient(golden, u, v),
            })
        };
        for first in (0..rows).step_by(BAND) {
            let seen = map_rows(BAND.min(rows - first), |v| {
                let row = (0..width).filter_map(|u| moved(first + v, u));
                row.collect::<Vec<_>>()
            });
            for moved in seen.into_iter().flatten() {
                furthest = furthest.max(moved.distance() + 1);
                moved.raise(&mut reach, golden);
            }
        }
    }
    let known: Vec<bool> = golden.phase.iter().map(|phase| phase.is_known()).collect();
    forbid_near_unknown(&mut reach, &known, width, furthest);
    reach
}

/// A golden point after a move.
struct Moved {
    /// The pixel that saw it before.
    from: (usize, usize),
    /// Where it is seen now.
    to: (f64, f64),
    /// Its phase after the move, turns.
    phase: f64,
    /// The golden gradient where it was, turns per pixel.
    gradient: (f64, f64),
}

impl Moved {
    /// How far it moved in the image, whole pixels.
    fn distance(&self) -> usize {
        let (u, v) = (self.from.0 as f64, self.from.1 as f64);
        libm::ceil(libm::fabs(self.to.0 - u).max(libm::fabs(self.to.1 - v))) as usize
    }

    /// Raises the reach of the four pixels around it.
    fn raise(&self, reach: &mut [f32], golden: &KnownSurface) {
        let (width, rows) = (golden.width, golden.height.len() / golden.width);
        let (left, top) = (libm::floor(self.to.0), libm::floor(self.to.1));
        for (u, v) in [
            (left, top),
            (left + 1.0, top),
            (left, top + 1.0),
            (left + 1.0, top + 1.0),
        ] {
            let inside = u >= 0.0 && v >= 0.0 && u < width as f64 && v < rows as f64;
            if !inside {
                continue;
            }
            let place = v as usize * width + u as usize;
            if golden.phase[place].is_known() {
                let (du, dv) = (u - self.to.0, v - self.to.1);
                let here = self.phase + self.gradient.0 * du + self.gradient.1 * dv;
                let change = libm::fabs(here - golden.phase[place].turns()) as f32;
                reach[place] = reach[place].max(change);
            }
        }
    }
}

/// The golden gradient at a pixel in turns per pixel: the smaller of the differences to both sides,
/// so that it does not cross an edge of the surface.
fn gradient(golden: &KnownSurface, u: usize, v: usize) -> (f64, f64) {
    let (width, rows) = (golden.width, golden.height.len() / golden.width);
    let at = |u: usize, v: usize| {
        let inside = u < width && v < rows;
        let phase = inside.then(|| golden.phase[v * width + u])?;
        phase.is_known().then(|| phase.turns())
    };
    let smaller = |before: Option<f64>, here: Option<f64>, after: Option<f64>| {
        let back = before.zip(here).map(|(a, b)| b - a);
        let forth = here.zip(after).map(|(a, b)| b - a);
        match (back, forth) {
            (Some(back), Some(forth)) if libm::fabs(back) < libm::fabs(forth) => back,
            (back, forth) => forth.or(back).unwrap_or(0.0),
        }
    };
    // At the first column and row the index wraps to a value outside the frame.
    (
        smaller(at(u.wrapping_sub(1), v), at(u, v), at(u + 1, v)),
        smaller(at(u, v.wrapping_sub(1)), at(u, v), at(u, v + 1)),
    )
}

fn points(triangulator: &Triangulator, golden: &KnownSurface) -> Vec<Option<Vector>> {
    let mut points = vec![None; golden.height.len()];
    for_each_row(&mut points, golden.width, |v, row| {
        for (u, point) in row.iter_mut().enumerate() {
            *point = triangulator.point(u, v, golden.height[v * golden.width + u]);
        }
    });
    points
}

/// The moves that are tried, in mm.
fn moves(tolerance: f64) -> impl Iterator<Item = Vector> {
    let axis = |i: usize| (i % 3) as f64 - 1.0;
    (0..=DIRECTIONS)
        .map(move |i| Vector::new(axis(i), axis(i / 3), axis(i / 9)))
        .filter(|direction| direction.length() > 0.0)
        .flat_map(move |direction| {
            let scale = tolerance / direction.length();
            SHARES.map(|share| direction * (scale * share))
        })
}

/// Makes the reach of pixels within `away` of unknown golden pixels infinite: something unknown may move into view there.
fn forbid_near_unknown(reach: &mut [f32], known: &[bool], width: usize, away: usize) {
    let rows = known.len() / width;
    // Rows first, then columns: a separable square.
    let mut near_row = vec![false; known.len()];
    for_each_row(&mut near_row, width, |v, row| {
        let line = &known[v * width..(v + 1) * width];
        for (u, near) in row.iter_mut().enumerate() {
            *near = line[around(u, away, width)].contains(&false);
        }
    });
    for_each_row(reach, width, |v, row| {
        for (u, reach) in row.iter_mut().enumerate() {
            if around(v, away, rows).any(|v| near_row[v * width + u]) {
                *reach = f32::INFINITY;
            }
        }
    });
}
