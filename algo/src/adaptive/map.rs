//! The projector point that lights each camera pixel's point of the surface, without silhouettes
//! that the camera's blur falsifies.
//!
//! **Silhouettes.** Blur mixes the light of neighbouring pixels. Inside a surface the neighbours on
//! both sides pull the phase to either side alike. Beside a silhouette they are on one side only,
//! and where the surface is steep there, the height is off by far more than its σ: no noise shows
//! it, and no pitch helps.
//!
//! **Equation.** With weights w_k = exp(−k²/2σ²) of the pixels k = 0, 1, 2, … from the silhouette
//! inwards, the light of the outermost pixel comes from Σ k w_k / Σ w_k pixels inwards. Times the
//! step of ξ from pixel to pixel this is the shift in projector pixels.

use crate::geometry::Triangulator;
use crate::pattern::PhaseFunction;
use crate::pipeline::{HeightMap, for_each_row, over_squares};
use crate::units::AbsolutePhase;
use alloc::vec;
use alloc::vec::Vec;

/// Largest shift of a pixel that counts, projector pixels.
const MOST_SHIFT: f64 = 0.5;
/// Pixels inwards that are added up.
const INWARD_PIXELS: u32 = 64;
/// An unknown projector point.
pub(super) const UNKNOWN: [f64; 2] = [f64::NAN; 2];

/// The projector point (ξ, η) of each camera pixel, row-major over the camera's frame, NaN where it
/// is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct ProjectorMap {
    /// Camera columns.
    pub width: usize,
    /// (ξ, η) in projector pixels.
    pub points: Vec<[f64; 2]>,
}

impl ProjectorMap {
    /// The map from the heights of a preliminary measurement with vertical fringes: η follows from
    /// projecting the point. As camera and projector lie beside each other, an error of the height
    /// hardly changes η, and horizontal fringes are not needed.
    pub fn from_heights(triangulator: &Triangulator, heights: &HeightMap) -> Self {
        let width = heights.width;
        let mut points = vec![UNKNOWN; heights.height.len()];
        for_each_row(&mut points, width, |v, row| {
            for (u, here) in row.iter_mut().enumerate() {
                let found = triangulator
                    .point(u, v, heights.height[v * width + u])
                    .and_then(|point| triangulator.projector_point(point));
                if let Some((xi, eta)) = found {
                    *here = [xi, eta];
                }
            }
        });
        Self { width, points }
    }

    /// The map from preliminary measurements with vertical and horizontal fringes: ξ = `across` ×
    /// vertical phase, η = `down` × horizontal phase, where `across` and `down` are their pitches
    /// in projector pixels (Peng & Gupta 2008, eqs. 3 and 4).
    pub fn from_phases(
        [vertical, horizontal]: [&[AbsolutePhase]; 2],
        [across, down]: [f64; 2],
        width: usize,
    ) -> Self {
        let points = vertical.iter().zip(horizontal).map(|(v, h)| {
            if v.is_known() && h.is_known() {
                [across * v.turns(), down * h.turns()]
            } else {
                UNKNOWN
            }
        });
        Self {
            width,
            points: points.collect(),
        }
    }

    /// The phase of each pixel under a phase function, if the surface has not moved since it was
    /// measured; unknown where it was not resolved.
    pub fn expected_phase(&self, function: &PhaseFunction) -> Vec<AbsolutePhase> {
        let phase = |[xi, eta]: &[f64; 2]| AbsolutePhase::from_turns(function.at(*xi, *eta));
        self.points.iter().map(phase).collect()
    }

    /// Camera rows.
    pub fn height(&self) -> usize {
        self.points.len() / self.width.max(1)
    }

    /// The projector point of a camera pixel, if it is inside the frame and known.
    #[inline]
    pub fn at(&self, u: isize, v: isize) -> Option<[f64; 2]> {
        let inside = self.is_inside(u, v);
        let point = inside.then(|| self.points[v as usize * self.width + u as usize])?;
        (!point[0].is_nan()).then_some(point)
    }

    /// Whether a pixel lies inside the frame.
    pub(super) fn is_inside(&self, u: isize, v: isize) -> bool {
        u >= 0 && v >= 0 && u < self.width as isize && v < self.height() as isize
    }

    /// Erodes the known region by one pixel, because silhouettes mix surfaces: a pixel stays known
    /// if all 3 × 3 pixels around it, inside the frame, are known.
    pub fn eroded(&self) -> Self {
        let known: Vec<bool> = self.points.iter().map(|at| !at[0].is_nan()).collect();
        let known = over_squares(&known, self.width, 1, |a, b| a && b);
        let points = self.points.iter().zip(known);
        let points = points.map(|(at, known)| if known { *at } else { UNKNOWN });
        Self {
            width: self.width,
            points: points.collect(),
        }
    }

    /// J = (∂ξ/∂u, ∂ξ/∂v) of each pixel, by a plane fit over its known 5 × 5 neighbours whose ξ
    /// differs by at most `max_slope` projector pixels per camera pixel (so that surfaces do not
    /// mix at edges); NaN where the neighbours do not determine it.
    pub fn slopes(&self, max_slope: f64) -> Vec<[f64; 2]> {
        let mut slopes = vec![[f64::NAN; 2]; self.points.len()];
        for_each_row(&mut slopes, self.width, |v, row| {
            for (u, slope) in row.iter_mut().enumerate() {
                if let Some(found) = self.slope(u as isize, v as isize, max_slope) {
                    *slope = found;
                }
            }
        });
        slopes
    }

