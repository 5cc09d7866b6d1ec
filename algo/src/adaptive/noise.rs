//! The pattern of least noise for the contrast of projector and camera.
//!
//! The height's noise is proportional to 1 / (g · M(g)), frequency times contrast. So each part of the
//! surface gets the frequency that maximises g · M(g), instead of a fixed image pitch. Needs one
//! preliminary measurement with vertical fringes.

use super::field::Field;
use super::integrate::balanced_rows;
use super::{AdaptError, ProjectorMap};
use crate::pattern::PhaseFunction;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// How contrast falls with frequency, and the limits of pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// σ of the projector's Gaussian blur, projector pixels.
    pub projector_blur: f64,
    /// σ of the camera's Gaussian blur, camera pixels, beside the box of the pixel itself.
    pub camera_blur: f64,
    /// Smallest pitch in projector pixels.
    pub projector_pitch: f64,
    /// Smallest pitch in camera pixels.
    pub image_pitch: f64,
}

/// Default of the smallest pitch in projector pixels. Below 6 px the projector's own
/// pixels distort the fringes (a bilinear raster at 5 px: error / σ_z rises from 1.09 to 1.21 on the
/// cone).
pub const PROJECTOR_PITCH: f64 = 6.0;
/// Default of the smallest pitch in camera pixels: the maximum of g · M(g) with the box of the pixel alone.
pub const IMAGE_PITCH: f64 = 2.2;
/// No blur but the pixels' own.
const SHARP: Optics = Optics {
    projector_blur: 0.0,
    camera_blur: 0.0,
    projector_pitch: PROJECTOR_PITCH,
    image_pitch: IMAGE_PITCH,
};
/// Largest pitch of a pattern, projector pixels. Where the part is so steep that this is not resolved, no pitch is.
const MAX_PITCH: f64 = 128.0;
/// Neighbours that differ by more than this many projector pixels per camera pixel lie on different surfaces.
pub const MAX_SLOPE: f64 = 6.0;
/// Cells without a camera pixel take the frequency of a neighbour up to this far away, projector pixels.
const FILL: usize = 8;
/// Reach of the minimum filter to each side, projector pixels.
const MINIMUM_REACH: usize = 1;
/// σ of the smoothing after it, projector pixels.
const SMOOTHING: f64 = 3.0;
/// Share of the largest g · M(g) that is enough.
const ENOUGH: f64 = 0.985;
/// Frequencies that are tried between the coarsest and the finest, in geometric progression.
const STEPS: usize = 160;

/// The contrast M of a sine of frequency `g` (turns per projector pixel) that the camera sees with
/// gradient `[a, b]` (turns per camera pixel along u and v): that of the projector's bilinear pixels and
/// blur, of the camera's blur and of the box of its pixel.
pub fn contrast(optics: &Optics, g: f64, [a, b]: [f64; 2]) -> f64 {
    let gauss = |sigma: f64, f: f64| libm::exp(-2.0 * (PI * sigma * f) * (PI * sigma * f));
    let projector = sinc(g) * sinc(g) * gauss(optics.projector_blur, g);
    let across = libm::sqrt(a * a + b * b);
    projector * sinc(a) * sinc(b) * gauss(optics.camera_blur, across)
}

/// sin πx / πx.
fn sinc(x: f64) -> f64 {
    let angle = PI * x;
    if libm::fabs(angle) < 1e-9 {
        1.0
    } else {
        libm::sin(angle) / angle
    }
}

/// σ of the blur of projector and camera together, in projector pixels, from the contrast that a
/// preliminary measurement has at two frequencies: each sample is a pixel's slope J and its
/// modulation at `fine` as a share of that at `coarse` (turns per projector pixel). Uses the median, which is robust
/// against edges and noise.
///
/// `None` without samples; 0 if the contrast is better than that of the pixels alone.
pub fn measured_blur(
    samples: impl Iterator<Item = ([f64; 2], f64)>,
    fine: f64,
    coarse: f64,
) -> Option<f64> {
    let at = |g: f64, [ju, jv]: [f64; 2]| contrast(&SHARP, g, [g * ju, g * jv]);
    let mut shares: Vec<f64> = samples
        .map(|(slope, share)| share * at(coarse, slope) / at(fine, slope))
        .filter(|share| share.is_finite() && *share > 0.0)
        .collect();
    if shares.is_empty() {
        return None;
    }
    let middle = shares.len() / 2;
    let (_, median, _) = shares.select_nth_unstable_by(middle, f64::total_cmp);
    // M_fine / M_coarse = exp(−2π²σ²(fine² − coarse²)).
    let variance = -libm::log(*median) / (2.0 * PI * PI * (fine * fine - coarse * coarse));
    Some(libm::sqrt(variance.max(0.0)))
}

