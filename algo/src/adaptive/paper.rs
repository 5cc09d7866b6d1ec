//! The paper's adaptive pattern, unchanged (Peng & Gupta 2008, eqs. 2–9): the baseline.
//!
//! In turns: preliminary patterns Φ^V = ξ/(c p_P), Φ^H = η/p_H give each camera pixel its projector
//! point. Where the fringes of the camera's image would be finer than p_I, |∂Φ^V/∂u| > 1/(c p_I),
//! the pattern's pitch grows in proportion, G = 1/(c p_I p_P |∂Φ^V/∂u|); elsewhere it is p_P.

use super::field::{Field, rows_from_zero};
use super::{AdaptError, ProjectorMap};
use crate::inspect::{components, polygon_spans};
use crate::pattern::PhaseFunction;
use alloc::vec;
use alloc::vec::Vec;

/// p_P, the smallest projector pitch, in projector pixels.
pub const PROJECTOR_PITCH: f64 = 8.0;
/// c: the preliminary patterns' pitch is this many times p_P.
pub const PRELIMINARY: f64 = 2.5;
/// p_I, the smallest image pitch, in camera pixels. The paper does not state it; the baseline uses
/// this value.
pub const IMAGE_PITCH: f64 = 5.0;
/// Largest local pitch, projector pixels.
const MAX_PITCH: f64 = 128.0;
/// Neighbours that differ by more than this many projector pixels per camera pixel are depth edges,
/// not slopes.
const MAX_SLOPE: f64 = 24.0;
/// Smaller components of the mask are dropped, camera pixels.
const MIN_COMPONENT: usize = 40;
/// σ of the smoothing of G, projector pixels.
const SMOOTHING: f64 = 4.0;

/// Makes the paper's phase function for a part, over a projector of `columns` × `rows` pixels.
/// `image_pitch` is p_I.
///
/// # Errors
/// If no pixel of the part is known.
pub fn adapt(
    map: &ProjectorMap,
    columns: usize,
    rows: usize,
    image_pitch: f64,
) -> Result<PhaseFunction, AdaptError> {
    let map = map.eroded();
    if map.points.iter().all(|point| point[0].is_nan()) {
        return Err(AdaptError::Empty);
    }
    let slopes = slopes(&map);
    // Eq. 6: |∂Φ^V/∂u| > 1/(c p_I) with Φ^V = ξ/(c p_P).
    let steep: Vec<bool> = slopes
        .iter()
        .map(|slope| *slope > PROJECTOR_PITCH / image_pitch)
        .collect();
    let mut field = Field::uniform(columns, rows, 1.0 / PROJECTOR_PITCH);
    for component in components(&steep, map.width, true) {
        if component.len() >= MIN_COMPONENT {
            stretch(&mut field, &map, &slopes, &component, image_pitch);
        }
    }
    let turns = rows_from_zero(&field.smoothed([SMOOTHING; 2]));
    PhaseFunction::sampled(columns, rows, turns).map_err(AdaptError::Pattern)
}

/// |∂ξ/∂u| by central differences, NaN at depth edges and where a neighbour is not known.
fn slopes(map: &ProjectorMap) -> Vec<f64> {
    let slope = |place: usize| {
        let (u, v) = ((place % map.width) as isize, (place / map.width) as isize);
        let [left, _] = map.at(u - 1, v)?;
        let [right, _] = map.at(u + 1, v)?;
        let step = libm::fabs(right - left) / 2.0;
        (map.at(u, v).is_some() && step <= MAX_SLOPE).then_some(step)
    };
    (0..map.points.len())
        .map(|place| slope(place).unwrap_or(f64::NAN))
        .collect()
}

