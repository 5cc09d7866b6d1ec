//! The fit of a known carrier in a window: half the difference of a pair → change of phase, modulation and trust of each pixel.
//!
//! # Equations
//! The frames of a pair are I₁ = A + B sin 2πΦ and I₂ = A − B sin 2πΦ. With the expected phase Φ₀, and B = κ A with a contrast κ that
//! changes little over a window, each pixel i of the window around a pixel gives
//!
//! ```text
//! I₁ − I₂ = a s_i + b c_i     s_i = (I₁ + I₂) sin 2πΦ₀,  c_i = (I₁ + I₂) cos 2πΦ₀,  a = κ cos 2πδ,  b = κ sin 2πδ
//! ```
//!
//! By least squares [Σs² Σsc; Σsc Σc²] (a, b) = (Σds, Σdc), and Φ = Φ₀ + δ. The sum of the frames carries the part's texture, so a
//! change of texture or oil on it changes neither phase nor contrast, and dark pixels have no weight. Where the carrier is not the
//! expected one, the fit leaves more than its noise.
//!
//! # Noise
//! Fisher's information of a window of n pixels is n B² / σ_I², so σ_δ = σ_I / (2π B √n): that of n independent pixels of two
//! shifts each. Neighbouring results share pixels (`shared.rs`).
//!
//! # Shapes and units
//! Sums are exact: samples as 12 bits, sines as Q15, products as 24 bits, 81 of them in 32 bits. So the result depends neither on
//! tiles nor on threads.
//!
//! # Accuracy
//! `the_noise_of_a_fitted_phase_is_that_of_theory`, `the_phase_of_a_pair_has_next_to_no_periodic_error`.

use crate::frame::{FrameView, Samples};
use crate::phase::{MIN_MODULATION_8_BIT, PhaseRow, Trust};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec;
use alloc::vec::Vec;

/// The window's side in pixels.
pub const SIDE: usize = 7;
const REACH: usize = SIDE / 2;
/// Pixels of a window.
pub const PIXELS: f64 = (SIDE * SIDE) as f64;
/// Bits of the samples that are used.
const BITS: u8 = 12;
/// Steps of a turn in the table of sines.
const TURN: usize = 4096;
/// The determinant of the normal equations over its largest value; less than half a fringe in the window has less.
const LEAST_DETERMINED: f64 = 0.2;
/// Largest share of the light's change, beyond its noise, that the fit may leave.
const MOST_LEFT: f64 = 0.15;

/// What fitting windows needs, worked out once.
#[derive(Clone, Debug)]
pub struct Windows {
    bit_depth: u8,
    /// Sines over one turn and a quarter, Q15.
    sines: Vec<i16>,
    /// Variance of I₁ − I₂ in the squared unit of the sums.
    noise: f64,
    /// The least modulation of I₁ − I₂ in the unit of the sums.
    least: f64,
}

/// A row of s, c and d in 12 bits.
#[derive(Clone, Debug, Default)]
struct Terms {
    s: Vec<i16>,
    c: Vec<i16>,
    d: Vec<i16>,
}

/// The sums over the rows of a window, per column.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    ss: i32,
    sc: i32,
    cc: i32,
    ds: i32,
    dc: i32,
    dd: i32,
}

/// The buffers of a band of rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    terms: Vec<Terms>,
    sums: Vec<Sums>,
}

impl Sums {
    /// Adds the products of a pixel (`sign` 1) or takes them off (−1).
    #[inline(always)]
    fn add(&mut self, sign: i32, [s, c, d]: [i16; 3]) {
        let [s, c, d] = [s, c, d].map(i32::from);
        let (s_signed, c_signed, d_signed) = (sign * s, sign * c, sign * d);
        self.ss += s_signed * s;
        self.sc += s_signed * c;
        self.cc += c_signed * c;
        self.ds += d_signed * s;
        self.dc += d_signed * c;
        self.dd += d_signed * d;
    }

    #[inline(always)]
    fn plus(&mut self, sign: i32, other: &Self) {
        self.ss += sign * other.ss;
        self.sc += sign * other.sc;
        self.cc += sign * other.cc;
        self.ds += sign * other.ds;
        self.dc += sign * other.dc;
        self.dd += sign * other.dd;
    }
}

/// The frames of a pair, and what is expected (row-major).
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    pub frames: [FrameView<'a>; 2],
    pub expected: &'a [Expected],
}

/// What a pixel is expected to see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    pub phase: AbsolutePhase,
    /// Whether golden is compared there; elsewhere its surface is interpolated.
    pub compared: bool,
}

