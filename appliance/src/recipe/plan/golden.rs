//! The taught part in the form that production needs: weights, safe maps and the golden surface.

use crate::recipe::archive::Arrays;
use crate::recipe::{SequenceKind, safe};
use algo::adaptive::Field;
use algo::inspect::{Taught, Weight};
use algo::phase::Decoder;
use algo::pipeline::{self, KnownSurface};
use algo::units::{AbsolutePhase, Height, Modulation};
use rayon::prelude::*;

/// The weight of each pixel's deviation, and the uncertainty of its taught height.
pub(super) fn taught(noise_counts: f64, arrays: &Arrays, decoder: &Decoder) -> Taught {
    let full_scale = f64::from(decoder.full_scale());
    let noises = arrays.modulation.iter().zip(&arrays.height_slope);
    let sigmas = noises.map(|(&counts, &slope)| {
        let share = (f64::from(counts) / full_scale * 65_535.0).round() as u16;
        let turns = decoder.phase_noise(Modulation::from_bits(share), noise_counts);
        turns * f64::from(slope).abs()
    });
    let valid = arrays.valid.iter().zip(&arrays.golden_height);
    let weights = valid.map(|(&valid, height)| match height.is_finite() {
        true => Weight::from_bits(valid),
        false => Weight::NONE,
    });
    Taught::new(weights.zip(sigmas))
}

/// The phase that a sequence of limited reach is unwrapped about: golden's, unknown where a placement could move the phase
/// further than the sequence reaches. `None` for the full sequence.
pub(super) fn safe_map(arrays: &Arrays, kind: SequenceKind) -> Option<Vec<AbsolutePhase>> {
    let limit = kind.reach()?;
    let phase: Vec<_> = arrays
        .golden_phase
        .iter()
        .copied()
        .map(AbsolutePhase::from_turns)
        .collect();
    Some(safe(&phase, &arrays.phase_reach, limit))
}

/// The surface that deviations refer to. Where golden has none, such as in an opening, it is interpolated from the surface
/// around: material that should not be there must be found, by the full sequence at least.
pub(super) fn surface(width: usize, arrays: &Arrays) -> KnownSurface {
    let turns = arrays.golden_phase.par_iter().copied();
    let mut height = vec![Height::UNKNOWN; arrays.golden_height.len()];
    pipeline::for_each_row(&mut height, width, |v, row| {
        let taught = arrays.golden_height[v * width..].iter().copied();
        let mut line = Field {
            columns: width,
            values: taught.take(width).map(f64::from).collect(),
        };
        line.fill_rows(0.0);
        for (height, mm) in row.iter_mut().zip(line.values) {
            *height = Height::from_mm(mm);
        }
    });
    KnownSurface {
        width,
        phase: turns.map(AbsolutePhase::from_turns).collect(),
        height,
    }
}
