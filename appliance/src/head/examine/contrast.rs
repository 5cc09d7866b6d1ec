//! Contrast against pitch: how much blur of projector and camera weakens fringes.
//!
//! Contrast is the modulation B of four shifts by a quarter of a turn, B = ½ √((I₀ − I₂)² + (I₁ −
//! I₃)²) (Creath 1988), relative to that of the coarsest pitch, so neither brightness nor the
//! projector's response changes it.

use super::pictures::{Lit, median, pictures};
use crate::head::calibration::Calibration;
use crate::head::calibration::file::{ContrastFile, PitchFile};
use crate::head::rasters::fringes;
use hal::error::Error;
use hal::head::Head;
use serde_json::{Map, Value};

/// Pitches whose contrast is measured, projector pixels. The first is the coarsest: contrasts are
/// relative to it.
pub const PITCHES: [u32; 6] = [64, 32, 24, 16, 12, 8];
/// Shifts of each pitch, a quarter of a turn each.
const SHIFTS: usize = 4;

/// Contrasts by the names of their pitches.
pub fn by_pitch(contrast: &ContrastFile) -> Map<String, Value> {
    let pitches = contrast.pitches.iter();
    pitches
        .map(|of| (of.pitch_px.to_string(), of.contrast.into()))
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
        let one =
            |at: &usize| (shot(0, *at) - shot(2, *at)).hypot(shot(1, *at) - shot(3, *at)) / 2.0;
        measured.push((pitch, median(lit.places().iter().map(one).collect())));
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
