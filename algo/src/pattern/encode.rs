//! Grey rasters of a phase function (Peng & Gupta 2008, eq. 1 with a shift).

use super::{PhaseFunction, Shot, Waveform};
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// A raster of 8-bit grey levels, `height` rows of `width`, for a projector to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyRaster {
    /// Projector columns.
    pub width: usize,
    /// Projector rows.
    pub height: usize,
    /// Grey levels, row-major.
    pub pixels: Vec<u8>,
}

/// The inverse of a projector's grey response.
///
/// The projector shows grey level g with the light `measured[g]`. The inverse maps each level to
/// the one whose light is nearest to linear between darkest and brightest.
#[derive(Clone, Debug, PartialEq)]
pub struct GreyResponse {
    inverse: [u8; 256],
}

/// A response that cannot be inverted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the grey response does not rise at level {level}: measure it again with more light or longer \
     exposure"
)]
pub struct ResponseError {
    /// The grey level at which the light is not finite or falls.
    pub level: usize,
}

impl GreyResponse {
    /// The inverse, from the light measured at each of the 256 grey levels, in any linear unit.
    ///
    /// # Errors
    /// If a value is not finite, falls below its predecessor, or nothing rises at all.
    pub fn new(measured: &[f64; 256]) -> Result<Self, ResponseError> {
        let bad = (0..256)
            .find(|&g| !measured[g].is_finite() || (g > 0 && measured[g] < measured[g - 1]));
        if let Some(level) = bad {
            return Err(ResponseError { level });
        }
        let (dark, bright) = (measured[0], measured[255]);
        if dark >= bright {
            return Err(ResponseError { level: 255 });
        }
        let mut inverse = [0; 256];
        let mut level = 0;
        for (wanted, entry) in inverse.iter_mut().enumerate() {
            let light = dark + (bright - dark) * wanted as f64 / 255.0;
            while level < 255 && measured[level] < light {
                level += 1;
            }
            let nearer_below = level > 0 && light - measured[level - 1] < measured[level] - light;
            *entry = (if nearer_below { level - 1 } else { level }) as u8;
        }
        Ok(Self { inverse })
    }

    /// The level to show so that the light is linear in `wanted`.
    pub fn level_for(&self, wanted: u8) -> u8 {
        self.inverse[usize::from(wanted)]
    }
}

/// Entries of a waveform's table per turn.
const STEPS: f64 = 65_536.0;
/// 1.5 · 2⁵²: added to a number below 2⁵⁰, it leaves the nearest whole number in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Encodes I(ξ, η) = I_max/2 · (1 + f(r·Φ_P(ξ, η) + s)), I_max = 255, rounded to grey levels; f is
/// the shot's waveform, sin 2πx or another with peak 1 ([`Waveform`]).
///
/// The argument is rounded to 1/65536 turn, which changes a grey level of a sine by at most 0.006
/// before its own rounding, and of another waveform by at most 0.02.
#[derive(Clone, Debug)]
pub struct Encoder {
    response: Option<GreyResponse>,
    /// One turn of each waveform in grey levels.
    tables: Vec<(Waveform, Vec<u8>)>,
}

