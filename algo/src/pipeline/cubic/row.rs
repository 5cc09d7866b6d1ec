//! A row of phases → a row of height offsets from the known surface, in nm.
//!
//! z − z₀ = y (a + y (b + y c)), y = (Φ − Φ₀) / range; ∂z/∂y = a + y (2b + 3c y), σ_z² = noise ·
//! (∂z/∂y)² / B². Plain loops over slices, compiled for each back-end's instructions; single
//! precision with + − × ÷ only and sums of whole numbers, so that the bits are the same everywhere.

use super::fit::UNIT_NM;
use crate::math::nearest::whole;
use crate::phase::Trust;
use crate::simd::{Lanes, back_end_entry};
use crate::units::{AbsolutePhase, Height, Modulation};
use core::ops::Range;

/// Bit of [`CubicInput::taught`]: the part is compared at this pixel.
pub(crate) const COMPARED: u16 = 1 << 15;
/// Bit of [`CubicInput::taught`]: the part is also compared at the pixels to the right, below, and
/// below to the right.
pub(crate) const SQUARE: u16 = 1 << 14;
/// Bits of [`CubicInput::taught`]: σ of golden's height in 32 nm.
pub(crate) const SIGMA: u16 = SQUARE - 1;
/// Variances are summed in units of the square of this many nm, each rounded to nearest.
pub(crate) const VARIANCE_UNIT_NM: f64 = 512.0;
/// Standard deviations of the known heights are given in 1/16 of [`VARIANCE_UNIT_NM`].
const SIGMAS_PER_UNIT_BITS: u32 = 4;
/// Half of the square of [`VARIANCE_UNIT_NM`], in squares of a sixteenth of it, for rounding.
const HALF: u32 = 1 << (2 * SIGMAS_PER_UNIT_BITS - 1);
/// Largest variance of a pixel, in squares of [`VARIANCE_UNIT_NM`], about (1 mm)²: a sum over a block
/// then fits 32 bits.
const MAX_VARIANCE: f32 = 4_000_000.0;
/// Pixels per block: skipped together where none is resolved; sums over a block fit 32 bits.
const BLOCK: usize = 128;
/// Pixels that one prefetch hint covers.
const FETCHED: usize = 32;

/// The cubics of a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CubicRow<'a> {
    /// Φ₀.
    pub base: &'a [AbsolutePhase],
    /// Coefficient of y in nm.
    pub first: &'a [f32],
    /// Coefficient of y².
    pub second: &'a [i16],
    /// Coefficient of y³.
    pub third: &'a [i16],
    /// Reach of the cubic, 1/128 turn.
    pub reach: &'a [u8],
    /// The phase of y = 1, turns.
    pub range: f64,
}

impl CubicRow<'_> {
    /// The cubics of some columns.
    pub fn part(&self, columns: Range<usize>) -> Self {
        Self {
            base: &self.base[columns.clone()],
            first: &self.first[columns.clone()],
            second: &self.second[columns.clone()],
            third: &self.third[columns.clone()],
            reach: &self.reach[columns],
            range: self.range,
        }
    }

    /// A coefficient of y² or y³ in nm.
    #[inline(always)]
    pub fn coefficient(units: i16) -> f32 {
        f32::from(units) * UNIT_NM as f32
    }
}

/// A decoded row, with what is taught of its pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CubicInput<'a> {
    /// Φ.
    pub phase: &'a [AbsolutePhase],
    /// B.
    pub modulation: &'a [Modulation],
    /// Which pixels are resolved.
    pub trust: &'a [Trust],
    /// σ of golden's height in 32 nm ([`SIGMA`]), 0 where not known; [`COMPARED`] and [`SQUARE`].
    pub taught: &'a [u16],
    /// σ_z² = `noise` · (∂z/∂y)² / B², in units of [`VARIANCE_UNIT_NM`]².
    pub noise: f32,
}

/// What the offsets of a row are written to, and counted in.
#[derive(Debug)]
pub(crate) struct CubicOutput<'a> {
    /// z − z₀ in nm, [`NO_OFFSET`] where the cubic does not reach.
    pub offset: &'a mut [i32],
    /// z − z₀ in nm where the part is compared, [`NO_OFFSET`] elsewhere.
    pub deviation: &'a mut [i32],
    /// Sums.
    pub tally: &'a mut HeightTally,
    /// Columns that contain all resolved pixels, in whole blocks.
    pub extent: &'a mut Range<usize>,
}

/// Counts and sums over rows of height offsets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HeightTally {
    /// Resolved pixels.
    pub resolved: u64,
    /// Pixels with a height.
    pub measured: u64,
    /// Pixels with a height that are compared.
    pub compared: u64,
    /// Compared pixels of the rows whose variances are summed.
    pub summed: u64,
    /// Σ of σ_z² of these pixels.
    pub variance: u64,
    /// Pixels with a height, in the rows whose variances are summed, where σ of golden's height is
    /// known.
    pub taught: u64,
    /// Σ of the squares of σ of golden's height at these pixels.
    pub taught_variance: u64,
}

impl HeightTally {
    /// Adds another tally.
    pub fn add(&mut self, other: &Self) {
        self.resolved += other.resolved;
        self.measured += other.measured;
        self.compared += other.compared;
        self.summed += other.summed;
        self.variance += other.variance;
        self.taught += other.taught;
        self.taught_variance += other.taught_variance;
    }
}

back_end_entry! {
    /// Offsets of columns of a row; everything outside of them is left as it is.
    fn offset_row [] = offset_columns(
        plan: CubicRow<'_>,
        seen: CubicInput<'_>,
        columns: Range<usize>,
        out: CubicOutput<'_>,
    )
}

