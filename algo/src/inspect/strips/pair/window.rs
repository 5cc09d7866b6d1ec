//! The fit of a known carrier in a window: half the difference of a pair → change of phase,
//! modulation and trust of each pixel.
//!
//! # Equations
//! The frames of a pair are I₁ = A + B sin 2πΦ and I₂ = A − B sin 2πΦ. With the expected phase Φ₀,
//! and B = κ A with a contrast κ that changes little over a window, each pixel i of the window
//! around a pixel gives
//!
//! ```text
//! I₁ − I₂ = a s_i + b c_i     s_i = (I₁ + I₂) sin 2πΦ₀,  c_i = (I₁ + I₂) cos 2πΦ₀,  a = κ cos 2πδ,  b = κ sin 2πδ
//! ```
//!
//! By least squares [Σs² Σsc; Σsc Σc²] (a, b) = (Σds, Σdc), and Φ = Φ₀ + δ. The sum of the frames
//! carries the part's texture, so a change of texture or oil on it changes neither phase nor
//! contrast, and dark pixels have no weight. Where the carrier is not the expected one, the fit
//! leaves more than its noise.
//!
//! # Noise
//! Fisher's information of a window of n pixels is n B² / σ_I², so σ_δ = σ_I / (2π B √n): that of n
//! independent pixels of two shifts each. Neighbouring results share pixels (`sums.rs`).
//!
//! # Shapes and units
//! Sums are exact: samples as 12 bits, sines as Q15, products as 24 bits, the 49 of a window in 32. So
//! the result depends neither on bands nor on threads. A row enters the sums down the columns as
//! another one leaves them (`sums.rs`); from these follow the sums over windows and the phases
//! (`solve.rs`), many pixels at a time.
//!
//! # Accuracy
//! `the_noise_of_a_fitted_phase_is_that_of_theory`,
//! `the_phase_of_a_pair_has_next_to_no_periodic_error`.

use super::solve::{SolvedBlock, Solver, solve_block};
use super::sums::{BLOCK, Columns, FAINT, REACH, SIDE, Terms, refill};
use crate::frame::{FrameView, Sample, Samples};
use crate::phase::{LeastModulation, PhaseRow};
use crate::simd::{Backend, Lanes, back_end_entry};
use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// Bits of the samples that are used.
const BITS: u8 = 12;
/// Rows of a band.
pub const BAND_ROWS: usize = 64;
/// Steps of a turn in the table of sines.
const TURN: usize = 4096;

/// What fitting windows needs, worked out once.
#[derive(Clone, Debug)]
pub struct Windows {
    bit_depth: u8,
    backend: Backend,
    /// Sine and cosine of each step of a turn, Q15.
    sines: Vec<[i16; 2]>,
    solver: Solver,
}

/// What a row is expected to show.
#[derive(Debug)]
pub struct ExpectedRow<'a> {
    pub phase: &'a mut [AbsolutePhase],
    /// Whether golden is compared there; elsewhere its surface is interpolated.
    pub compared: &'a mut [bool],
}

/// The buffers of a band of rows.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// Row v lies at v modulo their number: the rows of a window, and the one that it leaves.
    terms: [Terms; SIDE + 1],
    columns: Columns,
    /// Of the row that enters.
    sines: Vec<[i16; 2]>,
}

impl Band {
    /// Begins with rows of `width` pixels.
    fn clear(&mut self, width: usize) {
        let pixels = width.next_multiple_of(BLOCK);
        for terms in &mut self.terms {
            terms.clear(pixels);
        }
        self.columns.clear(pixels);
        refill(&mut self.sines, pixels, [0; 2]);
    }
}

impl Windows {
    /// For samples of `bit_depth` bits with σ = `noise` counts, trusted from a modulation of
    /// `least` on.
    pub fn new(backend: Backend, bit_depth: u8, noise: f64, least: LeastModulation) -> Self {
        let sine = |at: usize| {
            let turns = (at as f64 + 0.5) / TURN as f64;
            libm::rint(32_767.0 * libm::sin(core::f64::consts::TAU * turns)) as i16
        };
        Self {
            bit_depth,
            backend,
            sines: (0..TURN)
                .map(|at| [sine(at), sine(at + TURN / 4)])
                .collect(),
            solver: Solver::new(unit(bit_depth), full_scale(bit_depth), noise, least),
        }
    }

