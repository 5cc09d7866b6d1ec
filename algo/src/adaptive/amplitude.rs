//! How bright each projector pixel may be, so that mirroring places and longer exposures do not saturate
//! the camera.
//!
//! **Idea.** The projector is made darker where it lights places that would saturate. An exposure n times
//! as long then gives dark places n times the modulation.
//!
//! **Equation.** At a camera pixel that gets w of the projector's white and o of other light in one
//! exposure (shares of full scale), n exposures stay below the share L with the share (Peng & Gupta
//! 2008, eq. 1 with another I_max)
//!
//! > a = (L − n o) / (n w), within min(1/4, 1/2n) ≤ a ≤ 1
//!
//! of the projector's light: a quarter of one exposure's whole light, of several together half of it,
//! whatever else lights the part. Each camera pixel limits the projector pixel that lights it to this
//! share. The amplitude is the least limit within the reach of the part's placement, and rises from there by
//! at most 3 % (`SLOPE`) per projector pixel, because a gradient a′ under a blur of σ projector
//! pixels shifts the fringes by a′/a σ² pixels. Next to an edge behind which the part is dark that
//! would take the light from the dark side: with one exposure it keeps what its modulation needs to be 1/16 of
//! full scale.

use super::ProjectorMap;
use super::map::UNKNOWN;
use crate::geometry::{Triangulator, Vector};
use crate::pipeline::{HeightMap, over_squares};
use alloc::vec;
use alloc::vec::Vec;

/// Largest rise of the amplitude from one projector pixel to the next, relative: with a lens of σ 1
/// px the fringes shift by 0.03 px.
const SLOPE: f32 = 0.03;
/// Least share of the projector's light in one exposure: with less, grey levels are too few.
const LEAST: f64 = 0.25;
/// Projector pixels added to the reach of the placement, for blur and for projector pixels that no
/// camera pixel sees.
const MARGIN: usize = 2;
/// The white of a pixel that is bright enough, as a share of full scale: a modulation of 16 of 255 counts.
const ENOUGH: f64 = 1.0 / 8.0;
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
    /// The light of a pixel from its samples of a sine of this share of the projector's light that is
    /// shifted by a quarter turn from each sample to the next.
    pub fn of([a, b, c, d]: [f64; 4], share: f64) -> Self {
        let seen = match [a, b, c, d].iter().any(|sample| *sample >= 1.0) {
            true => f64::INFINITY,
            false => libm::hypot(a - c, b - d),
        };
        Self {
            other: ((a + b + c + d) / 4.0 - seen / 2.0).max(0.0),
            white: seen / share,
        }
    }

    /// The share of the projector's light with which so many exposures stay below `most` of full
    /// scale, and what they need to be bright enough.
    pub fn wanted(&self, exposures: u32, most: f64) -> Wanted {
        let n = f64::from(exposures);
        let share = (most - n * self.other) / (n * self.white);
        // No light at all is 0/0, which `min` ignores.
        let most = share.min(1.0).max(LEAST.min(1.0 / (2.0 * n)));
        Wanted {
            most,
            least: if exposures == 1 {
                (ENOUGH / self.white).min(most)
            } else {
                0.0
            },
        }
    }
}

/// What a camera pixel wants of the light of the projector pixel that it sees, as shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// With more, it is at full scale.
    pub most: f64,
    /// With less, it is dark.
    pub least: f64,
}

