//! Which cells of a plane's region lie on its face.
//!
//! A hole in the region shows a floor, which is no part of the face and does not move with the
//! part. The face is one connected surface of golden's region: of a plane its largest, around a
//! contour the highest of the large ones, because the camera sees the rim of the upper face. A cell
//! is left out if one of its pixels lies off the plane of that surface.

use super::taught::{Grid, TaughtCell};
use crate::geometry::Vector;
use crate::inspect::align::GoldenSurface;
use crate::inspect::region::Region;
use crate::math::solve::Normal;
use alloc::vec;
use alloc::vec::Vec;

/// Neighbours whose heights differ by less belong to one surface, mm: more than those of a face at
/// 60° with half a mm per pixel, and less than a floor is below a sheet.
const STEP_MM: f64 = 1.0;
/// What lies farther from the plane of the face is no part of it, mm.
const OFF_MM: f64 = 1.0;
/// A surface with this share of the pixels of the largest one is a large one.
const LARGE: f64 = 0.1;
/// The largest surface of a plane's region is its face if it has this share of the pixels.
const MOST: f64 = 0.5;

/// Leaves out the cells with a pixel that is not on the face: of the surface that is the highest, or
/// else the largest.
pub fn keep_face(
    cells: &mut [TaughtCell],
    (grid, region): (&Grid, &Region),
    golden: GoldenSurface<'_>,
    highest: bool,
) {
    let width = golden.surface.width;
    let all: Vec<(usize, Vector)> = region
        .places(width)
        .filter(|&place| golden.taught.compared(place))
        .filter_map(|place| {
            let (u, v) = (place % width, place / width);
            let point = golden
                .triangulator
                .point(u, v, golden.surface.height[place])?;
            Some((place, point))
        })
        .collect();
    let surface = connected(&all, width);
    let count = surface.iter().max().map_or(0, |last| last + 1);
    let (mut pixels, mut heights) = (vec![0.0; count], vec![0.0; count]);
    for (&of, (_, point)) in surface.iter().zip(&all) {
        pixels[of] += 1.0;
        heights[of] += point.z;
    }
    let largest = pixels.iter().copied().fold(0.0, f64::max);
    let rank = |of: &usize| match highest {
        true => heights[*of] / pixels[*of],
        false => pixels[*of],
    };
    let large = (0..count).filter(|&of| pixels[of] >= LARGE * largest);
    let face = large.max_by(|a, b| rank(a).total_cmp(&rank(b)));
    // A face of many pieces is steeper, or rough: all of it is taken.
    let is_whole = |face: &usize| highest || pixels[*face] >= MOST * all.len() as f64;
    let Some(face) = face.filter(is_whole) else {
        return;
    };
    let on_face = surface.iter().zip(&all).filter(|(of, _)| **of == face);
    let normal = Normal::of(on_face.map(|(_, (_, p))| ([1.0, p.x, p.y], p.z)));
    let Some([c, a, b]) = normal.solve() else {
        return;
    };
    let length = libm::sqrt(1.0 + a * a + b * b);
    for (place, point) in &all {
        if libm::fabs(point.z - c - a * point.x - b * point.y) > OFF_MM * length {
            let cell = grid.cell((place % width) as i32, (place / width) as i32);
            cells[cell].pixels = 0;
        }
    }
}

/// The number of the surface that each of the pixels, in row-major order, belongs to.
fn connected(all: &[(usize, Vector)], width: usize) -> Vec<usize> {
    let at = |place: usize| all.binary_search_by_key(&place, |(place, _)| *place).ok();
    let mut surface = vec![usize::MAX; all.len()];
    let (mut count, mut next) = (0, Vec::new());
    for first in 0..all.len() {
        if surface[first] != usize::MAX {
            continue;
        }
        surface[first] = count;
        next.push(first);
        while let Some(here) = next.pop() {
            let (place, point) = all[here];
            let beside = [
                place.checked_sub(width),
                place.checked_sub(1),
                Some(place + 1),
                Some(place + width),
            ];
            for other in beside.into_iter().flatten().filter_map(at) {
                let rise = all[other].1.z - point.z;
                if surface[other] == usize::MAX && libm::fabs(rise) < STEP_MM {
                    surface[other] = count;
                    next.push(other);
                }
            }
        }
        count += 1;
    }
    surface
}
