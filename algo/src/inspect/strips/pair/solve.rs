//! From the sums over windows to phases: a block of pixels at a time, in single precision.
//!
//! # Equations
//! Those of `window.rs`. Where the determinant is [`LEAST_DETERMINED`] of its largest value,
//! rounding changes δ by 10⁻⁶ rad.

use super::sums::{BLOCK, FAINT, PIXELS, SUMS, sum_up};
use crate::math::nearest::whole;
use crate::phase::{LeastModulation, Trust};
use crate::simd::{Lanes, back_end_entry};
use crate::units::{AbsolutePhase, Modulation};

/// The determinant of the normal equations over its largest value; less than half a fringe in the
/// window has less.
const LEAST_DETERMINED: f32 = 0.2;
/// Largest share of the light's change, beyond its noise, that the fit may leave.
const MOST_LEFT: f32 = 0.15;

/// What solving needs, worked out once.
#[derive(Clone, Debug)]
pub struct Solver {
    /// What noise leaves of the light's change in a window, in the squared unit of the sums.
    noise: f32,
    /// The square of the least modulation of I₁ − I₂ in the unit of the sums.
    least: f32,
    /// From √(power) to B in bits of a [`Modulation`], where golden is compared.
    modulation: f32,
}

/// The results of a block.
#[derive(Debug)]
pub struct SolvedBlock {
    pub phase: [AbsolutePhase; BLOCK],
    pub modulation: [Modulation; BLOCK],
    pub trust: [Trust; BLOCK],
}

impl Default for SolvedBlock {
    fn default() -> Self {
        Self {
            phase: [AbsolutePhase::UNKNOWN; BLOCK],
            modulation: [Modulation::default(); BLOCK],
            trust: [Trust::Dark; BLOCK],
        }
    }
}

impl Solver {
    /// For samples with σ = `noise` counts, up to `full_scale`, trusted from a modulation of
    /// `least` on; `unit` is a count in the unit of the sums.
    pub fn new(unit: f64, full_scale: f64, noise: f64, least: LeastModulation) -> Self {
        let least = 2.0 * least.eight_bit() / 255.0 * full_scale * unit;
        Self {
            noise: (PIXELS * 2.0 * noise * noise * unit * unit) as f32,
            least: (least * least) as f32,
            // B of I₁ − I₂ = 2 B sin, as a share of full scale.
            modulation: (libm::sqrt(2.0 / PIXELS) * 65_535.0 / (2.0 * unit * full_scale)) as f32,
        }
    }
}

back_end_entry! {
    /// Solves the windows around the pixels of a block, from the sums of their columns, with what
    /// the pixels are expected to see and their light ([`super::terms::Terms`]).
    fn solve_block [] = solve(
        solver: &Solver,
        columns: [&[i32]; SUMS],
        expected: (&[AbsolutePhase], &[bool]),
        light: &[f32],
        out: &mut SolvedBlock,
    )
}

#[inline(always)]
fn solve<V: Lanes>(
    _: V,
    solver: &Solver,
    columns: [&[i32]; SUMS],
    (phase, compared): (&[AbsolutePhase], &[bool]),
    light: &[f32],
    out: &mut SolvedBlock,
) {
    let mut sums = [[0; BLOCK]; SUMS];
    for i in 0..SUMS {
        sum_up(columns[i], &mut sums[i]);
    }
    let (phase, compared, light) = (&phase[..BLOCK], &compared[..BLOCK], &light[..BLOCK]);
    let mut power = [0.0; BLOCK];
    let mut change = [0; BLOCK];
    for i in 0..BLOCK {
        let (ss, sc, cc) = (sums[0][i] as f32, sums[1][i] as f32, sums[2][i] as f32);
        let (ds, dc, dd) = (sums[3][i] as f32, sums[4][i] as f32, sums[5][i] as f32);
        let determinant = ss * cc - sc * sc;
        let half_trace = (ss + cc) * 0.5;
        let inverse = 1.0 / determinant;
        let a = (ds * cc - dc * sc) * inverse;
        let b = (dc * ss - ds * sc) * inverse;
        let explained = a * ds + b * dc;
        let flat =
            (determinant < LEAST_DETERMINED * half_trace * half_trace) | (determinant <= 0.0);
        let faint = (a * a + b * b) * (light[i] * light[i]) < solver.least;
        let left = dd - explained > MOST_LEFT * dd + solver.noise;
        let trust = if left {
            Trust::Residual
        } else {
            Trust::Resolved
        };
        let trust = if flat | faint { Trust::Dark } else { trust };
        let trust = if light[i] < 0.0 {
            Trust::Saturated
        } else {
            trust
        };
        let known = phase[i].is_known();
        out.trust[i] = if known { trust } else { Trust::Unexpected };
        power[i] = explained;
        change[i] = turns(b, a);
    }
    for i in 0..BLOCK {
        let resolved = out.trust[i] as u8 == Trust::Resolved as u8;
        let bits = phase[i].to_bits().wrapping_add(change[i]);
        let unknown = AbsolutePhase::UNKNOWN.to_bits();
        out.phase[i] = AbsolutePhase::from_bits(if resolved { bits } else { unknown });
        let faint = if compared[i] {
            1.0
        } else {
            (1 << FAINT) as f32
        };
        let modulation = root(power[i]) * (solver.modulation * faint);
        let most = f32::from(u16::MAX);
        let modulation = whole(if modulation < most { modulation } else { most }) as u16;
        out.modulation[i] = Modulation::from_bits(if resolved { modulation } else { 0 });
    }
}

/// The angle of (x, y) in 1/65536 turn, to 1e-5 rad: 4.4.47 of M. Abramowitz, I. A.
/// Stegun, *Handbook of Mathematical Functions*.
#[inline(always)]
fn turns(y: f32, x: f32) -> i32 {
    let (across, along) = (y.abs(), x.abs());
    let steep = across > along;
    let (less, more) = if steep {
        (along, across)
    } else {
        (across, along)
    };
    let more = if more > f32::MIN_POSITIVE {
        more
    } else {
        f32::MIN_POSITIVE
    };
    let t = less / more;
    let square = t * t;
    let series = 0.999_866
        + square
            * (-0.330_299_5 + square * (0.180_141 + square * (-0.085_133 + square * 0.020_835_1)));
    let angle = t * series * (65_536.0 / core::f32::consts::TAU);
    let angle = if steep { 16_384.0 - angle } else { angle };
    let angle = if x < 0.0 { 32_768.0 - angle } else { angle };
    let angle = if y < 0.0 { -angle } else { angle };
    whole(angle)
}

/// √x to 10⁻⁶ of it, by Newton's method from the number with half the exponent; 0 for numbers
/// below 0. The same on every machine, many at a time.
#[inline(always)]
fn root(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    // 1/√x to 3.5 %.
    let mut inverse = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..3 {
        inverse *= 1.5 - 0.5 * x * inverse * inverse;
    }
    x * inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_and_angles_are_those_of_libm() {
        for at in 0..2000 {
            let x = libm::exp2f(at as f32 / 25.0 - 30.0);
            assert!((root(x) / libm::sqrtf(x) - 1.0).abs() < 1e-6, "{x}");
            let angle = (at as f32 + 0.5) / 2000.0 - 0.5;
            let (sin, cos) = libm::sincosf(angle * core::f32::consts::TAU);
            let found = turns(x * sin, x * cos);
            assert!(
                (found as f32 - angle * 65_536.0).abs() < 0.7,
                "{angle}: {found}"
            );
        }
        assert_eq!((root(0.0), root(-1.0), turns(0.0, 0.0)), (0.0, 0.0, 0));
    }
}
