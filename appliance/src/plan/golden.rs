//! The part as taught, in the form that production needs. Arrays are dropped as soon as they are used up.

use crate::recipe::archive::Arrays;
use crate::recipe::{RecipeFile, SequenceKind, safe};
use algo::adaptive::Field;
use algo::geometry::Triangulator;
use algo::inspect::Taught;
use algo::phase::Decoder;
use algo::pipeline::{self, KnownSurface};
use algo::units::{AbsolutePhase, Height, Modulation};
use std::mem::take;

/// Where the part is compared, and how certain its taught heights are.
pub(super) fn taught(file: &RecipeFile, arrays: &mut Arrays, decoder: &Decoder) -> Taught {
    take(&mut arrays.height_curvature);
    let full_scale = f64::from(decoder.full_scale());
    let noises = take(&mut arrays.modulation)
        .into_iter()
        .zip(take(&mut arrays.height_slope));
    let sigmas = noises.map(|(counts, slope)| {
        let share = (f64::from(counts) / full_scale * 65_535.0).round() as u16;
        let turns = decoder.phase_noise(Modulation::from_bits(share), file.noise_counts);
        turns * f64::from(slope).abs()
    });
    let valid = take(&mut arrays.valid).into_iter();
    let compared = valid
        .zip(&arrays.golden_height)
        .map(|(valid, height)| valid == 1 && height.is_finite());
    Taught::new(compared.zip(sigmas))
}

/// The surface that production's phases are unwrapped about and its heights counted from: golden. A sequence of limited
/// reach knows nothing where the placement could move the phase further. The full one also looks
/// where golden has nothing, an opening say, at the height of the surface around: material where
/// there should be none must be seen.
pub(super) fn surface(
    file: &RecipeFile,
    mut arrays: Arrays,
    kind: SequenceKind,
    triangulator: &Triangulator,
) -> KnownSurface {
    let width = file.camera.width as usize;
    let mut phase: Vec<_> = take(&mut arrays.golden_phase)
        .into_iter()
        .map(AbsolutePhase::from_turns)
        .collect();
    let heights = take(&mut arrays.golden_height).into_iter().map(f64::from);
    if let Some(limit) = kind.reach() {
        return KnownSurface {
            width,
            phase: safe(&phase, &arrays.phase_reach, limit),
            height: heights.map(Height::from_mm).collect(),
        };
    }
    take(&mut arrays.phase_reach);
    let mut surface = Field {
        columns: width,
        values: heights.collect(),
    };
    surface.fill_rows(0.0);
    let height: Vec<_> = surface.values.into_iter().map(Height::from_mm).collect();
    pipeline::for_each_row(&mut phase, width, |v, row| {
        for (u, phase) in row.iter_mut().enumerate() {
            if !phase.is_known() {
                *phase = triangulator.phase_of(u, v, height[v * width + u].mm());
            }
        }
    });
    KnownSurface {
        width,
        phase,
        height,
    }
}