/// Eq. 7 over the component's image in the pattern: its boundary is mapped by eq. 4 and filled;
/// each cell takes the mean of the pixels that map to it, other cells are interpolated along their
/// row.
fn stretch(
    field: &mut Field,
    map: &ProjectorMap,
    slopes: &[f64],
    component: &[usize],
    image_pitch: f64,
) {
    let (columns, rows) = (field.columns, field.rows());
    let mut sums: Vec<(f64, f64)> = vec![(0.0, 0.0); columns * rows];
    for &place in component {
        if let Some(cell) = field.cell(map.points[place]) {
            let pitch = (image_pitch * slopes[place]).clamp(PROJECTOR_PITCH, MAX_PITCH);
            sums[cell].0 += 1.0 / pitch;
            sums[cell].1 += 1.0;
        }
    }
    let corners: Vec<(f64, f64)> = boundary(component, map.width)
        .into_iter()
        .map(|place| (map.points[place][0], map.points[place][1]))
        .collect();
    let mut inside = Field::uniform(columns, rows, f64::NAN);
    let mut masked = vec![false; columns * rows];
    for (row, span) in polygon_spans(&corners, columns, rows) {
        masked[row * columns + span.start..row * columns + span.end].fill(true);
    }
    for (cell, &(sum, count)) in sums.iter().enumerate() {
        if count > 0.0 {
            masked[cell] = true;
            inside.values[cell] = sum / count;
        }
    }
    inside.fill_near(1);
    inside.fill_rows(1.0 / PROJECTOR_PITCH);
    for (cell, on) in masked.iter().enumerate() {
        if *on {
            field.values[cell] = inside.values[cell];
        }
    }
}

/// The outer boundary of a component as a closed walk over its pixels (Moore's neighbour tracing,
/// until the start is left in the first direction again).
fn boundary(component: &[usize], width: usize) -> Vec<usize> {
    const AROUND: [(isize, isize); 8] = [
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
    ];
    let mut sorted = component.to_vec();
    sorted.sort_unstable();
    let on = |u: isize, v: isize| {
        let inside = u >= 0 && v >= 0 && u < width as isize;
        inside
            && sorted
                .binary_search(&(v as usize * width + u as usize))
                .is_ok()
    };
    let start = sorted[0];
    let (mut u, mut v) = ((start % width) as isize, (start / width) as isize);
    let mut walk = vec![start];
    // The start is the topmost leftmost pixel: nothing lies to its left.
    let mut back = 0;
    let mut first = None;
    for _ in 0..4 * component.len() + 4 {
        let step = (1..=8).map(|turn| (back + turn) % 8).find(|&direction| {
            let (du, dv) = AROUND[direction];
            on(u + du, v + dv)
        });
        let Some(direction) = step else { break };
        if v as usize * width + u as usize == start {
            if first == Some(direction) {
                break;
            }
            first.get_or_insert(direction);
        }
        let (du, dv) = AROUND[direction];
        (u, v) = (u + du, v + dv);
        walk.push(v as usize * width + u as usize);
        // Look on from the neighbour behind the one just left.
        back = (direction + 4) % 8;
    }
    walk
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boundary_goes_once_around_a_block() {
        let component: Vec<usize> = (2..5)
            .flat_map(|v| (3..7).map(move |u| v * 10 + u))
            .collect();
        let mut walk = boundary(&component, 10);
        walk.sort_unstable();
        walk.dedup();
        // 4 × 3 pixels: all but the two inner ones.
        assert_eq!(walk.len(), 10);
        assert!(!walk.contains(&34) && !walk.contains(&35));
    }

    #[test]
    fn a_flat_part_keeps_the_smallest_pitch_and_a_steep_one_is_stretched() {
        let flat = ProjectorMap {
            width: 100,
            points: (0..100 * 80)
                .map(|place| [100.0 + (place % 100) as f64, 50.0 + (place / 100) as f64])
                .collect(),
        };
        let function = adapt(&flat, 400, 200, 5.0).unwrap();
        assert!((function.at(300.0, 90.0) - 300.0 / 8.0).abs() < 1e-9);
        let steep = ProjectorMap {
            points: flat
                .points
                .iter()
                .map(|[xi, eta]| [100.0 + 3.0 * (xi - 100.0), *eta])
                .collect(),
            ..flat
        };
        let function = adapt(&steep, 400, 200, 5.0).unwrap();
        // In the middle of the part the pitch is p_I · ∂ξ/∂u = 15 px.
        let pitch = 1.0 / (function.at(251.0, 90.0) - function.at(250.0, 90.0));
        assert!((pitch - 15.0).abs() < 0.1, "{pitch}");
    }
}
