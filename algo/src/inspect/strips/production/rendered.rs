//! A displaced part as this sequence would measure it, worked out from golden: what a recipe is
//! tried with when no part is moved.
//!
//! # Idea
//! The part as taught is a surface with a modulation at each pixel. Moved by a rigid motion, each
//! pixel of the camera sees another point of it: where the pixel's ray meets the moved surface. The
//! phase that the pattern has there, with the noise of its modulation, is what production would
//! decode.
//!
//! # Equations
//! With M the motion, π the camera's projection and G golden's height, z of a pixel's point p(z)
//! solves f(z) = G(π(q)) − q_z = 0, q = M⁻¹ p(z), a point of a straight line. A change of z moves q
//! along nearly one ray of the camera as taught, so f′ is about −1: quasi-Newton steps with the
//! slope of the last two values (secant method) converge within two or three evaluations from where
//! the pixel before lay above golden. Between pixels G is the cubic through four of them in each
//! direction (R. Keys, *Cubic convolution interpolation*, IEEE Trans. ASSP 29, 1981), where
//! production compares with straight lines: what these miss of a bent surface is part of what
//! displaced parts deviate by ([`missed`](crate::inspect::missed)).
//!
//! # Accuracy
//! Light that a motion sheds on other places, and what a pixel averages over beside creases, is as
//! taught. Deviations of parts in front of the simulated head are compared with it in
//! `tests/suite/every_part.rs`.

use crate::geometry::Vector;
use crate::inspect::align::Motion;
use crate::inspect::strips::golden::Golden;
use crate::inspect::strips::measure::PhasePlan;
use crate::phase::Trust;
use crate::pipeline::{PhaseMap, for_each};
use crate::units::{AbsolutePhase, Modulation};

/// Steps in which a ray is brought to the surface, and the largest last step, mm: what is left then
/// is a hundredth of it, as the slope is known that well.
const STEPS: usize = 6;
const LAST_STEP_MM: f64 = 5e-3;
/// f′ is taken to be within so much of −1; a secant that says otherwise has met an edge.
const SLOPES: f64 = 0.5;

/// The part as taught after a motion.
#[derive(Clone, Copy, Debug)]
pub struct Rendering<'a> {
    pub golden: &'a Golden,
    pub phase: &'a PhasePlan,
    pub motion: &'a Motion,
    /// Golden's by this sequence, row-major.
    pub modulation: &'a [Modulation],
    /// Other seeds give other noise, none gives none.
    pub seed: Option<u64>,
}

/// A row that is being rendered.
struct RenderedRow<'a> {
    of: Rendering<'a>,
    v: usize,
    /// What the pixel before saw above golden, mm, and f′ there.
    above: f64,
    slope: f64,
}

impl Rendering<'_> {
    /// Its phases.
    pub fn phases(&self) -> PhaseMap {
        let (width, height) = self.golden.size();
        let map = self.golden.map();
        let mut phases = PhaseMap::new(width, height);
        for_each(phases.rows(), |v, out| {
            let mut row = RenderedRow {
                of: *self,
                v,
                above: 0.0,
                slope: -1.0,
            };
            // Nothing looks at pixels outside of the window.
            for u in self.golden.window[v].clone() {
                // Nor does a sequence of limited reach at these.
                if !map[v * width + u].is_known() {
                    out.trust[u] = Trust::Unexpected;
                } else if let Some((phase, modulation)) = row.pixel(u) {
                    out.phase[u] = phase;
                    out.modulation[u] = modulation;
                    out.trust[u] = Trust::Resolved;
                }
            }
        });
        phases
    }

    /// Golden's height between pixels, mm, by a cubic in each direction; none where one of the
    /// sixteen pixels is not known.
    fn golden_height(&self, (u, v): (f64, f64)) -> Option<f64> {
        let (width, height) = self.golden.size();
        let (left, top) = (libm::floor(u), libm::floor(v));
        if left < 1.0 || top < 1.0 || left + 2.0 >= width as f64 || top + 2.0 >= height as f64 {
            return None;
        }
        let heights = &self.golden.cubics.surface().height;
        let (along, down) = (cubic(u - left), cubic(v - top));
        let first = (top as usize - 1) * width + left as usize - 1;
        let (mut sum, mut known) = (0.0, true);
        for (row, down) in down.iter().enumerate() {
            let row = &heights[first + row * width..][..4];
            let mut nm = 0.0;
            for (height, along) in row.iter().zip(&along) {
                known &= height.is_known();
                nm += f64::from(height.nm()) * along;
            }
            sum += nm * down;
        }
        known.then_some(sum * 1e-6)
    }
}

