//! What one frame shows: a share and a shift of the phase function, and a waveform, which with the
//! same light gives more modulation than a sine.
//!
//! **Idea.** Demodulation with N equally spaced shifts is blind to every harmonic h of the
//! projected waveform except those with h ≡ ±1 (mod N), wherever blur and the raster's sampling
//! leave them: harmonic h turns by h/N per shift, and its samples add up to 0 in S and C. So a
//! waveform may have all the others, and with them its fundamental may be larger than its peak.
//!
//! **Equation.** f(x) = sin 2πx + Σ a_h sin 2πhx. With the peak scaled to 1, the fundamental is b =
//! 1 / max |f|. The largest b of any waveform is 2 / (N tan(π/2N)) for odd N and 4 / (N tan(π/N))
//! for even N: the width of a zonogon of N segments. The shares below are the solution of the
//! linear programme "minimise t, |f(x)| ≤ t" over 0 ≤ x ≤ 1/4, with odd h up to 13 that N tells
//! from the fundamental (odd harmonics keep f symmetric). For N = 3 and 6 it is sin 2πx + sin 6πx /
//! 6, known as third-harmonic injection of power electronics.
//!
//! | N | 3, 6 | 4 | 5 | 7 | 8 | 9 |
//! |---|---|---|---|---|---|---|
//! | bound of b | 1.1547 | 1 | 1.2311 | 1.2518 | 1.2071 | 1.2603 |
//! | reached | 1.1547 | 1 | 1.2310 | 1.2517 | 1.2070 | 1.2568 |
//!
//! The noise of the phase falls by 1/b. It needs a response that is linear within about 1 %: a
//! gamma error makes h = 2 and products of harmonics.
//!
//! **Tests.** `each_number_of_shifts_has_its_largest_fundamental_and_no_alias`, and on rasters
//! `a_waveform_has_the_phase_of_the_sine_and_more_modulation`.

use core::f64::consts::TAU;

/// Highest order of a harmonic.
pub const MAX_ORDER: u8 = 15;
/// Samples of a turn among which the peak is sought: it is found within 1e-5.
const SAMPLES: u32 = 4096;

/// Chooses the waveform of a level by its number of shifts: [`Waveform::brightest`] or
/// [`Waveform::sine`].
pub type Waveforms = fn(usize) -> Waveform;

/// A periodic waveform: a sine and its harmonics, all in phase with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waveform {
    /// Amplitude of each order as a share of the fundamental's. That of order 0 is 0, that of order
    /// 1 is 1.
    shares: [f64; MAX_ORDER as usize + 1],
}

impl Default for Waveform {
    fn default() -> Self {
        Self::SINE
    }
}

impl Waveform {
    /// The sine.
    pub const SINE: Self = Self::of(&[]);

    /// The sine, whatever the number of shifts.
    pub const fn sine(_shifts: usize) -> Self {
        Self::SINE
    }

    /// A waveform with these harmonics: order, from 2 to [`MAX_ORDER`], and share of the
    /// fundamental's amplitude. Other orders are left out: files that name them are refused before.
    pub const fn of(harmonics: &[(u8, f64)]) -> Self {
        let mut shares = [0.0; MAX_ORDER as usize + 1];
        shares[1] = 1.0;
        let mut at = 0;
        while at < harmonics.len() {
            let (order, share) = harmonics[at];
            if order >= 2 && order <= MAX_ORDER {
                shares[order as usize] = share;
            }
            at += 1;
        }
        Self { shares }
    }

    /// The waveform with the largest fundamental that `shifts` shifts demodulate like a sine; a
    /// sine for 4 and for more than 9 shifts.
    pub const fn brightest(shifts: usize) -> Self {
        match shifts {
            3 | 6 => Self::of(&[(3, 1.0 / 6.0)]),
            5 => Self::of(&[(3, 0.277_95), (5, 0.1), (7, 0.035_55), (13, -0.006_34)]),
            7 => Self::of(&[
                (3, 0.296_31),
                (5, 0.142_11),
                (7, 0.071_45),
                (9, 0.032_2),
                (11, 0.010_1),
            ]),
            8 => Self::of(&[
                (3, 0.275_29),
                (5, 0.107_07),
                (11, -0.013_22),
                (13, -0.016_57),
            ]),
            9 => Self::of(&[
                (3, 0.304_38),
                (5, 0.153_9),
                (7, 0.084_79),
                (9, 0.045_23),
                (11, 0.020_99),
                (13, 0.006_69),
            ]),
            _ => Self::SINE,
        }
    }