impl Encoder {
    /// An encoder for the waveforms of `shots`. With a `response` grey levels pass through its
    /// inverse.
    pub fn new<'a>(
        response: Option<&GreyResponse>,
        shots: impl IntoIterator<Item = &'a Shot>,
    ) -> Self {
        let mut encoder = Self {
            response: response.cloned(),
            tables: Vec::new(),
        };
        for shot in shots {
            if encoder.known(&shot.waveform).is_none() {
                let table = encoder.table(&shot.waveform);
                encoder.tables.push((shot.waveform, table));
            }
        }
        encoder
    }

    fn known(&self, waveform: &Waveform) -> Option<&[u8]> {
        let mut tables = self.tables.iter();
        let found = tables.find(|(known, _)| known == waveform);
        found.map(|(_, table)| &table[..])
    }

    /// One turn of a waveform in grey levels.
    fn table(&self, waveform: &Waveform) -> Vec<u8> {
        let fundamental = waveform.fundamental();
        let level = |bits: u32| {
            let light = fundamental * waveform.unscaled(f64::from(bits) / STEPS);
            let level = libm::rint(127.5 * (1.0 + light)) as u8;
            let response = self.response.as_ref();
            response.map_or(level, |response| response.level_for(level))
        };
        (0..STEPS as u32).map(level).collect()
    }

    /// The raster that shows `shot` of the phase function.
    pub fn raster(&self, function: &PhaseFunction, shot: Shot) -> GreyRaster {
        let Shot {
            ratio,
            shift,
            waveform,
        } = shot;
        let prepared = self.known(&waveform).map(Cow::Borrowed);
        let table = prepared.unwrap_or_else(|| Cow::Owned(self.table(&waveform)));
        let (width, height) = (function.columns(), function.rows());
        let grey = |phase: f64| {
            let step = ((ratio * phase + shift) * STEPS + ROUNDER).to_bits();
            table[usize::from(step as u16)]
        };
        let mut pixels = Vec::with_capacity(width * height);
        if let Some(samples) = function.samples() {
            pixels.extend(samples.iter().map(|&phase| grey(phase)));
        }
        for row in pixels.len() / width..height {
            if row > 0 && function.is_vertical() {
                pixels.extend_from_within(..width);
            } else {
                pixels.extend((0..width).map(|column| grey(function.at_pixel(column, row))));
            }
        }
        GreyRaster {
            width,
            height,
            pixels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    #[test]
    fn a_raster_is_the_sine_of_equation_one() {
        let function = PhaseFunction::vertical(64, 3, 4.0).unwrap();
        let shot = Shot::sine(0.5, 0.25);
        let raster = Encoder::new(None, &[shot]).raster(&function, shot);
        assert_eq!(raster.pixels.len(), 64 * 3);
        for row in 0..3 {
            for column in 0..64 {
                let phase = 0.5 * 4.0 * column as f64 / 64.0 + 0.25;
                let light = 127.5 * (1.0 + libm::sin(TAU * phase));
                let error = f64::from(raster.pixels[row * 64 + column]) - light;
                assert!(error.abs() <= 0.507, "row {row} column {column}: {error}");
            }
        }
        // The same function by its samples, turns below 0 included.
        let samples = (0..64 * 3).map(|at| f64::from(at % 64) / 16.0 - 2.0);
        let sampled = PhaseFunction::sampled(64, 3, samples.collect()).unwrap();
        assert_eq!(Encoder::new(None, &[]).raster(&sampled, shot), raster);
    }

    /// Rasters with a pitch that is no multiple of a pixel, demodulated pixel by pixel by the
    /// definition of S and C.
    #[test]
    fn a_waveform_has_the_phase_of_the_sine_and_more_modulation() {
        let function = PhaseFunction::vertical(601, 1, 601.0 / 6.3).unwrap();
        for shifts in 3..=9 {
            let shots: Vec<Shot> = Shot::level_as(0.8, shifts, Waveform::brightest).collect();
            let encoder = Encoder::new(None, &shots);
            let rasters: Vec<_> = shots
                .iter()
                .map(|&shot| encoder.raster(&function, shot).pixels)
                .collect();
            let fundamental = shots[0].waveform.fundamental();
            for column in 0..601 {
                let (mut s, mut c) = (0.0, 0.0);
                for (raster, shot) in rasters.iter().zip(&shots) {
                    let light = f64::from(raster[column]);
                    s += light * libm::cos(TAU * shot.shift);
                    c += light * libm::sin(TAU * shot.shift);
                }
                let error = libm::atan2(s, c) / TAU - 0.8 * function.at_pixel(column, 0);
                let error = error - libm::rint(error);
                // Rounding to grey levels: at most half of one in each sample, against B = 127.5 b.
                assert!(error.abs() < 1.0e-3, "{shifts} shifts at {column}: {error}");
                let modulation = 2.0 / shifts as f64 * libm::hypot(s, c);
                assert!(
                    (modulation - 127.5 * fundamental).abs() < 0.8,
                    "{shifts} shifts at {column}: {modulation}"
                );
            }
        }
    }

    #[test]
    fn the_inverse_response_makes_the_light_linear() {
        let mut measured = [0.0; 256];
        for (g, light) in measured.iter_mut().enumerate() {
            *light = 3.0 + 200.0 * libm::pow(g as f64 / 255.0, 2.2);
        }
        let response = GreyResponse::new(&measured).unwrap();
        for wanted in 0..=255_u8 {
            let light = measured[usize::from(response.level_for(wanted))];
            let linear = 3.0 + 200.0 * f64::from(wanted) / 255.0;
            // Half the steepest step of a gamma of 2.2 (at white): 200 · 2.2 / 255 / 2.
            assert!((light - linear).abs() <= 0.87, "{wanted}: {light} {linear}");
        }
    }

    #[test]
    fn a_response_that_falls_is_refused_with_the_level() {
        let mut measured = [0.0; 256];
        for (g, light) in measured.iter_mut().enumerate() {
            *light = g as f64;
        }
        measured[100] = 90.0;
        assert_eq!(
            GreyResponse::new(&measured),
            Err(ResponseError { level: 100 })
        );
        assert!(GreyResponse::new(&[5.0; 256]).is_err());
    }
}
