//! Fits the cubic of one pixel, by least squares to exact phases at heights around the known one,
//! where a block of the frame lies near pixels of the known surface.

use super::{KnownSurface, REACH_UNIT};
use crate::geometry::{Sight, Triangulator};
use crate::math;
use crate::units::{AbsolutePhase, Height};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Side of a block in pixels: blocks decide which pixels get a cubic.
const SIDE: usize = 16;
/// Unit of the stored coefficients of y² and y³, nm: rounding is below 0.05 µm each.
pub(super) const UNIT_NM: f64 = 100.0;
/// The farthest a cubic is used from the known height, mm: offsets in nm are rounded in single
/// precision below 2²².
const MAX_RISE_MM: f64 = 4.1;
/// Largest error of a cubic at its nodes, mm: a fifth of the largest error that is allowed
/// anywhere, because between the nodes it may be larger. Its RMS is far smaller.
const MAX_MISS_MM: f64 = 1e-3;
/// Step of the difference quotient of the slope at the known height, mm.
const SLOPE_STEP: f64 = 0.05;
/// How many times the range is halved at most until a cubic fits.
const HALVINGS: usize = 4;
/// Offsets to which the cubic is fitted, as shares of the offset that the slope at the known height
/// predicts for the range. At no pitch above 4 px per turn do the pattern's samples lie closer
/// together than these nodes.
const NODES: [f64; 6] = [-1.06, -0.76, -0.34, 0.34, 0.76, 1.06];
/// The place of the last node.
const LAST: usize = NODES.len() - 1;

/// Square blocks of pixels, each with whether it or a block near it contains a known pixel.
pub(super) struct NearBlocks {
    width: usize,
    columns: usize,
    blocks: Vec<bool>,
}

impl NearBlocks {
    /// For a surface: every pixel within `around` pixels of a known one is in a near block.
    pub fn new(surface: &KnownSurface, around: usize) -> Self {
        let width = surface.width.max(1);
        let columns = width.div_ceil(SIDE);
        let height = surface.phase.len() / width;
        let rows = height.div_ceil(SIDE);
        let mut known = vec![false; columns * rows];
        for (v, row) in surface.phase.chunks(width).enumerate() {
            let blocks = known[v / SIDE * columns..].iter_mut();
            for (block, phases) in blocks.zip(row.chunks(SIDE)) {
                *block |= phases.iter().any(|phase| phase.is_known());
            }
        }
        let reach = around.div_ceil(SIDE);
        let near = |block: usize| {
            let across = math::around(block % columns, reach, columns);
            math::around(block / columns, reach, rows)
                .any(|row| known[row * columns..][across.clone()].iter().any(|on| *on))
        };
        Self {
            width,
            columns,
            blocks: (0..known.len()).map(near).collect(),
        }
    }

    /// The columns of each block along row `v`, and whether the block is near.
    pub fn row(&self, v: usize) -> impl Iterator<Item = (Range<usize>, bool)> {
        let blocks = &self.blocks[v / SIDE * self.columns..][..self.columns];
        let starts = (0..self.width).step_by(SIDE);
        starts
            .zip(blocks)
            .map(|(start, near)| (start..(start + SIDE).min(self.width), *near))
    }
}

/// A pixel's cubic as it is stored.
pub(super) struct Cubic {
    pub first: f32,
    pub second: i16,
    pub third: i16,
    pub reach: u8,
}

/// The fit of a pixel's cubic, prepared for all pixels.
pub(super) struct CubicFit<'a> {
    triangulator: &'a Triangulator,
    range: f64,
}

impl<'a> CubicFit<'a> {
    pub fn new(triangulator: &'a Triangulator, range: f64) -> Self {
        Self {
            triangulator,
            range,
        }
    }

    /// Computes the phase of pixel (u, v) from its height, if it is not known.
    pub fn complete(&self, (u, v): (usize, usize), phase: &mut AbsolutePhase, height: Height) {
        if !phase.is_known() {
            let found = self
                .sight((u, v), height)
                .and_then(|sight| sight.phase(height.mm()));
            *phase = found.map_or(AbsolutePhase::UNKNOWN, AbsolutePhase::from_turns);
        }
    }

    /// Computes the unknown phases of columns of row `v`: the outermost two from
    /// their heights, the others by linear interpolation.
    pub fn between(
        &self,
        v: usize,
        columns: Range<usize>,
        phases: &mut [AbsolutePhase],
        heights: &[Height],
    ) {
        let (first, last) = (columns.start, columns.end - 1);
        for u in [first, last] {
            self.complete((u, v), &mut phases[u], heights[u]);
        }
        let (from, to) = (phases[first], phases[last]);
        if !(from.is_known() && to.is_known()) {
            return;
        }
        let rise = i64::from(to.to_bits()) - i64::from(from.to_bits());
        for (step, phase) in (0..).zip(&mut phases[first..last]) {
            let along = rise * step / (last - first) as i64;
            *phase = AbsolutePhase::from_bits((i64::from(from.to_bits()) + along) as i32);
        }
    }

