//! The phase that each pixel would have if the part were golden and lay displaced.
//!
//! A pixel that sees height z sees the part's point p; with the motion taken back, p lies at the taught coordinates (u, v) + (du, dv)
//! and dz higher (`pose.rs`). So z = G(u + du, v + dv) − dz with golden's heights G. As du, dv and dz hardly change with z, two
//! rounds find it, and the inverse of the pixel's cubic gives its phase.

use super::super::Production;
use super::super::displaced::{Node, VALUES};
use super::super::pose::{SPACING, nodes};
use super::window::Expected;
use crate::inspect::align::Motion;
use crate::pipeline::for_each_row;
use crate::units::{AbsolutePhase, Height};
use alloc::vec::Vec;

/// Rounds in which the height of a pixel is found.
const ROUNDS: usize = 2;

impl Production {
    /// The phase of each pixel (row-major) for a part that lies so. Around the part and in its openings golden's surface is
    /// interpolated ([`super::super::Parts::cubics`]).
    pub(super) fn expect(&self, motion: &Motion, out: &mut [Expected]) {
        let (width, height) = self.size();
        let across: Vec<usize> = nodes(width).collect();
        let down: Vec<usize> = nodes(height).collect();
        let displacements: Vec<Node> = down
            .iter()
            .flat_map(|&v| across.iter().map(move |&u| (u, v)))
            .map(|at| self.node(motion, at, &self.sight(at)))
            .collect();
        for_each_row(out, width, |v, row| {
            let (upper, lower) = (v / SPACING, (v / SPACING + 1).min(down.len() - 1));
            let share = (v - down[upper]) as f64 / (down[lower] - down[upper]).max(1) as f64;
            let node = |at: usize| -> Node {
                let pick = |row: usize| &displacements[row * across.len() + at];
                between(pick(upper), pick(lower), share)
            };
            for (at, columns) in across.windows(2).enumerate() {
                let (left, right) = (node(at), node(at + 1));
                let unit = 1.0 / (columns[1] - columns[0]) as f64;
                let pixels = &mut row[columns[0]..=columns[1]];
                for (u, pixel) in (columns[0]..).zip(pixels) {
                    let share = (u - columns[0]) as f64 * unit;
                    *pixel = self.expected((u, v), &between(&left, &right, share));
                }
            }
        });
    }

    /// The same of a part that lies as taught.
    pub(super) fn as_taught(&self) -> impl Iterator<Item = Expected> {
        let phases = self.cubics.surface().phase.iter().enumerate();
        phases.map(|(place, &phase)| Expected {
            phase,
            compared: self.taught.compared(place),
        })
    }

    /// That of a pixel with this displacement.
    fn expected(&self, (u, v): (usize, usize), displacement: &Node) -> Expected {
        let (width, surface) = (self.size().0, self.cubics.surface());
        let place = v * width + u;
        let nothing = Expected {
            phase: surface.phase[place],
            compared: false,
        };
        // Far from the part the surface is not planned.
        if !surface.height[place].is_known() || self.cubics.reach(place) == 0.0 {
            return nothing;
        }
        let base = surface.height[place].mm();
        let (mut z, mut taught) = (base, place);
        for _ in 0..ROUNDS {
            let above = z - self.levels.0;
            let [du, dv, dz]: [f64; VALUES] =
                core::array::from_fn(|i| displacement[i] + displacement[VALUES + i] * above);
            match self.golden_at(u as f64 + du, v as f64 + dv) {
                Some((height, at)) => (z, taught) = (height - dz, at),
                None => return nothing,
            }
        }
        let compared = self.taught.compared(taught);
        let exact = || {
            let point = self.triangulator.point(u, v, Height::from_mm(z))?;
            let (xi, eta) = self.triangulator.projector_point(point)?;
            Some(AbsolutePhase::from_turns(
                self.triangulator.function().at(xi, eta),
            ))
        };
        let phase = self.cubics.phase_of(place, z - base).or_else(exact);
        Expected {
            phase: phase.unwrap_or(AbsolutePhase::UNKNOWN),
            compared,
        }
    }

    /// Golden's height between four pixels, mm, by bilinear interpolation, and the nearest of them; none outside of the frame.
    fn golden_at(&self, u: f64, v: f64) -> Option<(f64, usize)> {
        let (width, height) = self.size();
        let inside = u >= 0.0 && v >= 0.0 && u < (width - 1) as f64 && v < (height - 1) as f64;
        if !inside {
            return None;
        }
        let (left, top) = (u as usize, v as usize);
        let (across, down) = (u - left as f64, v - top as f64);
        let heights = &self.cubics.surface().height[top * width + left..];
        let four = [0, 1, width, width + 1].map(|at| heights[at]);
        if !four.iter().all(|height| height.is_known()) {
            return None;
        }
        let [a, b, c, d] = four.map(|height| f64::from(height.nm()));
        let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
        let mm = (upper + (lower - upper) * down) * 1e-6;
        let nearest = (top + usize::from(down >= 0.5)) * width + left + usize::from(across >= 0.5);
        Some((mm, nearest))
    }
}

fn between(a: &Node, b: &Node, share: f64) -> Node {
    core::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}
