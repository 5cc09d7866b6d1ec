//! Decoding one pixel: its samples → its absolute phase, or the reason why it has none.

use super::demodulate::{Demodulated, demodulate};
use super::unwrap::{Doubt, Form, Wrapped, unwrap_with_doubt};
use super::{Level, Reason};

/// A pixel as the textbook decodes it.
#[derive(Clone, Debug)]
pub struct PixelTwin {
    /// Φ in turns, NaN where rejected.
    pub phase: f64,
    /// Σ N r² · B², B of the finest level, counts²: the weight of the levels that the phase was computed from.
    pub information: f64,
    /// Resolved or why not, before heights are computed.
    pub reason: Reason,
    /// The levels, from coarse to fine.
    pub levels: Vec<Demodulated>,
    /// How close the unwrapping was to another result; none if the pixel was rejected before.
    pub doubt: Option<Doubt>,
}

/// Tolerance at the modulation threshold, counts. Sums of sines of 16-bit counts are exact to about 1e-11 counts, so with it a
/// modulation of exactly 16 is not below 16.
const TIE: f64 = 1e-9;

/// The modulation threshold in counts: 16 of 255.
pub fn least_modulation(full_scale: f64) -> f64 {
    16.0 * full_scale / 255.0
}

impl PixelTwin {
    /// Decodes a pixel: `samples[i]` are those of `levels[i]`, levels from coarse to fine; `map` gives Φ₀ for
    /// the forms that need one, NaN where it is unknown.
    pub fn of(
        form: Form,
        levels: &[Level],
        samples: &[Vec<f64>],
        full_scale: f64,
        map: impl FnOnce() -> f64,
    ) -> Self {
        let seen: Vec<Demodulated> = levels
            .iter()
            .zip(samples)
            .map(|(level, samples)| demodulate(samples, &level.shifts))
            .collect();
        let mut twin = Self {
            phase: f64::NAN,
            information: 0.0,
            reason: Reason::Residual,
            levels: seen,
            doubt: None,
        };
        let map = match form {
            Form::Geometric { .. } => f64::NAN,
            _ => map(),
        };
        if map.is_nan() && !matches!(form, Form::Geometric { .. }) {
            twin.reason = Reason::Unexpected;
            return twin;
        }
        if let Some(reason) = distrust(levels, &twin.levels, full_scale) {
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

    /// Whether a level's modulation is within `counts` of the threshold.
    pub fn on_the_threshold(&self, full_scale: f64, counts: f64) -> bool {
        let least = least_modulation(full_scale);
        let near = |seen: &Demodulated| (seen.modulation - least).abs() < counts;
        self.levels.iter().any(near)
    }

    /// Whether a level's modulation is exactly at the threshold, to rounding.
    pub fn is_tie(&self, full_scale: f64) -> bool {
        self.on_the_threshold(full_scale, TIE)
    }
}

/// The first reason in the samples for which a pixel is rejected; `levels` go from coarse to fine.
fn distrust(levels: &[Level], seen: &[Demodulated], full_scale: f64) -> Option<Reason> {
    let least = least_modulation(full_scale);
    let weak = |seen: &Demodulated| seen.modulation < least - TIE;
    let saturated = levels
        .iter()
        .zip(seen)
        .any(|(level, seen)| level.shifts.len() < 8 && seen.brightest >= full_scale);
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
