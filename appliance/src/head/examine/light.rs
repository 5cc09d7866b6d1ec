//! What is measured of light: the projector's grey response, the camera's noise, the contrast of
//! fringes against their pitch, and whether the light of a grey depends on the rest of the picture.
//!
//! Contrast is the modulation B of four shifts by a quarter of a turn, B = ½ √((I₀ − I₂)² + (I₁ −
//! I₃)²) (Creath 1988), relative to that of the coarsest pitch, so neither brightness nor the
//! projector's response changes it.
//!
//! Projectors for video adapt gain and LED current to the content of a picture (TI: CAIC; others:
//! dynamic contrast, eco mode). The response is measured with uniform pictures, so it would be
//! wrong for fringes, and wrong by another amount for each pattern. The same grey stripes between
//! black ones and between white ones show whether a projector does so.

use super::{Lit, greys, median, pictures};
use crate::head::calibration::Calibration;
use crate::head::calibration::file::{ContrastFile, PitchFile};
use crate::head::rasters::fringes;
use algo::frame::{CameraNoise, PhotonTransfer};
use hal::error::Error;
use hal::head::Head;
use hal::projector::Raster;
use serde_json::{Map, Value};

/// Largest decrease of the response that noise can explain, share of white.
const MOST_FALL: f64 = 0.02;
/// Grey levels; two pictures are taken of each.
const GREYS: [u8; 8] = [16, 48, 80, 112, 144, 176, 208, 240];
/// How often lamps on mains of 50 and 60 Hz get brighter, Hz.
pub const LAMPS_HZ: [u32; 2] = [100, 120];
/// Pictures in the dark that tell whether other light changes.
const DARK_PICTURES: usize = 12;
/// Pitches whose contrast is measured, projector pixels. The first is the coarsest: contrasts are
/// relative to it.
pub const PITCHES: [u32; 6] = [64, 32, 24, 16, 12, 8];
/// Shifts of each pitch, a quarter of a turn each.
const SHIFTS: usize = 4;
/// Largest change of a grey's light with its surroundings, share. A part and a lens scatter one or
/// two percent of the light of white surroundings; adaptation changes it by tens of percent.
pub const MOST_BY_CONTENT: f64 = 0.05;
/// Stripes over the width of the projector.
const STRIPES: u32 = 16;
/// The grey that is compared.
const GREY: u8 = 128;
/// A pixel sees a grey stripe alone if this share of its light is from there.
const ALONE: f64 = 0.95;
/// The fewest pixels that are compared.
const LEAST_PIXELS: usize = 50;

/// The light of grey levels over the lit pixels: 0 is that of black, 1 that of white. `progress`
/// gets the share done.
///
/// # Errors
/// The error of a device.
pub fn lights(
    head: &mut Head,
    settle: u32,
    lit: &Lit,
    levels: &[u8],
    progress: &dyn Fn(f64),
) -> Result<Vec<f64>, Error> {
    let mut lights = Vec::with_capacity(levels.len());
    let patterns = greys(head.projector_size(), levels.iter().copied());
    pictures(head, settle, patterns, &mut |counts| {
        lights.push(lit.share_of_white(lit.mean(&counts)));
        progress(lights.len() as f64 / levels.len() as f64);
    })?;
    Ok(lights)
}

/// The light of all 256 grey levels on a linear scale: 0 for black, 255 for white, non-decreasing.
///
/// Noise is removed by isotonic regression: the result is the non-decreasing sequence nearest to
/// the measured one in least squares (pool adjacent violators: Ayer et al. 1955).
///
/// # Errors
/// The error of a device, or if light falls where grey rises.
pub fn response(
    head: &mut Head,
    settle: u32,
    lit: &Lit,
    progress: &dyn Fn(f64),
) -> Result<[f64; 256], Error> {
    let levels: Vec<u8> = (0..=u8::MAX).collect();
    let raw = lights(head, settle, lit, &levels, progress)?;
    let monotonic = isotonic(&raw);
    let off = |at: &usize| (raw[*at] - monotonic[*at]).abs();
    if let Some(at) = (0..raw.len()).find(|at| !(off(at) <= MOST_FALL)) {
        return Err(Error::unsupported(
            format!("a projector whose light falls where grey rises (near level {at})"),
            "switch off its dynamic contrast and picture improvement",
        ));
    }
    // Black and white may have been pooled with their neighbours.
    let (dark, bright) = (monotonic[0], monotonic[monotonic.len() - 1]);
    let mut linear = [0.0; 256];
    for (out, light) in linear.iter_mut().zip(&monotonic) {
        *out = 255.0 * (light - dark) / (bright - dark);
    }
    Ok(linear)
}

/// The non-decreasing sequence nearest to `values` in least squares.
fn isotonic(values: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::with_capacity(values.len());
    for value in values {
        let mut pool = (*value, 1);
        while let Some((mean, count)) = pools.last().copied().filter(|last| last.0 > pool.0) {
            let all = count + pool.1;
            pool = (
                (mean * count as f64 + pool.0 * pool.1 as f64) / all as f64,
                all,
            );
            pools.pop();
        }
        pools.push(pool);
    }
    let spread = |(mean, count)| std::iter::repeat_n(mean, count);
    pools.into_iter().flat_map(spread).collect()
}

