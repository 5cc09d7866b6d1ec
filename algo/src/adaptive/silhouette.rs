//! Silhouettes that the camera's blur falsifies.
//!
//! **Idea.** Blur mixes the light of neighbouring pixels. Inside a surface the neighbours on both
//! sides pull the phase to either side alike. Beside a silhouette they are on one side only, and
//! where the surface is steep there, the height is off by far more than its σ: no noise shows it,
//! and no pitch helps.
//!
//! **Equation.** With weights w_k = exp(−k²/2σ²) of the pixels k = 0, 1, 2, … from the silhouette
//! inwards, the light of the outermost pixel comes from Σ k w_k / Σ w_k pixels inwards. Times the
//! step of ξ from pixel to pixel this is the shift in projector pixels.

use super::ProjectorMap;
use super::map::UNKNOWN;

/// Largest shift of a pixel that counts, projector pixels.
const MOST_SHIFT: f64 = 0.5;
/// Pixels inwards that are added up.
const REACH: u32 = 64;

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
    let pixels = || (0..REACH).map(f64::from);
    pixels().map(|k| k * weight(k)).sum::<f64>() / pixels().map(weight).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

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
