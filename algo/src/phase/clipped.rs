//! The pointers of pixels of which some samples are at full scale, from their whole samples alone.
//!
//! **Idea.** A sample at full scale says only that the light was brighter. Three whole samples of a
//! sine give its phase, more of them by least squares (Wang, Kemao, Gao et al. 2016 do so with
//! regular and inverted fringes). The clipped ones are those about the peak: one run of shifts. A
//! whole sample inside of that run is as bright, by chance below full scale, and is left out, too.
//!
//! **Equation.** In the shifts s_k that are left, from the first of them on,
//!
//! ```text
//! I_k = A + a cos 2πs_k + b sin 2πs_k             least squares over them: (A, a, b) = M⁻¹ Σ (1, cos, sin) I_k
//! B² = a² + b²       V = (b² M⁻¹_aa − 2ab M⁻¹_ab + a² M⁻¹_bb) / B²      σ_φ = σ_I √V / 2πB
//! ```
//!
//! With all N samples V is 2/N. A pointer of (a, b)/√(N V/2) therefore has a modulation that says
//! what σ of the phase is, as that of any other pixel does: it is what the results hold, and what is
//! compared with the least modulation.
//!
//! **Shapes and units.** Samples in counts; pointers in the level's unit ([`super::level`]).
//!
//! **Accuracy.** In f64, by sums, products, quotients and square roots alone, which all processors
//! round alike. Scatter over σ is .94 to 1.01 for light of up to 1.2 of full scale, and less beyond, as
//! words hold a modulation of no more than 0.5 to 0.65 of full scale: σ is then too large
//! (`clipped_samples_are_left_out_and_sigma_says_what_is_left`).

use crate::frame::Sample;
use crate::pattern::{Level, Waveform};
use crate::simd::MAX_PIXELS;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Fewest whole samples that give a phase.
const FEWEST: usize = 3;
/// Fewest shifts of which a sample can be left out.
const FEWEST_SHIFTS: usize = FEWEST + 1;
/// The largest S or C where its unit is chosen to fill a word, with room for roundings. With this
/// value the rounded weights of N = 5, 7, 8 and 9 turn the pointer by at most 2.4e-7 turn; with
/// other values by up to 3e-6.
pub(super) const LARGEST: f64 = 32_694.0;

/// A level's shifts, and what numbers of them give.
#[derive(Clone, Debug)]
pub(super) struct Clipped {
    full_scale: i32,
    /// Length of a pointer of a modulation of one count.
    per_count: f64,
    /// The shortest pointer that is trusted.
    pub least: f64,
    /// The place of the smallest shift, 0 to 1 turn.
    begin: usize,
    /// cos and sin of 2πs_k.
    shifts: Vec<[f64; 2]>,
    /// cos and sin of 2πk/N.
    steps: Vec<[f64; 2]>,
    /// By the number of whole samples, M⁻¹ with shifts that begin at 0: rows of a and of b.
    inverse: Vec<[[f64; 3]; 2]>,
}

/// A block's pointers in memory.
pub(super) struct Pixels {
    pub s: [u16; MAX_PIXELS],
    pub c: [u16; MAX_PIXELS],
    /// 255 where a sample is at full scale; set to 0 where the pointer was found without it.
    pub brightest: [u8; MAX_PIXELS],
}

impl Clipped {
    /// None where a phase takes all samples: of three shifts, and of waveforms with flat tops, whose
    /// harmonics only all shifts together leave out. The first shift is `start`.
    pub fn new(level: &Level, start: f64, per_count: f64, full_scale: f64) -> Option<Self> {
        let count = level.shifts();
        if count < FEWEST_SHIFTS || level.waveform != Waveform::SINE {
            return None;
        }
        let wave = |turns: f64| [libm::cos(TAU * turns), libm::sin(TAU * turns)];
        let step = |k: usize| k as f64 / count as f64;
        let turns = |k: usize| {
            // Not just below 1 instead of 0.
            let turns = start + step(k) + 1e-9;
            turns - libm::floor(turns)
        };
        let begin = (0..count).min_by(|a, b| turns(*a).total_cmp(&turns(*b)));
        let steps: Vec<_> = (0..count).map(|k| wave(step(k))).collect();
        Some(Self {
            full_scale: full_scale as i32,
            per_count,
            least: 0.0,
            begin: begin.unwrap_or(0),
            shifts: (0..count).map(|k| wave(start + step(k))).collect(),
            inverse: (0..count).map(|whole| inverse(&steps[..whole])).collect(),
            steps,
        })
    }