    /// Fits the windows around the pixels of some rows, the first of which is row `top`. `expect`
    /// tells what a row is expected to show; it is asked for these rows and for those that their
    /// windows reach into, from the top row down.
    pub fn fit(
        &self,
        frames: [FrameView<'_>; 2],
        top: usize,
        rows: &mut [PhaseRow<'_>],
        band: &mut Band,
        mut expect: impl FnMut(usize, ExpectedRow<'_>),
    ) {
        let (width, height) = (frames[0].width(), frames[0].height());
        band.clear(width);
        for v in top.saturating_sub(REACH)..top + rows.len() + REACH {
            let Band {
                terms,
                columns,
                sines,
            } = &mut *band;
            let (entering, leaving) = (v % (SIDE + 1), (v + 1) % (SIDE + 1));
            let row = &mut terms[entering];
            if v < height {
                let (phase, compared) = (&mut row.phase[..width], &mut row.compared[..width]);
                expect(v, ExpectedRow { phase, compared });
                self.terms(frames, v, row, sines);
            } else {
                row.clear(width.next_multiple_of(BLOCK));
            }
            columns.slide(self.backend, &terms[entering], &terms[leaving]);
            if let Some(at) = v.checked_sub(top + REACH) {
                let middle = &terms[(v - REACH) % (SIDE + 1)];
                self.row(middle, columns, &mut rows[at]);
            }
        }
    }

    /// s, c and d of row `v`; 0 where nothing is expected or a sample is at full scale.
    fn terms(
        &self,
        frames: [FrameView<'_>; 2],
        v: usize,
        terms: &mut Terms,
        sines: &mut [[i16; 2]],
    ) {
        // The table always has this length; as an array it needs no checks of bounds.
        if let Some(table) = self.sines.first_chunk::<TURN>() {
            for (sine, phase) in sines.iter_mut().zip(&terms.phase) {
                *sine = table[(phase.to_bits() & 0xffff) as usize / (65_536 / TURN)];
            }
        }
        match frames.map(|frame| frame.row(v)) {
            [Samples::Eight(plus), Samples::Eight(minus)] => {
                self.typed(plus, minus, sines, terms);
            }
            [Samples::Sixteen(plus), Samples::Sixteen(minus)] => {
                self.typed(plus, minus, sines, terms);
            }
            // The frames were checked.
            _ => {}
        }
    }

    fn typed<T: Sample>(&self, plus: &[T], minus: &[T], sines: &[[i16; 2]], terms: &mut Terms) {
        let Terms {
            phase,
            compared,
            light,
            s,
            c,
            d,
        } = terms;
        let scale = Scale {
            brightest: full_scale(self.bit_depth) as i32,
            left: u32::from(BITS.saturating_sub(self.bit_depth)),
            right: u32::from(self.bit_depth.saturating_sub(BITS)),
            unit: (unit(self.bit_depth) / 2.0) as f32,
        };
        let expected = (&phase[..], &compared[..]);
        multiply(
            self.backend,
            scale,
            plus,
            minus,
            expected,
            sines,
            light,
            s,
            c,
            d,
        );
    }

    /// From the sums of the columns to the phases of a row.
    fn row(&self, terms: &Terms, columns: &Columns, out: &mut PhaseRow<'_>) {
        let width = out.phase.len();
        let mut solved = SolvedBlock::default();
        for start in (0..width).step_by(BLOCK) {
            let (pixels, end) = (start..start + BLOCK, (start + BLOCK).min(width));
            solve_block(
                self.backend,
                &self.solver,
                columns.of_windows(start),
                (
                    &terms.phase[pixels.clone()],
                    &terms.compared[pixels.clone()],
                ),
                &terms.light[pixels],
                &mut solved,
            );
            let length = end - start;
            out.phase[start..end].copy_from_slice(&solved.phase[..length]);
            out.modulation[start..end].copy_from_slice(&solved.modulation[..length]);
            out.trust[start..end].copy_from_slice(&solved.trust[..length]);
        }
    }
}

/// How samples become terms.
#[derive(Clone, Copy)]
pub struct Scale {
    /// The largest sample.
    brightest: i32,
    /// To [`BITS`] bits.
    left: u32,
    right: u32,
    /// Half a count in the unit of the sums.
    unit: f32,
}

back_end_entry! {
    /// The terms of a row.
    fn multiply [T: Sample] = multiply_row(
        scale: Scale,
        plus: &[T],
        minus: &[T],
        expected: (&[AbsolutePhase], &[bool]),
        sines: &[[i16; 2]],
        light: &mut [f32],
        s: &mut [i16],
        c: &mut [i16],
        d: &mut [i16],
    )
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn multiply_row<V: Lanes, T: Sample>(
    _: V,
    scale: Scale,
    plus: &[T],
    minus: &[T],
    (phase, compared): (&[AbsolutePhase], &[bool]),
    sines: &[[i16; 2]],
    light: &mut [f32],
    s: &mut [i16],
    c: &mut [i16],
    d: &mut [i16],
) {
    let width = plus.len();
    let (minus, sines) = (&minus[..width], &sines[..width]);
    let (phase, compared) = (&phase[..width], &compared[..width]);
    let (light, d) = (&mut light[..width], &mut d[..width]);
    let (s, c) = (&mut s[..width], &mut c[..width]);
    let Scale {
        brightest,
        left,
        right,
        unit,
    } = scale;
    for i in 0..width {
        let (plus, minus) = (plus[i].count(), minus[i].count());
        let sum = plus + minus;
        let below = (plus < brightest) & (minus < brightest);
        light[i] = if below { sum as f32 * unit } else { -1.0 };
        let usable = phase[i].is_known() & below;
        // Half the sum, so that it has as many bits as the difference.
        let (half, change) = (
            (sum << left) >> 1 >> right,
            ((plus - minus) << left) >> right,
        );
        let (half, change) = if compared[i] {
            (half, change)
        } else {
            (half >> FAINT, change >> FAINT)
        };
        let (half, change) = if usable { (half, change) } else { (0, 0) };
        let [sine, cosine] = sines[i];
        s[i] = ((half * i32::from(sine) + (1 << 14)) >> 15) as i16;
        c[i] = ((half * i32::from(cosine) + (1 << 14)) >> 15) as i16;
        d[i] = change as i16;
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