/// The frequency for a surface that the camera sees with slope J: the lowest whose g · M(g)
/// reaches 98.5 % of the maximum within both limits of pitch. The maximum is flat: the last 1.5 %
/// would cost a tenth of the contrast, and with it resolved pixels.
pub fn best_frequency(optics: &Optics, [ju, jv]: [f64; 2]) -> f64 {
    let slope = libm::sqrt(ju * ju + jv * jv);
    let coarsest = 1.0 / MAX_PITCH;
    let finest = (1.0 / optics.projector_pitch)
        .min(1.0 / (optics.image_pitch * slope.max(1e-6)))
        .max(coarsest);
    let ratio = libm::pow(finest / coarsest, 1.0 / STEPS as f64);
    let frequency = |i: usize| coarsest * libm::pow(ratio, i as f64);
    let worth = |i: usize| {
        let g = frequency(i);
        g * contrast(optics, g, [g * ju, g * jv])
    };
    // The logarithms of g, of each sinc and of each Gaussian are concave, so g · M(g) has a single peak.
    let peak = first(STEPS, |i| worth(i) >= worth(i + 1));
    let enough = ENOUGH * worth(peak);
    frequency(first(peak, |i| worth(i) >= enough))
}

/// The first of 0…`last` for which `holds` is true, given that it is true for all after it; `last` if it is for none before.
fn first(last: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, last);
    while low < high {
        let middle = low.midpoint(high);
        if holds(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

/// RMS of σ_z in mm under the phase function `before`, and predicted for the same levels and shifts of `after`: σ_z of each pixel
/// is proportional to 1 / (g · M(g)). `sigma` is σ_z of each camera pixel of `map` under `before`; `None` if no pixel has one.
pub fn predict(
    sigma: &[f32],
    map: &ProjectorMap,
    before: &PhaseFunction,
    after: &PhaseFunction,
    optics: &Optics,
) -> Option<[f64; 2]> {
    let slopes = map.slopes(MAX_SLOPE);
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for ((sigma, [xi, eta]), [ju, jv]) in sigma.iter().zip(&map.points).zip(slopes) {
        let worth = |function: &PhaseFunction| {
            let g = function.at(xi + 0.5, *eta) - function.at(xi - 0.5, *eta);
            g * contrast(optics, g, [g * ju, g * jv])
        };
        let now = f64::from(*sigma);
        let then = now * worth(before) / worth(after);
        if now.is_finite() && then.is_finite() {
            squares = [squares[0] + now * now, squares[1] + then * then];
            count += 1.0;
        }
    }
    (count > 0.0).then(|| squares.map(|sum: f64| libm::sqrt(sum / count)))
}

/// Makes the phase function for a part, over a projector of `columns` × `rows` pixels.
///
/// # Errors
/// If no pixel of the part is known.
pub fn adapt(
    map: &ProjectorMap,
    columns: usize,
    rows: usize,
    optics: &Optics,
) -> Result<PhaseFunction, AdaptError> {
    let slopes = map.slopes(MAX_SLOPE);
    let frequencies = frequencies(&slopes, map.width, optics);
    let mut field = Field::uniform(columns, rows, f64::NAN);
    let mut seen = vec![false; columns * rows];
    for (point, g) in map.points.iter().zip(&frequencies) {
        if g.is_nan() || point[0].is_nan() {
            continue;
        }
        if let Some(cell) = field.cell(*point) {
            seen[cell] = true;
            // Of several pixels that see a cell the lowest frequency counts; `min` ignores a NaN.
            field.values[cell] = g.min(field.values[cell]);
        }
    }
    if !seen.contains(&true) {
        return Err(AdaptError::Empty);
    }
    field.fill_near(FILL);
    field.fill_columns();
    field.fill_rows(1.0 / optics.projector_pitch);
    let field = field.minimum(MINIMUM_REACH).smoothed(SMOOTHING);
    PhaseFunction::sampled(columns, rows, balanced_rows(&field, &seen)).map_err(AdaptError::Pattern)
}

fn frequencies(slopes: &[[f64; 2]], width: usize, optics: &Optics) -> Vec<f64> {
    let mut frequencies = vec![f64::NAN; slopes.len()];
    crate::pipeline::for_each_row(&mut frequencies, width, |v, row| {
        for (g, slope) in row.iter_mut().zip(&slopes[v * width..]) {
            if !slope[0].is_nan() {
                *g = best_frequency(optics, *slope);
            }
        }
    });
    frequencies
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Optics = Optics {
        projector_blur: 0.0,
        camera_blur: 0.0,
        projector_pitch: 2.0,
        image_pitch: 1.5,
    };

    #[test]
    fn the_pitch_under_gaussian_blur_is_a_little_over_two_pi_sigma() {
        let optics = Optics {
            projector_blur: 2.0,
            ..FREE
        };
        // A face-on surface seen very finely: only the projector matters. x·exp(−x²/2) has its
        // maximum at x = 1 (12.57 px; 13.0 px with bilinear pixels) and 98.5 % of it at x = 0.84.
        let pitch = 1.0 / best_frequency(&optics, [0.01, 0.0]);
        assert!((14.2..15.2).contains(&pitch), "{pitch}");
    }

    #[test]
    fn the_image_pitch_for_the_pixel_box_alone_is_a_little_over_two_pixels() {
        // Steep: 8 projector pixels per camera pixel, so that only the camera limits.
        let pitch = 1.0 / (best_frequency(&FREE, [8.0, 0.0]) * 8.0);
        assert!((2.1..2.6).contains(&pitch), "{pitch}");
    }

    #[test]
    fn the_best_frequency_is_the_one_that_trying_all_of_them_finds() {
        for blur in [0.0, 0.7, 2.0, 5.0] {
            for at in 0..400 {
                let optics = Optics {
                    projector_blur: blur,
                    camera_blur: f64::from(at % 3),
                    ..SHARP
                };
                let angle = f64::from(at);
                let slope = 0.01 * libm::pow(1.02, angle);
                let [ju, jv] = [slope * libm::cos(angle), slope * libm::sin(angle)];
                let coarsest = 1.0 / MAX_PITCH;
                let finest = (1.0 / PROJECTOR_PITCH)
                    .min(1.0 / (IMAGE_PITCH * libm::hypot(ju, jv)))
                    .max(coarsest);
                let ratio = libm::pow(finest / coarsest, 1.0 / STEPS as f64);
                let all = || (0..=STEPS).map(|i| coarsest * libm::pow(ratio, i as f64));
                let worth = |g: f64| g * contrast(&optics, g, [g * ju, g * jv]);
                let best = all().map(worth).fold(0.0, f64::max);
                let found = all().find(|&g| worth(g) >= ENOUGH * best).unwrap();
                let searched = best_frequency(&optics, [ju, jv]);
                assert!(
                    (searched / found - 1.0).abs() < 1e-12,
                    "{optics:?} {ju} {jv}"
                );
            }
        }
    }

    #[test]
    fn the_blur_is_found_from_the_contrast_of_two_levels() {
        let blurred = Optics {
            projector_blur: 1.3,
            ..FREE
        };
        let (fine, coarse) = (1.0 / 20.0, 1.0 / 900.0);
        let share = |[ju, jv]: [f64; 2]| {
            contrast(&blurred, fine, [fine * ju, fine * jv])
                / contrast(&blurred, coarse, [coarse * ju, coarse * jv])
        };
        let slopes = (0..99).map(|i| [0.5 + 0.01 * f64::from(i), 0.1]);
        let samples = slopes.map(|slope| (slope, share(slope)));
        // One pixel at an edge decides nothing.
        let samples = samples.chain([([1.0, 0.0], 0.1)]);
        let sigma = measured_blur(samples, fine, coarse).unwrap();
        assert!((sigma - 1.3).abs() < 1e-6, "{sigma}");
        assert_eq!(measured_blur(core::iter::empty(), fine, coarse), None);
    }

    #[test]
    fn limits_of_pitch_hold() {
        let optics = Optics {
            projector_pitch: 8.0,
            image_pitch: 5.0,
            ..FREE
        };
        for (slope, limit) in [([0.1, 0.0], 0.125), ([3.0, 4.0], 1.0 / 25.0)] {
            let g = best_frequency(&optics, slope);
            assert!(g <= limit && g > 0.9 * limit, "{g}");
        }
    }

    #[test]
    fn twice_the_frequency_halves_the_predicted_noise_where_nothing_blurs() {
        let (before, after) = [4.0, 8.0]
            .map(|n| PhaseFunction::vertical(256, 8, n).unwrap())
            .into();
        let points = (0..64).map(|at| [f64::from(at % 8) + 100.0, f64::from(at / 8)]);
        let map = ProjectorMap {
            width: 8,
            points: points.collect(),
        };
        let mut sigma = [0.1; 64];
        sigma[0] = f32::NAN;
        let [now, then] = predict(&sigma, &map, &before, &after, &SHARP).unwrap();
        assert!((now - 0.1).abs() < 1e-8);
        // The pixel's own box takes a little of the finer contrast.
        assert!((0.5..0.51).contains(&(then / now)), "{then}");
        let unknown = [f32::NAN; 64];
        assert_eq!(predict(&unknown, &map, &before, &after, &SHARP), None);
    }
}