impl RenderedRow<'_> {
    /// Phase and modulation of a pixel; none if it sees no part, or too faintly.
    fn pixel(&mut self, u: usize) -> Option<(AbsolutePhase, Modulation)> {
        let Rendering { golden, phase, .. } = self.of;
        let (width, height) = golden.size();
        let place = self.v * width + u;
        let line = golden.triangulator.line(u as f64, self.v as f64)?;
        let (z, seen) = self.meets(u, line)?;
        let (column, row) = (libm::rint(seen.0) as usize, libm::rint(seen.1) as usize);
        if column >= width || row >= height {
            return None;
        }
        let draw = |seed: u64| normal((seed << 32) ^ place as u64);
        let [first, second] = self.of.seed.map_or([0.0; 2], draw);
        let decoder = &phase.decoder;
        let (full, most) = (f64::from(u16::MAX), decoder.full_scale());
        let counts = |light: Modulation| f64::from(light.to_bits()) / full * f64::from(most);
        let light = self.of.modulation[row * width + column];
        let noise = phase.noise.at(counts(light));
        let scatter = decoder.modulation_noise(noise) * full / f64::from(most);
        let bits = f64::from(light.to_bits()) + scatter * first;
        let light = Modulation::from_bits(libm::rint(bits.clamp(0.0, full)) as u16);
        if counts(light) < decoder.least_modulation().counts(most) {
            return None;
        }
        let turns = golden.triangulator.sight_along(line).phase(z)?;
        let noise = decoder.phase_noise(light, phase.noise) * second;
        let phase = AbsolutePhase::from_turns(turns + noise);
        phase.is_known().then_some((phase, light))
    }

    /// The height at which a pixel's ray meets the moved part, mm, and where golden was seen there.
    fn meets(&mut self, u: usize, (on_plane, rise): (Vector, Vector)) -> Option<(f64, (f64, f64))> {
        let Rendering { golden, motion, .. } = self.of;
        let taught = golden.height_mm(self.v * golden.size().0 + u);
        let start = motion.undo(on_plane);
        let rise = motion.undo(on_plane + rise) - start;
        let mut z = taught + self.above;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            let back = start + rise * z;
            let seen = golden.triangulator.camera().project(back)?;
            let off = self.of.golden_height(seen)? - back.z;
            if let Some((z_before, off_before)) = before {
                let slope = (off - off_before) / (z - z_before);
                if libm::fabs(slope + 1.0) < SLOPES {
                    self.slope = slope;
                }
            }
            before = Some((z, off));
            let step = -off / self.slope;
            z += step;
            if libm::fabs(step) <= LAST_STEP_MM {
                self.above = z - taught;
                return Some((z, seen));
            }
        }
        None
    }
}

/// The weights of four neighbours at this share of the way between the middle two (Keys, 1981, with
/// a = −1/2).
fn cubic(x: f64) -> [f64; 4] {
    [
        x * (-0.5 + x * (1.0 - 0.5 * x)),
        1.0 + x * x * (1.5 * x - 2.5),
        x * (0.5 + x * (2.0 - 1.5 * x)),
        x * x * (0.5 * x - 0.5),
    ]
}

/// Two independent numbers that follow from a number and are normal to the fourth moment but for
/// 0.3: sums of four uniform ones. Means over squares of nine of them are normal. The bits are
/// those of SplitMix64 (G. Steele, D. Lea and C. Flood, 2014).
fn normal(mut state: u64) -> [f64; 2] {
    // Four numbers of 16 bits: mean and standard deviation.
    const MEAN: f64 = 2.0 * 65_535.0;
    const SCATTER: f64 = 37_837.2;
    [(); 2].map(|()| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        let sum: u64 = (0..4).map(|part| bits >> (16 * part) & 0xffff).sum();
        (sum as f64 - MEAN) / SCATTER
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_of_pixels_is_normal_as_far_as_means_over_squares_can_tell() {
        let mut moments = [0.0; 5];
        let count = 100_000;
        for place in 0..count {
            let [first, second] = normal((7 << 32) ^ place);
            for (power, moment) in (1..).zip(&mut moments[..4]) {
                *moment += libm::pow(first, f64::from(power)) / count as f64;
            }
            moments[4] += first * second / count as f64;
        }
        // Scatter of the means of 10⁵ numbers: 1, √2, √15, √96 and 1 of 0.0032.
        let expected = [0.0, 1.0, 0.0, 2.7, 0.0];
        for (found, expected) in moments.into_iter().zip(expected) {
            assert!((found - expected).abs() < 0.1, "{moments:?}");
        }
        assert!((moments[1] - 1.0).abs() < 0.015, "{moments:?}");
    }
}