/// The largest distance, in projector pixels, between the places on a part where the projector's light
/// is as bright before and after the part is displaced by up to `tolerance` mm.
///
/// A point of the surface moves by the tolerance. On a part that `mirrors` highlights move farther: it may be
/// turned by the tolerance over its radius R, and on a flat face a mirror image moves by that times the distance
/// D to the camera: tolerance · (1 + D/R) together.
pub fn reach(
    triangulator: &Triangulator,
    heights: &HeightMap,
    tolerance: f64,
    mirrors: bool,
) -> f64 {
    let width = heights.width.max(1);
    let rows = heights.height.len() / width;
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let point = |(u, v): (usize, usize)| triangulator.point(u, v, heights.height[v * width + u]);
    let per_mm = |point: Vector| {
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
    let points: Vec<Vector> = pixels.filter_map(point).collect();
    let most = points
        .iter()
        .filter_map(|at| per_mm(*at))
        .fold(0.0, f64::max);
    if !mirrors {
        return tolerance * most;
    }
    let sum = points.iter().fold(Vector::default(), |sum, at| sum + *at);
    let centre = sum * (1.0 / points.len().max(1) as f64);
    let farthest = |from: Vector| points.iter().map(move |at| (*at - from).length());
    let radius = farthest(centre).fold(1.0, f64::max);
    let distance = farthest(triangulator.camera().centre()).fold(0.0, f64::max);
    tolerance * (1.0 + distance / radius) * most
}

/// The amplitude of each pixel of a projector of `columns` × `rows`, in 1/255 of full light: where the
/// camera sees a projector point of `map`, at most the share within which each pixel keeps, also within
/// `reach` projector pixels, but no less than a dark place there needs; 255 where nothing limits it.
///
/// Tests: `no_place_within_reach_is_brighter_than_asked_and_it_rises_slowly`,
/// `a_saturated_place_is_found_between_the_places_around_it`, `a_dark_place_beside_a_bright_one_keeps_its_light`.
pub fn amplitude(
    map: &ProjectorMap,
    wanted: &[Wanted],
    columns: usize,
    rows: usize,
    reach: f64,
) -> Vec<u8> {
    let (mut most, mut least) = (vec![1.0_f32; columns * rows], vec![0.0_f32; columns * rows]);
    let width = map.width.max(1);
    let lines = map.points.chunks(width).zip(wanted.chunks(width));
    for (points, wanted) in lines {
        for (u, wanted) in wanted.iter().enumerate() {
            let [xi, eta] = between(points, u);
            // NaN is outside.
            let inside = |coordinate: f64, end: usize| {
                let coordinate = libm::rint(coordinate);
                (coordinate >= 0.0 && coordinate < end as f64).then_some(coordinate as usize)
            };
            if let Some((column, row)) = inside(xi, columns).zip(inside(eta, rows)) {
                let cell = row * columns + column;
                most[cell] = most[cell].min(wanted.most as f32);
                if points[u][0].is_finite() {
                    least[cell] = least[cell].max(wanted.least as f32);
                }
            }
        }
    }
    let farthest = columns.max(rows);
    let reach = (libm::ceil(reach.min(farthest as f64)) as usize + MARGIN).min(farthest);
    let mut amplitude = over_squares(&most, columns, reach, f32::min);
    rise_slowly(&mut amplitude, columns);
    let least = over_squares(&least, columns, MARGIN, f32::max);
    let level = |share: f32| (libm::floorf(share * 255.0) as u8).max(1);
    let both = amplitude.iter().zip(&least);
    both.map(|(share, least)| level(share.max(*least)))
        .collect()
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
    fn wanted(share: f64, here: impl Fn(usize, usize) -> bool) -> Vec<Wanted> {
        let wanted = (0..60 * 40).map(|at| Wanted {
            most: if here(at % 60, at / 60) { share } else { 1.0 },
            least: 0.0,
        });
        wanted.collect()
    }

    #[test]
    fn so_many_exposures_of_the_share_reach_what_is_allowed_and_not_more() {
        let sine = |other: f64, white: f64| {
            let sample = |quarter: usize| {
                let turn = 0.07 + quarter as f64 / 4.0;
                other + white / 2.0 * (1.0 + libm::sin(core::f64::consts::TAU * turn))
            };
            Received::of([0, 1, 2, 3].map(sample), 1.0)
        };
        for (other, white, share) in [
            (0.0, 0.8, 0.25),   // 4 × 0.8 × 0.25 = 0.8
            (0.1, 0.4, 0.25),   // 4 × (0.1 + 0.4 × 0.25) = 0.8
            (0.02, 0.05, 1.0),  // 4 × 0.07 = 0.28
            (0.19, 0.4, 0.125), // at least 1/8
            (0.0, 0.0, 1.0),
        ] {
            let found = sine(other, white).wanted(4, 0.8).most;
            assert!((found - share).abs() < 1e-9, "{other} {white}: {found}");
        }
        let saturated = Received::of([1.0, 0.5, 0.2, 0.6], 1.0);
        assert_eq!(saturated.wanted(4, 0.8).most, 0.125);
        assert_eq!(saturated.wanted(1, 0.8).most, 0.25);
        assert_eq!(saturated.wanted(1, 0.8).least, 0.0);
        // A quarter of the light shows what the whole light would be.
        let dim = sine(0.1, 0.3);
        let quarter = Received::of([0.4, 0.25, 0.1, 0.25], 0.25);
        assert!((quarter.white - 1.2).abs() < 1e-9 && (quarter.other - 0.1).abs() < 1e-9);
        assert!((quarter.wanted(1, 0.7).most - 0.5).abs() < 1e-9);
        assert!((dim.wanted(1, 0.9).least - 1.0 / 8.0 / 0.3).abs() < 1e-9);
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
        // 41 pixels of 3 % from 0.3 to 1.
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

    #[test]
    fn a_dark_place_beside_a_bright_one_keeps_its_light() {
        let mut wanted = wanted(0.3, |u, _| u < 20);
        for (at, wanted) in wanted
            .iter_mut()
            .enumerate()
            .filter(|(at, _)| at % 60 >= 20)
        {
            wanted.least = if at / 60 < 20 { 0.8 } else { 0.4 };
        }
        let amplitude = amplitude(&map(|_, _| false), &wanted, 120, 80, 9.5);
        let at = |column: usize, row: usize| amplitude[row * 120 + column];
        assert_eq!([at(36, 10), at(40, 10), at(41, 70)], [76, 204, 102]);
        assert_eq!([at(119, 10), at(119, 70)], [255; 2]);
    }
}