    /// Finds the pointers of the pixels of a block that have clipped samples and are trusted by all of
    /// them, if they have enough whole ones. `row(k)` are the samples of shift k, of which the block begins at `at`.
    #[cold]
    pub fn mend<'a, T: Sample + 'a>(
        &self,
        row: impl Fn(usize) -> &'a [T],
        at: usize,
        pixels: &mut Pixels,
        count: usize,
    ) {
        for pixel in 0..count {
            let [s, c] = [pixels.s, pixels.c].map(|all| f64::from(all[pixel].cast_signed()));
            if pixels.brightest[pixel] != u8::MAX || s * s + c * c < self.least * self.least {
                continue;
            }
            let sample = |k: usize| row(k)[at + pixel].count();
            if let Some([s, c]) = self.pointer(sample) {
                pixels.s[pixel] = s.cast_unsigned();
                pixels.c[pixel] = c.cast_unsigned();
                pixels.brightest[pixel] = 0;
            }
        }
    }

    /// S and C of a pixel.
    fn pointer(&self, sample: impl Fn(usize) -> i32) -> Option<[i16; 2]> {
        let count = self.shifts.len();
        let is_whole = |k: usize| sample(k % count) < self.full_scale;
        // The longest run of whole samples; of equally long ones that of the smallest shift.
        let (mut first, mut whole, mut run) = (0, 0, 0);
        for k in self.begin..self.begin + 2 * count {
            run = if is_whole(k) { run + 1 } else { 0 };
            if run > whole && run < count {
                (first, whole) = (k + 1 - run, run);
            }
        }
        if whole < FEWEST {
            return None;
        }
        let mut sums = [0.0; 3];
        for (k, [cos, sin]) in self.steps[..whole].iter().enumerate() {
            let sample = f64::from(sample((first + k) % count));
            sums[0] += sample;
            sums[1] += sample * cos;
            sums[2] += sample * sin;
        }
        let [along, across] = &self.inverse[whole];
        let product = |row: &[f64; 3]| row[0] * sums[0] + row[1] * sums[1] + row[2] * sums[2];
        let (a, b) = (product(along), product(across));
        let power = a * a + b * b;
        let variance = b * b * along[1] - 2.0 * a * b * along[2] + a * a * across[2];
        // √(N V/2), with V times B² in `variance`.
        let unsure = libm::sqrt(count as f64 / 2.0 * variance / power);
        let unit = self.per_count / unsure;
        let length = unit * libm::sqrt(power);
        // Not where it is not a number either.
        if !(length >= self.least) {
            return None;
        }
        let [cos, sin] = self.shifts[first % count];
        let (s, c) = (a * cos - b * sin, a * sin + b * cos);
        let most = s.abs().max(c.abs()) * unit;
        let unit = if most > LARGEST {
            unit * LARGEST / most
        } else {
            unit
        };
        Some([s, c].map(|part| libm::rint(part * unit) as i16))
    }
}

/// The rows of a and of b of the inverse of Σ (1, cos, sin)ᵀ (1, cos, sin).
fn inverse(waves: &[[f64; 2]]) -> [[f64; 3]; 2] {
    let mut m = [[0.0; 3]; 3];
    for [cos, sin] in waves {
        let row = [1.0, *cos, *sin];
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                m[i][j] += a * b;
            }
        }
    }
    let minor = |i: usize, j: usize| {
        let (p, q) = ((i + 1) % 3, (i + 2) % 3);
        let (r, s) = ((j + 1) % 3, (j + 2) % 3);
        m[p][r] * m[q][s] - m[p][s] * m[q][r]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    [1, 2].map(|i| [0, 1, 2].map(|j| minor(j, i) / determinant))
}
