//! How bright each projector pixel may be, so that longer exposures do not saturate the camera.
//!
//! **Idea.** An exposure n times as long gives dark places n times the modulation, and so 1/n of
//! the noise. Bright places would saturate: the projector is made darker where it lights them.
//!
//! **Equation.** At a camera pixel that gets w of the projector's white and o of other light in one
//! exposure (shares of full scale), n exposures stay below the share L with the share (Peng & Gupta
//! 2008, eq. 1 with another I_max)
//!
//! > a = (L − n o) / (n w), within 1/2n ≤ a ≤ 1
//!
//! of the projector's light: together at least half of one exposure's whole light, whatever else
//! lights the part. Each camera pixel limits the projector pixel that lights it to this share. The
//! amplitude is the least limit within the reach of the part's placement, and rises from there by
//! at most 2 % (`SLOPE`) per projector pixel, because a gradient a′ under a blur of σ projector
//! pixels shifts the fringes by a′/a σ² pixels.

use super::ProjectorMap;
use super::map::UNKNOWN;
use crate::geometry::{Triangulator, Vector};
use crate::pipeline::{HeightMap, over_squares};
use alloc::vec;
use alloc::vec::Vec;

/// Largest rise of the amplitude from one projector pixel to the next, relative: with a lens of σ 1
/// px the fringes shift by 0.02 px.
const SLOPE: f32 = 0.02;
/// Projector pixels added to the reach of the placement, for blur and for projector pixels that no
/// camera pixel sees.
const MARGIN: usize = 2;
/// The reach is evaluated every so many camera pixels in each direction.
const SPACING: usize = 8;

/// The light that a camera pixel gets in one exposure, as shares of its full scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// What does not come from the projector.
    pub other: f64,
    /// What comes from the projector at white; infinite where it is not known because the pixel is
    /// saturated.
    pub white: f64,
}

impl Received {
    /// The light of a pixel from its samples of a sine that is shifted by a quarter turn from each
    /// sample to the next.
    pub fn of([a, b, c, d]: [f64; 4]) -> Self {
        let white = match [a, b, c, d].iter().any(|sample| *sample >= 1.0) {
            true => f64::INFINITY,
            false => libm::hypot(a - c, b - d),
        };
        Self {
            other: ((a + b + c + d) / 4.0 - white / 2.0).max(0.0),
            white,
        }
    }

    /// The share of the projector's light with which so many exposures stay below `most` of full
    /// scale.
    pub fn share(&self, exposures: u32, most: f64) -> f64 {
        let n = f64::from(exposures);
        let share = (most - n * self.other) / (n * self.white);
        // No light at all is 0/0, which `min` ignores.
        share.min(1.0).max(1.0 / (2.0 * n))
    }
}

/// The largest distance, in projector pixels, between the projector points that light a point of
/// the surface before and after the part is displaced by up to `tolerance` mm.
pub fn reach(triangulator: &Triangulator, heights: &HeightMap, tolerance: f64) -> f64 {
    let width = heights.width.max(1);
    let rows = heights.height.len() / width;
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let per_mm = |u: usize, v: usize| {
        let point = triangulator.point(u, v, heights.height[v * width + u])?;
        let (xi, eta) = triangulator.projector_point(point)?;
        // The way for 1 mm along each axis; the root of the sum of squares is per_mm least that along
        // any direction.
        let moved = axes.iter().filter_map(|&[x, y, z]| {
            let (across, down) = triangulator.projector_point(point + Vector { x, y, z })?;
            Some((across - xi) * (across - xi) + (down - eta) * (down - eta))
        });
        Some(libm::sqrt(moved.sum()))
    };
    let pixels = (0..rows).step_by(SPACING);
    let pixels = pixels.flat_map(|v| (0..width).step_by(SPACING).map(move |u| (u, v)));
    let most = pixels.filter_map(|(u, v)| per_mm(u, v)).fold(0.0, f64::max);
    tolerance * most
}

/// The amplitude of each pixel of a projector of `columns` × `rows`, in 1/255 of full light: where the
/// camera sees a projector point of `map`, at most the share of `wanted`, also within `reach`
/// projector pixels; 255 where nothing limits it.
///
/// Tests: `no_place_within_reach_is_brighter_than_asked_and_it_rises_slowly`,
/// `a_saturated_place_is_found_between_the_places_around_it`.
pub fn amplitude(
    map: &ProjectorMap,
    wanted: &[f64],
    columns: usize,
    rows: usize,
    reach: f64,
) -> Vec<u8> {
    let mut asked = vec![1.0_f32; columns * rows];
    let width = map.width.max(1);
    let lines = map.points.chunks(width).zip(wanted.chunks(width));
    for (points, wanted) in lines {
        for (u, &share) in wanted.iter().enumerate().filter(|(_, share)| **share < 1.0) {
            let [xi, eta] = between(points, u);
            // NaN is outside.
            let inside = |coordinate: f64, end: usize| {
                let coordinate = libm::rint(coordinate);
                (coordinate >= 0.0 && coordinate < end as f64).then_some(coordinate as usize)
            };
            if let Some((column, row)) = inside(xi, columns).zip(inside(eta, rows)) {
                let cell = &mut asked[row * columns + column];
                *cell = cell.min(share as f32);
            }
        }
    }
    let farthest = columns.max(rows);
    let reach = (libm::ceil(reach.min(farthest as f64)) as usize + MARGIN).min(farthest);
    let mut amplitude = over_squares(&asked, columns, reach, f32::min);
    rise_slowly(&mut amplitude, columns);
    let level = |share: &f32| (libm::floorf(share * 255.0) as u8).max(1);
    amplitude.iter().map(level).collect()
}

