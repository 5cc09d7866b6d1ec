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
//! solves q = M⁻¹ p(z), q_z = G(π(q)). A change of z moves q along nearly one ray of the camera as
//! taught, so z ← z + G(π(q)) − q_z converges within a few steps. Between pixels G is the cubic
//! through four of them in each direction (R. Keys, *Cubic convolution interpolation*, IEEE Trans.
//! ASSP 29, 1981), where production compares with straight lines: what these miss of a bent surface
//! is part of what displaced parts deviate by.
//!
//! # Accuracy
//! Light that a motion sheds on other places, and what a pixel averages over beside creases, is as
//! taught. Deviations of parts in front of the simulated head are compared with it in
//! `tests/suite/every_part.rs`.

use super::plan::Production;
use crate::inspect::align::Motion;
use crate::phase::Trust;
use crate::pipeline::{PhaseMap, for_each_row};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec;
use core::f64::consts::PI;

/// Steps in which a ray is brought to the surface, and the largest last step, mm.
const STEPS: usize = 6;
const LAST_STEP_MM: f64 = 1e-4;

impl Production {
    /// The phases of the part as taught after a motion. `modulation` is golden's by this sequence,
    /// row-major; other seeds give other noise, none gives none.
    pub fn rendered(
        &self,
        motion: &Motion,
        modulation: &[Modulation],
        seed: Option<u64>,
    ) -> PhaseMap {
        let (width, height) = self.golden.size();
        let map = self.map();
        let mut rows = vec![None; width * height];
        for_each_row(&mut rows, width, |v, row| {
            for (u, pixel) in row.iter_mut().enumerate() {
                // A sequence of limited reach looks at no other pixel.
                if map[v * width + u].is_known() {
                    *pixel = self.rendered_pixel(motion, modulation, (u, v), seed);
                }
            }
        });
        let mut phases = PhaseMap::new(width, height);
        for (at, pixel) in rows.into_iter().enumerate() {
            if !map[at].is_known() {
                phases.trust[at] = Trust::Unexpected;
            }
            if let Some((phase, modulation)) = pixel {
                phases.phase[at] = phase;
                phases.modulation[at] = modulation;
                phases.trust[at] = Trust::Resolved;
            }
        }
        phases
    }

    /// Phase and modulation of a pixel; none if it sees no part, or too faintly.
    fn rendered_pixel(
        &self,
        motion: &Motion,
        modulation: &[Modulation],
        (u, v): (usize, usize),
        seed: Option<u64>,
    ) -> Option<(AbsolutePhase, Modulation)> {
        let Self { golden, phase, .. } = self;
        let (width, height) = golden.size();
        let place = v * width + u;
        let mut z = golden.height_mm(place);
        let (mut step, mut seen) = (f64::INFINITY, (0.0, 0.0));
        for _ in 0..STEPS {
            let back = motion.undo(golden.seen(u, v, z)?);
            seen = golden.triangulator.camera().project(back)?;
            step = self.golden_height(seen)? - back.z;
            z += step;
            if libm::fabs(step) <= LAST_STEP_MM {
                break;
            }
        }
        let (column, row) = (libm::rint(seen.0) as usize, libm::rint(seen.1) as usize);
        if libm::fabs(step) > LAST_STEP_MM || column >= width || row >= height {
            return None;
        }
        let draw = |seed: u64| normal((seed << 32) ^ place as u64);
        let [first, second] = seed.map_or([0.0; 2], draw);
        let decoder = &phase.decoder;
        let (full, most) = (f64::from(u16::MAX), decoder.full_scale());
        let counts = |light: Modulation| f64::from(light.to_bits()) / full * f64::from(most);
        let light = modulation[row * width + column];
        let noise = phase.noise.at(counts(light));
        let scatter = decoder.modulation_noise(noise) * full / f64::from(most);
        let bits = f64::from(light.to_bits()) + scatter * first;
        let light = Modulation::from_bits(libm::rint(bits.clamp(0.0, full)) as u16);
        if counts(light) < decoder.least_modulation().counts(most) {
            return None;
        }
        let turns = golden.triangulator.sight(u as f64, v as f64)?.phase(z)?;
        let noise = decoder.phase_noise(light, phase.noise) * second;
        let phase = AbsolutePhase::from_turns(turns + noise);
        phase.is_known().then_some((phase, light))
    }

    /// Golden's height between pixels, mm, by a cubic in each direction; none where one of the
    /// sixteen pixels is not known.
    fn golden_height(&self, (u, v): (f64, f64)) -> Option<f64> {
        let (width, height) = self.golden.size();
        let (left, top) = (libm::floor(u), libm::floor(v));
        if left < 1.0 || top < 1.0 || left + 2.0 >= width as f64 || top + 2.0 >= height as f64 {
            return None;
        }
        let surface = self.golden.cubics.surface();
        let (along, down) = (cubic(u - left), cubic(v - top));
        let first = (top as usize - 1) * width + left as usize - 1;
        let mut sum = 0.0;
        for (row, down) in down.iter().enumerate() {
            for (column, along) in along.iter().enumerate() {
                let at = first + row * width + column;
                if !surface.phase[at].is_known() {
                    return None;
                }
                sum += surface.height[at].mm() * along * down;
            }
        }
        Some(sum)
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

/// Two independent normal numbers that follow from a number (G. Box and M. Muller, 1958), by
/// SplitMix64 (G. Steele, D. Lea and C. Flood, 2014).
fn normal(mut state: u64) -> [f64; 2] {
    let [a, b] = [(); 2].map(|()| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    });
    let (radius, angle) = (libm::sqrt(-2.0 * libm::log(1.0 - a)), 2.0 * PI * b);
    [radius * libm::cos(angle), radius * libm::sin(angle)]
}