    /// The harmonics of the waveform: order and share of the fundamental's amplitude, in ascending
    /// order.
    pub fn harmonics(&self) -> impl Iterator<Item = (u8, f64)> + '_ {
        let orders = (0..).zip(self.shares).skip(2);
        orders.filter(|(_, share)| *share != 0.0)
    }

    /// A harmonic that `shifts` shifts cannot tell from the fundamental, if there is one.
    pub fn alias(&self, shifts: usize) -> Option<u8> {
        let mut orders = self.harmonics().map(|(order, _)| order);
        orders.find(|&order| {
            let rest = usize::from(order) % shifts;
            rest == 1 || rest + 1 == shifts
        })
    }

    /// The fundamental's amplitude b where the waveform's peak is 1.
    pub fn fundamental(&self) -> f64 {
        let samples = (0..SAMPLES).map(|at| self.unscaled(f64::from(at) / f64::from(SAMPLES)));
        1.0 / samples.map(libm::fabs).fold(0.0, f64::max)
    }

    /// f at a phase in turns.
    pub(crate) fn unscaled(&self, turns: f64) -> f64 {
        let orders = (0..).zip(self.shares).filter(|(_, share)| *share != 0.0);
        orders
            .map(|(order, share): (u8, f64)| share * libm::sin(TAU * f64::from(order) * turns))
            .sum()
    }
}

/// What one frame shows of a phase function Φ_P: I = I_max/2 · (1 + f(ratio · Φ_P + shift)), where
/// f is the waveform with its peak scaled to 1, for a sine I = I_max/2 · (1 + sin 2π(ratio · Φ_P +
/// shift)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Share of the full phase function. Frames of equal ratio form a level.
    pub ratio: f64,
    /// Shift in turns.
    pub shift: f64,
    /// What is projected for a turn of phase.
    pub waveform: Waveform,
}

impl Shot {
    /// A sine.
    pub const fn sine(ratio: f64, shift: f64) -> Self {
        Self {
            ratio,
            shift,
            waveform: Waveform::SINE,
        }
    }

    /// A level of sines: `shifts` shots of one ratio, k/N turns apart.
    pub fn level(ratio: f64, shifts: usize) -> impl Iterator<Item = Self> + Clone {
        (0..shifts).map(move |k| Self::sine(ratio, k as f64 / shifts as f64))
    }

    /// A level of the waveform for its number of shifts.
    pub fn level_as(
        ratio: f64,
        shifts: usize,
        waveforms: Waveforms,
    ) -> impl Iterator<Item = Self> + Clone {
        let waveform = waveforms(shifts);
        Self::level(ratio, shifts).map(move |shot| Self { waveform, ..shot })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use std::vec::Vec;

    #[test]
    fn each_number_of_shifts_has_its_largest_fundamental_and_no_alias() {
        for (shifts, least) in [
            (3, 1.1547),
            (4, 1.0),
            (5, 1.2310),
            (6, 1.1547),
            (7, 1.2517),
            (8, 1.2070),
            (9, 1.2567),
            (12, 1.0),
        ] {
            let waveform = Waveform::brightest(shifts);
            assert_eq!(waveform.alias(shifts), None, "{shifts} shifts");
            let n = shifts as f64;
            let bound = match shifts.is_multiple_of(2) {
                true => 4.0 / (n * libm::tan(PI / n)),
                false => 2.0 / (n * libm::tan(PI / (2.0 * n))),
            };
            let b = waveform.fundamental();
            assert!(least <= b + 1e-9 && b <= bound + 1e-6, "{shifts}: {b}");
            // The peak between the samples, on a grid that shares no point with them but 0.
            let peak = (0..99_991)
                .map(|at| b * waveform.unscaled(f64::from(at) / 99_991.0).abs())
                .fold(0.0, f64::max);
            assert!(peak <= 1.0 + 1e-5, "{shifts}: {peak}");
        }
    }

    #[test]
    fn a_harmonic_that_the_shifts_take_for_the_fundamental_is_named() {
        let third = Waveform::of(&[(3, 0.1), (16, 1.0)]);
        assert_eq!(third.harmonics().collect::<Vec<_>>(), [(3, 0.1)]);
        assert_eq!(third.alias(4), Some(3));
        assert_eq!(third.alias(3), None);
        assert_eq!(Waveform::of(&[(2, 0.1)]).alias(3), Some(2));
    }
}
