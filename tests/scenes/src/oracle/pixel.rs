//! Decoding one pixel: its samples → its absolute phase, or the reason why it has none.

use super::demodulate::{Demodulated, demodulate, demodulate_whole};
use super::unwrap::{Doubt, Form, Wrapped, unwrap_with_doubt};
use super::{Level, Reason};

/// A pixel as the textbook decodes it.
#[derive(Clone, Debug)]
pub struct PixelTwin {
    /// Φ in turns, NaN where rejected.
    pub phase: f64,
    /// Σ N r² · B², B of the finest level, counts²: the weight of the levels that the phase was
    /// computed from.
    pub information: f64,
    /// Resolved or why not, before heights are computed.
    pub reason: Reason,
    /// The levels, from coarse to fine.
    pub levels: Vec<Demodulated>,
    /// How close the unwrapping was to another result; none if the pixel was rejected before.
    pub doubt: Option<Doubt>,
    /// What decided about its samples.
    pub scale: Scale,
}

/// Tolerance at the modulation threshold, counts. Sums of sines of 16-bit counts are exact to about
/// 1e-11 counts, so with it a modulation of exactly 16 is not below 16.
const TIE: f64 = 1e-9;

/// What decides about samples, in counts.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// The largest sample.
    pub full: f64,
    /// The least modulation that is trusted.
    pub least: f64,
}

impl Scale {
    /// Of samples of so many bits: 16 of 255 counts, or with a known σ of a sample in counts
    /// σ/0.23, from 4 to 127.5 of 255.
    pub fn of(bit_depth: u8, noise: Option<f64>) -> Self {
        let full = f64::from((1_u32 << bit_depth) - 1);
        let count = full / 255.0;
        let least = noise.map_or(16.0 * count, |noise| {
            (noise / 0.23).clamp(4.0 * count, 127.5 * count)
        });
        Self { full, least }
    }
}

impl PixelTwin {
    /// Decodes a pixel: `samples[i]` are those of `levels[i]`, levels from coarse to fine; `map`
    /// gives Φ₀ for the forms that need one, NaN where it is unknown.
    pub fn of(
        form: Form,
        levels: &[Level],
        samples: &[Vec<f64>],
        scale: Scale,
        map: impl FnOnce() -> f64,
    ) -> Self {
        let seen: Vec<Demodulated> = levels
            .iter()
            .zip(samples)
            .map(|(level, samples)| {
                let plain = demodulate(samples, &level.shifts);
                let clipped = plain.brightest >= scale.full && samples.len() > 3;
                let whole = clipped.then(|| demodulate_whole(samples, &level.shifts, scale.full));
                let strong = |seen: &Demodulated| seen.modulation >= scale.least - TIE;
                let whole = whole
                    .flatten()
                    .filter(|whole| strong(whole) && strong(&plain));
                whole.unwrap_or(plain)
            })
            .collect();
        let mut twin = Self {
            phase: f64::NAN,
            information: 0.0,
            reason: Reason::Residual,
            levels: seen,
            doubt: None,
            scale,
        };
        let map = match form {
            Form::Geometric { .. } => f64::NAN,
            _ => map(),
        };
        if map.is_nan() && !matches!(form, Form::Geometric { .. }) {
            twin.reason = Reason::Unexpected;
            return twin;
        }
        if let Some(reason) = distrust(&twin.levels, scale) {
            twin.reason = reason;
            return twin;
        }
        let wrapped: Vec<Wrapped> = levels
            .iter()
            .zip(&twin.levels)
            .map(|(level, seen)| Wrapped {
                ratio: level.ratio,
                turns: seen.turns,
                weight: level.shifts.len() as f64 * level.ratio.powi(2),
                modulation: seen.modulation,
            })
            .collect();
        let (found, doubt) = unwrap_with_doubt(form, &wrapped, map);
        twin.doubt = Some(doubt);
        if let Some((phase, information)) = found {
            (twin.phase, twin.information) = (phase, information);
            twin.reason = Reason::Resolved;
        }
        twin
    }

    /// B of the finest level, as a share of full scale.
    pub fn modulation(&self) -> f64 {
        let finest = self.levels.last();
        finest.map_or(0.0, |seen| seen.modulation / self.scale.full)
    }

    /// Whether a level's modulation is within `counts` of the threshold.
    pub fn on_the_threshold(&self, counts: f64) -> bool {
        let near = |seen: &Demodulated| (seen.modulation - self.scale.least).abs() < counts;
        self.levels.iter().any(near)
    }

    /// Whether a level's modulation is exactly at the threshold, to rounding.
    pub fn is_tie(&self) -> bool {
        self.on_the_threshold(TIE)
    }
}

/// The first reason in the samples for which a pixel is rejected, from coarse to fine.
fn distrust(seen: &[Demodulated], scale: Scale) -> Option<Reason> {
    let weak = |seen: &Demodulated| seen.modulation < scale.least - TIE;
    let saturated = seen.iter().any(|seen| seen.brightest >= scale.full);
    if weak(&seen[0]) {
        Some(Reason::Dark)
    } else if seen.iter().any(weak) {
        Some(Reason::LowModulation)
    } else if saturated {
        Some(Reason::Saturated)
    } else {
        None
    }
}
