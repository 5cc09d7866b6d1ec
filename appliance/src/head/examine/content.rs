//! Whether the light of a grey depends on the rest of the picture: the same grey stripes between
//! black ones and between white ones.
//!
//! Projectors for video adapt gain and LED current to the content of a picture (TI: CAIC; others:
//! dynamic contrast, eco mode). The response is measured with uniform pictures, so it would be
//! wrong for fringes, and wrong by another amount for each pattern.

use super::pictures::{Lit, pictures};
use hal::error::Error;
use hal::head::Head;
use hal::projector::Raster;

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