#[inline(always)]
fn offset_columns<V: Lanes>(
    v: V,
    plan: CubicRow<'_>,
    seen: CubicInput<'_>,
    columns: Range<usize>,
    out: CubicOutput<'_>,
) {
    let scale = scale(plan.range);
    let tally = &mut *out.tally;
    *out.extent = 0..0;
    let mut start = columns.start;
    while start < columns.end {
        let end = (start + BLOCK).min(columns.end);
        let length = end - start;
        let trust = &seen.trust[start..end][..length];
        let offsets = &mut out.offset[start..end][..length];
        let deviations = &mut out.deviation[start..end][..length];
        let mut resolved = 0_u8;
        for &trust in trust {
            resolved += u8::from(trust as u8 == Trust::Resolved as u8);
        }
        if resolved == 0 {
            offsets.fill(NO_OFFSET);
            deviations.fill(NO_OFFSET);
            start = end;
            continue;
        }
        tally.resolved += u64::from(resolved);
        if out.extent.start >= out.extent.end {
            out.extent.start = start;
        }
        out.extent.end = end;
        let base = &plan.base[start..end][..length];
        let first = &plan.first[start..end][..length];
        let second = &plan.second[start..end][..length];
        let third = &plan.third[start..end][..length];
        let reach = &plan.reach[start..end][..length];
        let phase = &seen.phase[start..end][..length];
        let taught = &seen.taught[start..end][..length];
        let mut fetched = start;
        while fetched < end {
            v.fetch(plan.first, fetched, plan.first.len());
            v.fetch(plan.second, fetched, plan.second.len());
            v.fetch(plan.third, fetched, plan.third.len());
            v.fetch(plan.reach, fetched, plan.reach.len());
            v.fetch(seen.taught, fetched, seen.taught.len());
            fetched += FETCHED;
        }
        let (mut measured, mut compared) = (0_u32, 0_u32);
        for i in 0..length {
            let delta = phase[i].to_bits().wrapping_sub(base[i].to_bits());
            let far = i32::from(reach[i]) << 9;
            let known = trust[i] as u8 == Trust::Resolved as u8;
            let inside = known & (delta < far) & (delta > -far);
            let y = delta as f32 * scale;
            let (b, c) = (
                CubicRow::coefficient(second[i]),
                CubicRow::coefficient(third[i]),
            );
            let nm = whole(y * (first[i] + y * (b + y * c)));
            let compare = inside & (taught[i] >= COMPARED);
            offsets[i] = if inside { nm } else { NO_OFFSET };
            deviations[i] = if compare { nm } else { NO_OFFSET };
            measured += u32::from(inside);
            compared += u32::from(compare);
        }
        tally.measured += u64::from(measured);
        tally.compared += u64::from(compared);
        start = end;
    }
}

back_end_entry! {
    /// Adds the variances of a row's heights, as measured and as taught, to its tally.
    fn sum_variances [] = sum_columns(
        plan: CubicRow<'_>,
        seen: CubicInput<'_>,
        columns: Range<usize>,
        offset: &[i32],
        tally: &mut HeightTally,
    )
}

#[inline(always)]
fn sum_columns<V: Lanes>(
    _: V,
    plan: CubicRow<'_>,
    seen: CubicInput<'_>,
    columns: Range<usize>,
    offset: &[i32],
    tally: &mut HeightTally,
) {
    let scale = scale(plan.range);
    let mut start = columns.start;
    while start < columns.end {
        let end = (start + BLOCK).min(columns.end);
        let length = end - start;
        let base = &plan.base[start..end][..length];
        let first = &plan.first[start..end][..length];
        let second = &plan.second[start..end][..length];
        let third = &plan.third[start..end][..length];
        let phase = &seen.phase[start..end][..length];
        let taught = &seen.taught[start..end][..length];
        let modulation = &seen.modulation[start..end][..length];
        let offsets = &offset[start..end][..length];
        let (mut compared, mut variances) = (0_u32, 0_u32);
        let (mut known, mut taught_variances) = (0_u32, 0_u32);
        for i in 0..length {
            let inside = offsets[i] != NO_OFFSET;
            let compare = inside & (taught[i] >= COMPARED);
            let delta = phase[i].to_bits().wrapping_sub(base[i].to_bits());
            let y = delta as f32 * scale;
            let (b, c) = (
                CubicRow::coefficient(second[i]),
                CubicRow::coefficient(third[i]),
            );
            let slope = first[i] + y * ((b + b) + y * (3.0 * c));
            let counts = f32::from(modulation[i].to_bits());
            let variance = seen.noise * (slope * slope) / (counts * counts);
            let variance = if variance < MAX_VARIANCE {
                variance
            } else {
                MAX_VARIANCE
            };
            let variance = whole(variance) as u32;
            compared += u32::from(compare);
            variances = variances.wrapping_add(if compare { variance } else { 0 });
            let sigma = u32::from(taught[i] & SIGMA);
            let square = (sigma * sigma + HALF) >> (2 * SIGMAS_PER_UNIT_BITS);
            known += u32::from(inside & (sigma != 0));
            taught_variances = taught_variances.wrapping_add(if inside { square } else { 0 });
        }
        tally.summed += u64::from(compared);
        tally.variance += u64::from(variances);
        tally.taught += u64::from(known);
        tally.taught_variance += u64::from(taught_variances);
        start = end;
    }
}

/// y per unit of a phase difference's bits.
#[inline(always)]
fn scale(range: f64) -> f32 {
    (1.0 / (range * 65_536.0)) as f32
}

/// "No height" among offsets.
pub(crate) const NO_OFFSET: i32 = Height::UNKNOWN.nm();
