//! The convention of the shifts in the words of the options, and what a response that is not linear
//! does to levels.

use crate::layout::{Convention, ShiftSign, Shifts};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use std::f64::consts::TAU;

/// Parts of a turn by which first shifts differ, and how near to one of them a shift must be to
/// stand for it, turns.
const USUAL: [(f64, f64); 2] = [(4.0, 0.0625), (3.0, 0.04)];
/// Parts of a period that a ripple is looked at in.
const BINS: usize = 32;
/// Concentration of the difference of two levels within a part, from 0 to 1, that is no noise.
const CONCENTRATED: f64 = 0.7;
/// Largest mean of a ripple, turns: a wrong convention moves it by a quarter of a turn.
const LARGEST_MEAN: f64 = 0.125;

impl Shifts {
    /// The shift of the sine in the first frame, turns.
    pub(super) fn total(self) -> f64 {
        self.first + self.convention.turns()
    }

    /// These shifts with another one of the sine in the first frame; in the convention in which the
    /// first shift is none, the stated one, or half a turn.
    pub(super) fn with_total(self, sign: ShiftSign, total: f64) -> Self {
        let total = match usual(total - self.total()) {
            Some(turns) => self.total() + turns,
            None => (100.0 * total).round() / 100.0,
        };
        let other = match self.convention {
            Convention::Sin => Convention::Cos,
            Convention::Cos => Convention::Sin,
        };
        let [own, other] = [self.convention, other].map(|convention| {
            let first = total - convention.turns();
            let first = first - first.round();
            Self {
                convention,
                sign,
                first: if first == -0.5 { 0.5 } else { first },
            }
        });
        let plain = [0.0, self.first, 0.5].into_iter().find_map(|first| {
            let is_it = |shifts: &Self| (shifts.first - first).abs() < 1e-9;
            let found = [own, other].into_iter().find(is_it);
            found.map(|shifts| Self { first, ..shifts })
        });
        plain.unwrap_or(own)
    }

    /// The options of these shifts where others were stated.
    pub(super) fn options(self, stated: Self) -> String {
        let convention = match self.convention {
            Convention::Sin => "sin",
            Convention::Cos => "cos",
        };
        let sign = match self.sign {
            ShiftSign::Rising => "+",
            ShiftSign::Falling => "-",
        };
        let first = match (self.first, stated.first) {
            (0.0, 0.0) => String::new(),
            (first, _) => format!(" --first-shift {first}"),
        };
        format!("--convention {convention} --shift {sign}{first}")
    }
}

/// The quarters or thirds of a turn that are meant by so many turns.
pub(super) fn usual(turns: f64) -> Option<f64> {
    let parts = USUAL.into_iter().map(|(parts, near)| {
        let usual = (turns * parts).round() / parts;
        (usual, near)
    });
    let mut near = parts.filter(|(usual, near)| (usual - turns).abs() < *near);
    near.next().map(|(usual, _)| usual)
}

impl ShiftSign {
    pub(super) fn reversed(self) -> Self {
        match self {
            Self::Rising => Self::Falling,
            Self::Falling => Self::Rising,
        }
    }
}

/// The ripple of the difference of two levels, `factor` φ_coarse − φ_fine, that a response which is
/// not linear makes: of so many periods per fringe as there are shifts. Half its height in turns,
/// if the difference is nothing but that.
pub(super) fn ripple(
    coarse: &PhaseMap,
    fine: &PhaseMap,
    factor: f64,
    shifts: usize,
) -> Option<f64> {
    let mut sums = [[0.0_f64; 2]; BINS];
    let mut count = 0_usize;
    for at in 0..coarse.phase.len() {
        if coarse.trust[at] != Trust::Resolved || fine.trust[at] != Trust::Resolved {
            continue;
        }
        let phase = coarse.phase[at].turns();
        let (sin, cos) = (TAU * (factor * phase - fine.phase[at].turns())).sin_cos();
        let part = (shifts as f64 * phase).rem_euclid(1.0) * BINS as f64;
        let sum = &mut sums[part as usize % BINS];
        *sum = [sum[0] + cos, sum[1] + sin];
        count += 1;
    }
    let size: f64 = sums.iter().map(|[cos, sin]| cos.hypot(*sin)).sum();
    if count == 0 || size < CONCENTRATED * count as f64 {
        return None;
    }
    let means = sums.map(|[cos, sin]| sin.atan2(cos) / TAU);
    let mut course = vec![means[0]];
    for next in means.into_iter().skip(1).chain([means[0]]) {
        let here = course[course.len() - 1];
        course.push(here + (next - here) - (next - here).round());
    }
    // A difference that turns round and round is one of orders or signs.
    let closed = course.pop()?;
    let mean = course.iter().sum::<f64>() / BINS as f64;
    let high = course.iter().copied().fold(f64::MIN, f64::max);
    let low = course.iter().copied().fold(f64::MAX, f64::min);
    let plain = (closed - course[0]).abs() < 0.5 && (mean - mean.round()).abs() < LARGEST_MEAN;
    plain.then_some((high - low) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_named_in_the_plainest_way() {
        let stated = |convention, first| Shifts {
            convention,
            sign: ShiftSign::Rising,
            first,
        };
        let third = -1.0 / 3.0;
        for (convention, first, total, expected) in [
            (Convention::Sin, 0.0, 0.25, "--convention cos --shift +"),
            (Convention::Cos, 0.0, 0.01, "--convention sin --shift +"),
            (
                Convention::Cos,
                0.0,
                0.74,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.0,
                -0.25,
                "--convention cos --shift + --first-shift 0.5",
            ),
            (
                Convention::Sin,
                0.5,
                0.0,
                "--convention sin --shift + --first-shift 0",
            ),
            (
                Convention::Sin,
                0.0,
                0.1,
                "--convention sin --shift + --first-shift 0.1",
            ),
            (
                Convention::Sin,
                third,
                third + 0.25,
                "--convention cos --shift + --first-shift -0.3333333333333333",
            ),
        ] {
            let stated = stated(convention, first);
            let named = stated.with_total(ShiftSign::Rising, total);
            assert_eq!(named.options(stated), expected);
        }
    }
}