    fn slope(&self, u: isize, v: isize, max_slope: f64) -> Option<[f64; 2]> {
        let [centre, _] = self.at(u, v)?;
        // Sums of x = du, y = dv and z = Δξ and of their products; below, the products are taken
        // about the means.
        let (mut n, mut x, mut y, mut z) = (0.0, 0.0, 0.0, 0.0);
        let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for dv in -2..=2_isize {
            for du in -2..=2_isize {
                let Some([xi, _]) = self.at(u + du, v + dv) else {
                    continue;
                };
                let (a, b, difference) = (du as f64, dv as f64, xi - centre);
                let distance = libm::fabs(a).max(libm::fabs(b));
                if libm::fabs(difference) > max_slope * distance {
                    continue;
                }
                n += 1.0;
                x += a;
                y += b;
                z += difference;
                xx += a * a;
                xy += a * b;
                yy += b * b;
                xz += a * difference;
                yz += b * difference;
            }
        }
        let (xx, xy, yy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
        let (xz, yz) = (xz - x * z / n, yz - y * z / n);
        let determinant = xx * yy - xy * xy;
        if n < 6.0 || determinant < 1.0 {
            return None;
        }
        Some([
            (xz * yy - yz * xy) / determinant,
            (yz * xx - xz * xy) / determinant,
        ])
    }
}

impl ProjectorMap {
    /// The map without the pixels at silhouettes whose light comes from more than half a projector
    /// pixel beside them, for a camera whose blur has this σ, camera pixels.
    pub fn without_blurred_silhouettes(&self, camera_blur: f64) -> Self {
        let inwards = inwards(camera_blur);
        let points = (0..self.points.len()).map(|place| {
            let (u, v) = ((place % self.width) as isize, (place / self.width) as isize);
            let shift = inwards * self.step_at_silhouette(u, v).unwrap_or(0.0);
            if shift > MOST_SHIFT {
                UNKNOWN
            } else {
                self.points[place]
            }
        });
        Self {
            width: self.width,
            points: points.collect(),
        }
    }

    /// The largest step of ξ per pixel from a known pixel at a silhouette to known pixels near it.
    /// `None` away from silhouettes.
    fn step_at_silhouette(&self, u: isize, v: isize) -> Option<f64> {
        let [here, _] = self.at(u, v)?;
        let (mut largest, mut beside) = (0.0_f64, false);
        for (du, dv) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            beside |= self.is_inside(u + du, v + dv) && self.at(u + du, v + dv).is_none();
            // The next pixel may be too dark to be known.
            for far in 1..=2 {
                if let Some([xi, _]) = self.at(u + far * du, v + far * dv) {
                    largest = largest.max(libm::fabs(xi - here) / far as f64);
                }
            }
        }
        beside.then_some(largest)
    }
}

/// Σ k w_k / Σ w_k, camera pixels.
fn inwards(sigma: f64) -> f64 {
    let weight = |k: f64| libm::exp(-0.5 * (k / sigma.max(1e-9)) * (k / sigma.max(1e-9)));
    let pixels = || (0..INWARD_PIXELS).map(f64::from);
    pixels().map(|k| k * weight(k)).sum::<f64>() / pixels().map(weight).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_projector_point_is_the_pitch_times_its_two_phases() {
        let phases = |turns: [f64; 3]| turns.map(AbsolutePhase::from_turns);
        let (vertical, horizontal) = (phases([0.5, 3.0, 1.0]), phases([2.0, f64::NAN, 0.25]));
        let map = ProjectorMap::from_phases([&vertical, &horizontal], [20.0, 16.0], 3);
        assert_eq!(map.at(0, 0), Some([10.0, 32.0]));
        assert_eq!(map.at(1, 0), None);
        assert_eq!(map.at(2, 0), Some([20.0, 4.0]));
    }

    #[test]
    fn only_steep_silhouettes_of_a_blurred_camera_are_dropped() {
        // A surface over columns 3 to 12; its slope rises from 1 to 10 projector pixels per pixel.
        let point = |at: usize| match at % 16 {
            column @ 3..13 => [0.5 * (column - 2).pow(2) as f64, (at / 16) as f64],
            _ => UNKNOWN,
        };
        let map = ProjectorMap {
            width: 16,
            points: (0..16 * 5).map(point).collect(),
        };
        assert_eq!(inwards(0.0), 0.0);
        // 0.135 / 1.135 of a pixel, times 1.5 and 9.5.
        assert!((inwards(0.5) - 0.1195).abs() < 1e-3);
        let sharp = map.without_blurred_silhouettes(0.2);
        let known = |map: &ProjectorMap, u| map.at(u, 2).is_some();
        assert!((3..13).all(|u| known(&sharp, u)));
        let blurred = map.without_blurred_silhouettes(0.5);
        assert!((3..12).all(|u| known(&blurred, u)) && !known(&blurred, 12));
        // The frame's own border is no silhouette.
        assert!((0..5).all(|v| blurred.at(7, v).is_some()));
    }
}
