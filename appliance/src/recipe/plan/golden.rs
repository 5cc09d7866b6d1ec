//! The part as taught, in the form that production needs.

use crate::recipe::archive::Arrays;
use crate::recipe::{SequenceKind, safe};
use algo::adaptive::Field;
use algo::inspect::{Taught, Weight};
use algo::phase::Decoder;
use algo::pipeline::{self, KnownSurface};
use algo::units::{AbsolutePhase, Height, Modulation};
use rayon::prelude::*;
use std::ops::Range;

/// Where the part is compared, how much deviations count there, and how certain its taught heights are.
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

/// The phase that a sequence of limited reach is unwrapped about: golden, but where the placement could move it further.
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

/// The surface that heights are counted from: golden. Where golden has nothing, an opening say, it is at the height of the
/// surface around: material where there should be none must be seen, by the full sequence at least.
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

/// Widens a window by what parts are compared with: their motion is found from all of it.
pub(super) fn widen(window: &mut [Range<usize>], arrays: &Arrays, width: usize) {
    for (seen, valid) in window.iter_mut().zip(arrays.valid.chunks(width.max(1))) {
        let first = valid.iter().position(|&valid| valid != 0);
        let last = valid.iter().rposition(|&valid| valid != 0);
        if let Some((first, last)) = first.zip(last) {
            *seen = match seen.start == seen.end {
                true => first..last + 1,
                false => seen.start.min(first)..seen.end.max(last + 1),
            };
        }
    }
}