    fn sight(&self, (u, v): (usize, usize), height: Height) -> Option<Sight<'_>> {
        let known = height.is_known();
        known.then(|| self.triangulator.sight(u as f64, v as f64))?
    }

    /// The cubic about phase and height of pixel (u, v); `None` if none fits, not even over a
    /// sixteenth of the range. An unknown phase is computed from the height.
    pub fn cubic(
        &self,
        (u, v): (usize, usize),
        phase: &mut AbsolutePhase,
        height: Height,
    ) -> Option<Cubic> {
        let sight = self.sight((u, v), height)?;
        let height = height.mm();
        if !phase.is_known() {
            *phase = AbsolutePhase::from_turns(sight.phase(height)?);
        }
        if !phase.is_known() {
            return None;
        }
        let phase = phase.turns();
        let working = self.triangulator.range();
        let room = (working.high - height).min(height - working.low);
        let slope = (sight.phase(height + SLOPE_STEP)? - phase) / SLOPE_STEP;
        let mut step = (self.range / libm::fabs(slope)).min(room.min(MAX_RISE_MM) / NODES[LAST]);
        if !(step > 0.0) {
            return None;
        }
        for _ in 0..=HALVINGS {
            if let Some(cubic) = self.fit(&sight, (phase, height), step) {
                return Some(cubic);
            }
            step *= 0.5;
        }
        None
    }

    /// The cubic through the known point that is fitted to offsets up to `step` mm, if its error is
    /// small enough.
    fn fit(&self, sight: &Sight<'_>, (phase, height): (f64, f64), step: f64) -> Option<Cubic> {
        let share = 1.0 / self.range;
        let mut nodes = [(0.0, 0.0); NODES.len()];
        for (node, part) in nodes.iter_mut().zip(NODES) {
            let offset = part * step;
            *node = ((sight.phase(height + offset)? - phase) * share, offset);
        }
        let ends = [nodes[0].0, nodes[LAST].0];
        let rising = ends[1] > ends[0];
        let monotone = nodes
            .windows(2)
            .all(|pair| (pair[1].0 > pair[0].0) == rising && pair[1].0 != pair[0].0);
        let reach = libm::fabs(ends[0]).min(libm::fabs(ends[1])).min(1.0) * self.range;
        // Positive and below 128, so a byte holds its whole part.
        let reach = (reach / REACH_UNIT + 1e-9) as u8;
        if !(monotone && ends[0] * ends[1] < 0.0 && reach >= 1) {
            return None;
        }
        let [first, second, third] = least_squares(&nodes)?;
        let cubic = Cubic {
            first: (first * 1e6) as f32,
            second: stored(second)?,
            third: stored(third)?,
            reach,
        };
        let fits = nodes.iter().all(|&(y, offset)| {
            // False for NaN as well.
            libm::fabs(cubic.offset(y) - offset) <= MAX_MISS_MM
        });
        fits.then_some(cubic)
    }
}

/// A coefficient in units of [`UNIT_NM`], if it fits.
fn stored(mm: f64) -> Option<i16> {
    let units = mm * (1e6 / UNIT_NM);
    let inside = libm::fabs(units) <= f64::from(i16::MAX);
    // Nearest, ties away from 0.
    inside.then(|| (units + if units < 0.0 { -0.5 } else { 0.5 }) as i16)
}

impl Cubic {
    /// z − z₀ in mm.
    fn offset(&self, y: f64) -> f64 {
        let [second, third] = [self.second, self.third].map(|units| f64::from(units) * UNIT_NM);
        y * (f64::from(self.first) + y * (second + y * third)) * 1e-6
    }
}

/// The coefficients of y, y² and y³ that fit (y, offset) best.
fn least_squares(nodes: &[(f64, f64)]) -> Option<[f64; 3]> {
    // Sums of y² to y⁶, and of offset times y to y³.
    let (mut powers, mut right) = ([0.0; 5], [0.0; 3]);
    for &(y, offset) in nodes {
        let square = y * y;
        let mut power = square;
        for sum in &mut powers {
            *sum += power;
            power *= y;
        }
        right[0] += offset * y;
        right[1] += offset * square;
        right[2] += offset * square * y;
    }
    let [a, b, c, d, e] = powers;
    // The matrix [a b c; b c d; c d e] by its cofactors.
    let rows = [
        [c * e - d * d, c * d - b * e, b * d - c * c],
        [c * d - b * e, a * e - c * c, b * c - a * d],
        [b * d - c * c, b * c - a * d, a * c - b * b],
    ];
    let determinant = a * rows[0][0] + b * rows[0][1] + c * rows[0][2];
    (determinant > 0.0).then(|| {
        let scale = 1.0 / determinant;
        rows.map(|row| (row[0] * right[0] + row[1] * right[1] + row[2] * right[2]) * scale)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{AbsolutePhase, Height};

    #[test]
    fn every_pixel_within_the_distance_of_a_known_one_is_near_and_most_others_are_not() {
        let (width, height, around) = (150, 90, 20);
        let mut surface = KnownSurface {
            width,
            phase: vec![AbsolutePhase::UNKNOWN; width * height],
            height: vec![Height::from_nm(0); width * height],
        };
        let (column, row) = (70_usize, 40_usize);
        surface.phase[row * width + column] = AbsolutePhase::from_turns(1.0);
        let blocks = NearBlocks::new(&surface, around);
        let mut far = 0;
        for v in 0..height {
            let mut next = 0;
            for (columns, near) in blocks.row(v) {
                assert_eq!(columns.start, next);
                next = columns.end;
                for u in columns {
                    let close = u.abs_diff(column) <= around && v.abs_diff(row) <= around;
                    assert!(near || !close, "({u}, {v})");
                    far += usize::from(!near);
                }
            }
            assert_eq!(next, width);
        }
        assert!(far > width * height / 3, "{far}");
    }
}