/// The projector point of the pixel `u` of a row; where it is not known, a point on the line
/// between the known points left and right of it.
fn between(points: &[[f64; 2]], u: usize) -> [f64; 2] {
    let known = |&at: &usize| !points[at][0].is_nan();
    let left = (0..=u).rev().find(known);
    let right = (u..points.len()).find(known);
    match (left, right) {
        (Some(left), Some(right)) if left < right => {
            let t = (u - left) as f64 / (right - left) as f64;
            [0, 1].map(|axis| points[left][axis] + t * (points[right][axis] - points[left][axis]))
        }
        (left, right) => left.or(right).map_or(UNKNOWN, |at| points[at]),
    }
}

/// Lowers values until none is larger than a neighbour's by more than [`SLOPE`] of the neighbour's:
/// from the left and above, then from the right and below.
fn rise_slowly(values: &mut [f32], columns: usize) {
    let last = values.len().saturating_sub(1);
    for backwards in [false, true] {
        for step in 0..values.len() {
            let column = step % columns;
            let index = |step: usize| if backwards { last - step } else { step };
            let mut most = values[index(step)];
            if column > 0 {
                most = most.min(values[index(step - 1)] * (1.0 + SLOPE));
            }
            if step >= columns {
                most = most.min(values[index(step - columns)] * (1.0 + SLOPE));
            }
            values[index(step)] = most;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera of 60 × 40 pixels that sees every second projector pixel of 120 × 80, and where it
    /// does not know which.
    fn map(unknown: impl Fn(usize, usize) -> bool) -> ProjectorMap {
        let points = (0..60 * 40).map(|at| match (at % 60, at / 60) {
            (u, v) if unknown(u, v) => UNKNOWN,
            (u, v) => [2.0 * u as f64, 2.0 * v as f64],
        });
        ProjectorMap {
            width: 60,
            points: points.collect(),
        }
    }

    /// Full light is wanted everywhere but here.
    fn wanted(share: f64, here: impl Fn(usize, usize) -> bool) -> Vec<f64> {
        let wanted = (0..60 * 40).map(|at| if here(at % 60, at / 60) { share } else { 1.0 });
        wanted.collect()
    }

    #[test]
    fn so_many_exposures_of_the_share_reach_what_is_allowed_and_not_more() {
        let sine = |other: f64, white: f64| {
            let sample = |quarter: usize| {
                let turn = 0.07 + quarter as f64 / 4.0;
                other + white / 2.0 * (1.0 + libm::sin(core::f64::consts::TAU * turn))
            };
            Received::of([0, 1, 2, 3].map(sample))
        };
        for (other, white, share) in [
            (0.0, 0.8, 0.25),   // 4 × 0.8 × 0.25 = 0.8
            (0.1, 0.4, 0.25),   // 4 × (0.1 + 0.4 × 0.25) = 0.8
            (0.02, 0.05, 1.0),  // 4 × 0.07 = 0.28
            (0.19, 0.4, 0.125), // at least 1/8
            (0.0, 0.0, 1.0),
        ] {
            let found = sine(other, white).share(4, 0.8);
            assert!((found - share).abs() < 1e-9, "{other} {white}: {found}");
        }
        assert_eq!(Received::of([1.0, 0.5, 0.2, 0.6]).share(4, 0.8), 0.125);
    }

    #[test]
    fn no_place_within_reach_is_brighter_than_asked_and_it_rises_slowly() {
        let bright = |u, v| u == 20 && v == 10;
        let amplitude = amplitude(&map(|_, _| false), &wanted(0.3, bright), 120, 80, 9.5);
        for (at, &here) in amplitude.iter().enumerate() {
            let (column, row) = (at % 120, at / 120);
            let away = column.abs_diff(40).max(row.abs_diff(20));
            if away <= 12 {
                assert_eq!(here, 76, "{column}, {row}");
            }
            for beside in [at.checked_sub(120), at.checked_sub(1)]
                .into_iter()
                .flatten()
            {
                let (a, b) = (f32::from(here), f32::from(amplitude[beside]));
                // Each is rounded down.
                let limit = a.min(b) + SLOPE * (a.min(b) + 1.0) + 1.0;
                assert!(column == 0 || a.max(b) <= limit, "{column}, {row}: {a} {b}");
            }
        }
        // 62 pixels of 2 % from 0.3 to 1.
        assert_eq!(amplitude[20 * 120 + 119], 255);
        assert_eq!(
            amplitude.iter().filter(|here| **here == 76).count(),
            25 * 25
        );
    }

    #[test]
    fn a_saturated_place_is_found_between_the_places_around_it() {
        let glint = |u, v| (20..30).contains(&u) && (10..20).contains(&v);
        let amplitude = amplitude(&map(glint), &wanted(0.125, glint), 120, 80, 0.0);
        for (column, row) in [(40, 20), (58, 38), (50, 30)] {
            assert_eq!(amplitude[row * 120 + column], 31, "{column}, {row}");
        }
        assert!(amplitude[0] > 31);
    }
}