/// By so many bits the terms of pixels are smaller where golden is not compared: beside the others they hardly count.
const FAINT: u8 = 3;

impl Windows {
    /// For samples of `bit_depth` bits with σ = `noise` counts.
    pub fn new(bit_depth: u8, noise: f64) -> Self {
        let sine = |at: usize| {
            let turns = (at as f64 + 0.5) / TURN as f64;
            libm::rint(32_767.0 * libm::sin(core::f64::consts::TAU * turns)) as i16
        };
        let count = unit(bit_depth);
        Self {
            bit_depth,
            sines: (0..TURN + TURN / 4).map(sine).collect(),
            noise: 2.0 * noise * noise * count * count,
            least: 2.0 * MIN_MODULATION_8_BIT / 255.0 * full_scale(bit_depth) * count,
        }
    }

    /// Fits the windows around the pixels of some rows, the first of which is row `top`.
    pub(super) fn fit(
        &self,
        seen: Seen<'_>,
        top: usize,
        rows: &mut [PhaseRow<'_>],
        band: &mut Band,
    ) {
        let (width, height) = (seen.frames[0].width(), seen.frames[0].height());
        band.terms.resize(SIDE, Terms::default());
        for terms in &mut band.terms {
            for list in [&mut terms.s, &mut terms.c, &mut terms.d] {
                list.resize(width, 0);
            }
        }
        band.sums.clear();
        band.sums.resize(width, Sums::default());
        let Band { terms, sums } = band;
        let first = top.saturating_sub(REACH);
        for v in first..(top + REACH).min(height) {
            self.terms(seen, v, &mut terms[v % SIDE]);
            accumulate(1, &terms[v % SIDE], sums);
        }
        for (v, row) in (top..).zip(rows) {
            if v > first + REACH {
                accumulate(-1, &terms[(v - REACH - 1) % SIDE], sums);
            }
            if v + REACH < height {
                self.terms(seen, v + REACH, &mut terms[(v + REACH) % SIDE]);
                accumulate(1, &terms[(v + REACH) % SIDE], sums);
            }
            self.row(seen, v, sums, row);
        }
    }

    /// s, c and d of row `v`; 0 where nothing is expected or a sample is at full scale.
    fn terms(&self, seen: Seen<'_>, v: usize, terms: &mut Terms) {
        let width = seen.frames[0].width();
        let expected = &seen.expected[v * width..(v + 1) * width];
        match seen.frames.map(|frame| frame.row(v)) {
            [Samples::Eight(plus), Samples::Eight(minus)] => {
                self.typed(plus, minus, expected, terms);
            }
            [Samples::Sixteen(plus), Samples::Sixteen(minus)] => {
                self.typed(plus, minus, expected, terms);
            }
            // The frames were checked.
            _ => {}
        }
    }

    fn typed<T: crate::frame::Sample>(
        &self,
        plus: &[T],
        minus: &[T],
        expected: &[Expected],
        terms: &mut Terms,
    ) {
        let brightest = full_scale(self.bit_depth) as i32;
        let (left, right) = (
            BITS.saturating_sub(self.bit_depth),
            self.bit_depth.saturating_sub(BITS),
        );
        let out = terms.s.iter_mut().zip(&mut terms.c).zip(&mut terms.d);
        for (((&plus, &minus), &Expected { phase, compared }), ((s, c), d)) in
            plus.iter().zip(minus).zip(expected).zip(out)
        {
            let (plus, minus) = (plus.count(), minus.count());
            let usable = phase.is_known() && plus < brightest && minus < brightest;
            // Half the sum, so that it has as many bits as the difference.
            let faint = if compared { 0 } else { FAINT };
            let sum = ((plus + minus) << left >> 1 >> right >> faint) * i32::from(usable);
            let at = (phase.to_bits() & 0xffff) as usize / (65_536 / TURN);
            let product = |sine: i16| ((sum * i32::from(sine) + (1 << 14)) >> 15) as i16;
            *s = product(self.sines[at]);
            *c = product(self.sines[at + TURN / 4]);
            *d = ((plus - minus) << left >> right >> faint) as i16 * i16::from(usable);
        }
    }

    /// From the sums of the columns to the phases of row `v`.
    fn row(&self, seen: Seen<'_>, v: usize, columns: &[Sums], out: &mut PhaseRow<'_>) {
        let width = columns.len();
        let mut sums = Sums::default();
        for column in &columns[..REACH.min(width)] {
            sums.plus(1, column);
        }
        for u in 0..width {
            if let Some(column) = columns.get(u + REACH) {
                sums.plus(1, column);
            }
            if u > REACH {
                sums.plus(-1, &columns[u - REACH - 1]);
            }
            let samples = seen.frames.map(|frame| sample(frame.row(v), u));
            let (trust, change, power) = self.solve(&sums, samples);
            let Expected { phase, compared } = seen.expected[v * width + u];
            let trust = match phase.is_known() {
                true => trust,
                false => Trust::Unexpected,
            };
            let resolved = trust == Trust::Resolved;
            out.trust[u] = trust;
            out.phase[u] = match resolved {
                true => AbsolutePhase::from_bits(phase.to_bits().wrapping_add(change)),
                false => AbsolutePhase::UNKNOWN,
            };
            // B of I₁ − I₂ = 2 B sin, as a share of full scale.
            let faint = if compared { 1.0 } else { f64::from(1 << FAINT) };
            let scale =
                65_535.0 * faint / (2.0 * unit(self.bit_depth) * full_scale(self.bit_depth));
            out.modulation[u] = match resolved {
                true => Modulation::from_bits((libm::sqrt(2.0 * power / PIXELS) * scale) as u16),
                false => Modulation::default(),
            };
        }
    }

    /// Trust, δ in 1/65536 turn and the power that the fit explains, of a window around a pixel with these samples.
    fn solve(&self, sums: &Sums, samples: [i32; 2]) -> (Trust, i32, f64) {
        let [ss, sc, cc] = [sums.ss, sums.sc, sums.cc].map(f64::from);
        let [ds, dc, dd] = [sums.ds, sums.dc, sums.dd].map(f64::from);
        let determinant = ss * cc - sc * sc;
        let half_trace = (ss + cc) / 2.0;
        if samples.contains(&(full_scale(self.bit_depth) as i32)) {
            return (Trust::Saturated, 0, 0.0);
        }
        let sum = f64::from(samples[0] + samples[1]) * unit(self.bit_depth) / 2.0;
        if determinant < LEAST_DETERMINED * half_trace * half_trace || determinant <= 0.0 {
            return (Trust::Dark, 0, 0.0);
        }
        let a = (ds * cc - dc * sc) / determinant;
        let b = (dc * ss - ds * sc) / determinant;
        if (a * a + b * b) * sum * sum < self.least * self.least {
            return (Trust::Dark, 0, 0.0);
        }
        let power = a * ds + b * dc;
        if dd - power > MOST_LEFT * dd + PIXELS * self.noise {
            return (Trust::Residual, 0, 0.0);
        }
        (Trust::Resolved, turns(b as f32, a as f32), power)
    }
}

/// Adds a row's products to the sums of its columns (`sign` 1), or takes them off (−1).
fn accumulate(sign: i32, terms: &Terms, sums: &mut [Sums]) {
    let lists = terms.s.iter().zip(&terms.c).zip(&terms.d);
    for (sum, ((&s, &c), &d)) in sums.iter_mut().zip(lists) {
        sum.add(sign, [s, c, d]);
    }
}

fn sample(row: Samples<'_>, u: usize) -> i32 {
    match row {
        Samples::Eight(row) => i32::from(row[u]),
        Samples::Sixteen(row) => i32::from(row[u]),
    }
}

/// The largest sample.
fn full_scale(bit_depth: u8) -> f64 {
    f64::from((1_u32 << bit_depth) - 1)
}

/// A count in the unit of the sums.
fn unit(bit_depth: u8) -> f64 {
    libm::exp2(f64::from(BITS) - f64::from(bit_depth))
}

/// The angle of (x, y) in 1/65536 turn, to 1e-5 rad: 4.4.47 of M. Abramowitz, I. A. Stegun, *Handbook of Mathematical Functions*.
fn turns(y: f32, x: f32) -> i32 {
    let (across, along) = (y.abs(), x.abs());
    let t = across.min(along) / across.max(along).max(f32::MIN_POSITIVE);
    let square = t * t;
    let series = 0.999_866
        + square
            * (-0.330_299_5 + square * (0.180_141 + square * (-0.085_133 + square * 0.020_835_1)));
    let angle = t * series * (65_536.0 / core::f32::consts::TAU);
    let angle = if across > along {
        16_384.0 - angle
    } else {
        angle
    };
    let angle = if x < 0.0 { 32_768.0 - angle } else { angle };
    let angle = if y < 0.0 { -angle } else { angle };
    // To nearest.
    libm::rintf(angle) as i32
}

/// A buffer for each band of a frame.
pub(super) fn bands(rows: usize) -> Vec<Band> {
    vec![Band::default(); rows.div_ceil(BAND_ROWS)]
}

/// Rows of a band.
pub(super) const BAND_ROWS: usize = 64;