/// By how much other light than the projector's changes, ± counts over the lit pixels: half the span
/// of pictures in the dark.
///
/// # Errors
/// The error of a device.
pub fn flicker(head: &mut Head, settle: u32, lit: &Lit) -> Result<f64, Error> {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    let dark = greys(head.projector_size(), [0; DARK_PICTURES]);
    pictures(head, settle, dark, &mut |counts| {
        let mean = lit.mean(&counts);
        (least, most) = (least.min(mean), most.max(mean));
    })?;
    Ok((most - least) / 2.0)
}

/// The camera's noise from two pictures of each of eight greys, with its σ at half the light of
/// white.
///
/// # Errors
/// The error of a device, or `Unsupported` if no level is clear of black and full scale.
pub fn noise(head: &mut Head, settle: u32, lit: &Lit) -> Result<CameraNoise, Error> {
    let levels = GREYS.iter().flat_map(|grey| [*grey, *grey]);
    let full_scale = lit.full_scale();
    let mut sums = PhotonTransfer::new(full_scale);
    let mut before: Option<Vec<f32>> = None;
    pictures(
        head,
        settle,
        greys(head.projector_size(), levels),
        &mut |counts| match before.take() {
            None => before = Some(counts),
            Some(first) => {
                let share = lit.share_of_white((lit.mean(&first) + lit.mean(&counts)) / 2.0);
                sums.add(&first, &counts, lit.levels(share));
            }
        },
    )?;
    sums.noise(lit.bright() / 2.0).ok_or_else(|| {
        Error::unsupported(
            "measuring noise where every level is dark or saturated",
            "expose so that white is at half to nine tenths of full scale",
        )
    })
}

/// Contrasts by the names of their pitches.
pub fn by_pitch(contrast: &ContrastFile) -> Map<String, Value> {
    let pitches = contrast.pitches.iter();
    pitches
        .map(|pitch| (pitch.pitch_px.to_string(), pitch.contrast.into()))
        .collect()
}

/// The contrast of each of [`PITCHES`] by the median modulation over the lit pixels.
///
/// # Errors
/// The error of a device, or if the projector is too small for a pitch.
pub fn contrast(
    head: &mut Head,
    calibration: &Calibration,
    settle: u32,
    lit: &Lit,
) -> Result<ContrastFile, Error> {
    let mut measured = Vec::with_capacity(PITCHES.len());
    for pitch in PITCHES {
        let patterns = fringes(head.projector_size(), pitch, SHIFTS, calibration)?;
        let mut shots = Vec::with_capacity(SHIFTS);
        pictures(head, settle, patterns.into_iter().map(Ok), &mut |counts| {
            shots.push(counts);
        })?;
        let shot = |shift: usize, at: usize| f64::from(shots[shift][at]);
        let modulation =
            |at: &usize| (shot(0, *at) - shot(2, *at)).hypot(shot(1, *at) - shot(3, *at)) / 2.0;
        measured.push((pitch, median(lit.places().iter().map(modulation).collect())));
    }
    let modulation_counts = measured.first().map_or(0.0, |(_, coarsest)| *coarsest);
    let relative = |(pitch_px, modulation)| PitchFile {
        pitch_px,
        contrast: modulation / f64::max(modulation_counts, 1e-9),
    };
    Ok(ContrastFile {
        modulation_counts,
        pitches: measured.into_iter().map(relative).collect(),
    })
}

/// By how much more light a grey gives between white stripes than between black ones, as a share;
/// `None` if too few pixels see a stripe alone.
///
/// # Errors
/// The error of a device.
pub fn by_content(head: &mut Head, settle: u32, lit: &Lit) -> Result<Option<f64>, Error> {
    let size = head.projector_size();
    let shown = [(GREY, 0), (GREY, u8::MAX), (u8::MAX, 0), (0, u8::MAX)];
    let patterns = shown.map(|(stripes, others)| striped(size, stripes, others));
    let mut taken = Vec::with_capacity(shown.len());
    pictures(head, settle, patterns, &mut |counts| taken.push(counts))?;
    let black: Vec<f64> = lit.levels(0.0).collect();
    let light = |picture: usize, at: usize| f64::from(taken[picture][at]) - black[at];
    // The last two pictures have the same mean, so whatever adapts to it changes both by the same
    // factor.
    let alone = |at: &&usize| light(2, **at) > ALONE * (light(2, **at) + light(3, **at));
    let pixels: Vec<usize> = lit.places().iter().filter(alone).copied().collect();
    if pixels.len() < LEAST_PIXELS {
        return Ok(None);
    }
    let sum = |picture: usize| pixels.iter().map(|at| light(picture, *at)).sum::<f64>();
    Ok(Some(sum(1) / sum(0) - 1.0))
}

/// Vertical stripes of one grey, and others of the same width between them.
fn striped((columns, rows): (u32, u32), stripes: u8, others: u8) -> Result<Raster, Error> {
    let width = (columns / STRIPES).max(1);
    let grey = |column: u32| match (column / width).is_multiple_of(2) {
        true => stripes,
        false => others,
    };
    let row: Vec<u8> = (0..columns).map(grey).collect();
    Raster::new(columns, rows, row.repeat(rows as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_falls_is_levelled_to_its_mean_and_what_rises_is_kept() {
        assert_eq!(
            isotonic(&[0.0, 1.0, 3.0, 2.0, 4.0]),
            [0.0, 1.0, 2.5, 2.5, 4.0]
        );
        assert_eq!(isotonic(&[3.0, 2.0, 1.0]), [2.0, 2.0, 2.0]);
        assert_eq!(isotonic(&[1.0, 2.0]), [1.0, 2.0]);
        assert!(isotonic(&[]).is_empty());
    }
}
