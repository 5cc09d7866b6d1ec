//! The pattern of least error for the light, the noise and the contrast that a part has.
//!
//! **Idea.** The height's noise is proportional to 1 / (g · M(g)), frequency times contrast. So
//! each part of the surface gets the frequency with the least error, instead of a fixed image
//! pitch, but none so fine that its modulation could not be trusted. Needs one preliminary
//! measurement with vertical fringes.
//!
//! **Equation.** Among the frequencies whose modulation B₀ · M(g) can be trusted under the noise,
//! where B₀ is the modulation without blur, the one that maximises
//!
//! ```text
//! g · M(g) / √(n² + R(g)²/2)
//! ```
//!
//! n is the noise of the phase where M = 1, and R what the squares of the projector's pixels add
//! ([`replicas`]), both in radian.

use super::blur::{Blur, FringeOptics, contrast, replicas};
use super::field::{Field, balanced_rows};
use super::{AdaptError, ProjectorMap};
use crate::math::around;
use crate::pattern::PhaseFunction;
use crate::phase::{Decoder, LeastModulation, NOISE_OVER_LEAST};
use crate::pipeline::{Done, PhaseMap, Progress};
use alloc::vec;
use alloc::vec::Vec;

/// Default of the smallest pitch in projector pixels. Finer fringes gain little, and a part reaches
/// fewer of them within its tolerance.
pub const PROJECTOR_PITCH: f64 = 5.0;
/// Default of the smallest pitch in camera pixels: the maximum of g · M(g) with the box of the
/// pixel alone.
pub const IMAGE_PITCH: f64 = 2.2;
/// Largest pitch of a pattern, projector pixels. A part that is too steep for this pitch is not
/// resolved with any.
const MAX_PITCH: f64 = 128.0;
/// Neighbours that differ by more than this many projector pixels per camera pixel lie on different
/// surfaces.
pub const MAX_SLOPE: f64 = 6.0;
/// Cells without a camera pixel take the frequency of a neighbour up to this far away, projector
/// pixels.
const FILL: usize = 8;
/// Reach of the minimum filter to each side, projector pixels.
const MINIMUM_REACH: usize = 1;
/// σ of the smoothing after the minimum filter, along and across the rows, projector pixels. Across
/// the rows it is larger, because rows whose pitches differ shear against each other, and a shear
/// that changes from row to row falsifies the phase where blur mixes them: with 3 px, the rows that
/// pass the tip of the study's cone were off by 30 µm without noise.
const SMOOTHING: [f64; 2] = [3.0, 6.0];
/// Share of the largest worth (the expression that is maximised) that is enough. The maximum is
/// flat: the last 0.2 % would cost 4 % of the contrast.
const ENOUGH: f64 = 0.998;
/// Frequencies that are tried between the coarsest and the finest, in geometric progression.
const STEPS: usize = 160;
/// √(2 / Σ N_i r_i² b_i²) of 12 frames: 7 + 5 of ratios 1 and 4/5 with the brightest waveforms.
const TWELVE_FRAMES: f64 = 0.36;
/// Error of the phase by a response that is not quite linear, radian: less noise than this gains
/// nothing.
const LEAST_NOISE: f64 = 3e-3;
/// Margin of the modulation of sines over the least that is trusted, in σ of a sample. With the
/// waveforms of 3 to 9 shifts the modulation is at least 15 % larger, and then three times its own
/// σ above the least.
const SAFE: f64 = 1.0;
/// Reach to each side of the median filter of the light, camera pixels. It removes pixels that are
/// lit in part, along shadows and silhouettes: they would ask for a narrow line of coarse fringes,
/// which would shear the rows beside it.
const LIGHT_REACH: usize = 5;
/// Largest contrast that is asked for: where the light would need more, a coarser pitch does not
/// help.
const MOST_CONTRAST: f64 = 0.9;

/// The light of each camera pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Modulation of fringes that nothing blurs, counts; not positive or NaN where it is not known.
    pub modulation: Vec<f64>,
    /// σ of a sample, counts.
    pub noise: f64,
    /// The least modulation that is trusted, counts: the decoder's, or that which follows from the
    /// noise if it is larger.
    pub least: f64,
}

impl Light {
    /// The light of a preliminary measurement with fringes of `g` turns per projector pixel, on
    /// slopes by [`ProjectorMap::slopes`]. `noise` is σ of a sample in counts, if it is known.
    pub fn of(
        phases: &PhaseMap,
        decoder: &Decoder,
        slopes: &[[f64; 2]],
        g: f64,
        blur: &Blur,
        noise: Option<f64>,
        progress: Progress<'_>,
    ) -> Self {
        let full_scale = decoder.full_scale();
        let pixels = phases.modulation.iter().zip(slopes);
        let modulation: Vec<f64> = pixels
            .map(|(modulation, [ju, jv])| {
                modulation.counts(full_scale) / contrast(blur, g, [g * ju, g * jv])
            })
            .collect();
        let of_noise =
            |noise| LeastModulation::of_noise(noise, decoder.bit_depth()).counts(full_scale);
        let trusted = decoder.least_modulation().counts(full_scale);
        let least = trusted.max(noise.map_or(0.0, of_noise));
        Self {
            modulation: medians(&modulation, phases.width, progress),
            noise: noise.unwrap_or(NOISE_OVER_LEAST * least),
            least,
        }
    }

    /// What one pixel asks of its fringes.
    fn asked(&self, pixel: usize) -> Asked {
        let modulation = self.modulation[pixel].max(self.least);
        let needed = self.least + SAFE * self.noise;
        Asked {
            contrast: (needed / modulation).min(MOST_CONTRAST),
            noise: (TWELVE_FRAMES * self.noise / modulation).max(LEAST_NOISE),
        }
    }
}

/// The median of the positive values around each pixel; what is not positive stays as it is.
fn medians(values: &[f64], width: usize, progress: Progress<'_>) -> Vec<f64> {
    let rows = values.len() / width.max(1);
    let done = Done::new(progress, rows);
    let mut medians = values.to_vec();
    crate::pipeline::for_each_row(&mut medians, width, |v, row| {
        let mut window = Vec::new();
        for (u, value) in row
            .iter_mut()
            .enumerate()
            .filter(|(_, value)| **value > 0.0)
        {
            window.clear();
            let columns = around(u, LIGHT_REACH, width);
            for v in around(v, LIGHT_REACH, rows) {
                let near = &values[v * width..][columns.clone()];
                window.extend(near.iter().filter(|value| **value > 0.0));
            }
            let middle = window.len() / 2;
            *value = *window.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        done.row();
    });
    medians
}

/// What a pixel asks of its fringes.
#[derive(Clone, Copy, Debug)]
struct Asked {
    /// Least contrast.
    contrast: f64,
    /// Noise of the phase with a contrast of 1, radian.
    noise: f64,
}

/// The frequency for a surface that the camera sees with slope J: the lowest whose worth reaches
/// 99.8 % of the maximum within both limits of pitch, or the highest with the contrast that is
/// asked for, if that is lower. `near` are the steps of a similar pixel, from which the search
/// begins, and become those of this one.
fn best_frequency(
    optics: &FringeOptics,
    [ju, jv]: [f64; 2],
    asked: Asked,
    near: &mut [usize; 3],
) -> f64 {
    let blur = &optics.blur;
    let slope = libm::sqrt(ju * ju + jv * jv);
    let coarsest = 1.0 / MAX_PITCH;
    let finest = (1.0 / optics.projector_pitch)
        .min(1.0 / (optics.image_pitch * slope.max(1e-6)))
        .max(coarsest);
    let ratio = libm::pow(finest / coarsest, 1.0 / STEPS as f64);
    let frequency = |i: usize| coarsest * libm::pow(ratio, i as f64);
    let kept = |g: f64| contrast(blur, g, [g * ju, g * jv]);
    let worth = |i: usize| {
        let g = frequency(i);
        let squares = replicas(blur, g, [ju, jv]);
        g * kept(g) / libm::sqrt(asked.noise * asked.noise + squares * squares / 2.0)
    };
    let [resolved, peak, least] = near;
    // Contrast falls with g.
    *resolved = first(STEPS, *resolved, |i| {
        kept(frequency(i + 1)) < asked.contrast
    });
    // The worth has a single peak.
    *peak = first(*resolved, *peak, |i| worth(i) >= worth(i + 1));
    let enough = ENOUGH * worth(*peak);
    *least = first(*peak, *least, |i| worth(i) >= enough);
    frequency(*least)
}

/// The first of 0…`last` for which `holds` is true, given that it is true for all numbers after the
/// first; `last` if it is true for none before. The search begins at `near`, with steps that double
/// until the first number lies between two of them.
fn first(last: usize, near: usize, holds: impl Fn(usize) -> bool) -> usize {
    let near = near.min(last);
    let (mut low, mut high) = (0, last);
    let mut step = 1;
    if near < last && !holds(near) {
        low = near + 1;
        while low + step <= high && !holds(low + step - 1) {
            (low, step) = (low + step, 2 * step);
        }
        high = high.min(low + step - 1);
    } else {
        high = near;
        while high >= low + step && holds(high - step) {
            (high, step) = (high - step, 2 * step);
        }
        low = (high + 1).saturating_sub(step);
    }
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

/// RMS of σ_z in mm under the phase function `before`, and predicted for the same levels and shifts
/// of `after`: σ_z of each pixel is proportional to 1 / (g · M(g)). `sigma` is σ_z of each camera
/// pixel of `map` under `before`; `None` if no pixel has one.
pub fn predict(
    sigma: &[f32],
    map: &ProjectorMap,
    before: &PhaseFunction,
    after: &PhaseFunction,
    blur: &Blur,
) -> Option<[f64; 2]> {
    let slopes = map.slopes(MAX_SLOPE);
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for ((sigma, [xi, eta]), [ju, jv]) in sigma.iter().zip(&map.points).zip(slopes) {
        let worth = |function: &PhaseFunction| {
            let g = function.at(xi + 0.5, *eta) - function.at(xi - 0.5, *eta);
            g * contrast(blur, g, [g * ju, g * jv])
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

/// The share of the time of [`adapt`] after which the frequencies are found.
const FOUND: f64 = 0.8;

/// Makes the phase function for a part, over a projector of `columns` × `rows` pixels. `progress`
/// gets the share that is done.
///
/// # Errors
/// If no pixel of the part is known.
pub fn adapt(
    map: &ProjectorMap,
    columns: usize,
    rows: usize,
    optics: &FringeOptics,
    light: &Light,
    progress: Progress<'_>,
) -> Result<PhaseFunction, AdaptError> {
    let slopes = map.slopes(MAX_SLOPE);
    let found = |share| progress(FOUND * share);
    let frequencies = frequencies(&slopes, map.width, (optics, light), &found);
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
    progress((1.0 + FOUND) / 2.0);
    field.fill_columns();
    field.fill_rows(1.0 / optics.projector_pitch);
    let field = field.minimum(MINIMUM_REACH).smoothed(SMOOTHING);
    PhaseFunction::sampled(columns, rows, balanced_rows(&field, &seen)).map_err(AdaptError::Pattern)
}

fn frequencies(
    slopes: &[[f64; 2]],
    width: usize,
    (optics, light): (&FringeOptics, &Light),
    progress: Progress<'_>,
) -> Vec<f64> {
    let mut frequencies = vec![f64::NAN; slopes.len()];
    let done = Done::new(progress, slopes.len() / width.max(1));
    crate::pipeline::for_each_row(&mut frequencies, width, |v, row| {
        let mut near = [STEPS / 2; 3];
        for (u, g) in row.iter_mut().enumerate() {
            let pixel = v * width + u;
            if !slopes[pixel][0].is_nan() {
                *g = best_frequency(optics, slopes[pixel], light.asked(pixel), &mut near);
            }
        }
        done.row();
    });
    frequencies
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: FringeOptics = FringeOptics {
        blur: Blur {
            projector: 0.0,
            camera: 0.0,
        },
        projector_pitch: 2.0,
        image_pitch: 1.5,
    };
    /// More noise than the squares of the projector's pixels add, and light enough.
    const NOISY: Asked = Asked {
        contrast: 0.1,
        noise: 10.0,
    };

    /// The best frequency, searched for from the coarsest.
    fn alone(optics: &FringeOptics, slope: [f64; 2], asked: Asked) -> f64 {
        best_frequency(optics, slope, asked, &mut [0; 3])
    }

    fn blurred(projector: f64, camera: f64) -> FringeOptics {
        let blur = Blur { projector, camera };
        FringeOptics { blur, ..FREE }
    }

    #[test]
    fn the_pitch_under_gaussian_blur_is_a_little_over_two_pi_sigma() {
        // A face-on surface seen very finely: only the projector matters. x·exp(−x²/2) has its
        // maximum at x = 1 (12.57 px; 12.8 px with square pixels) and 99.8 % of it at x = 0.96.
        let pitch = 1.0 / alone(&blurred(2.0, 0.0), [0.01, 0.0], NOISY);
        assert!((12.9..13.9).contains(&pitch), "{pitch}");
    }

    #[test]
    fn the_image_pitch_for_the_pixel_box_alone_is_a_little_over_two_pixels() {
        // Steep: 8 projector pixels per camera pixel, so that only the camera limits.
        // sin(π/p) has its maximum at p = 2, and 99.8 % of it at 2.08.
        let pitch = 1.0 / (alone(&FREE, [8.0, 0.0], NOISY) * 8.0);
        assert!((2.05..2.12).contains(&pitch), "{pitch}");
    }

    #[test]
    fn fringes_are_as_fine_as_their_contrast_allows() {
        let optics = blurred(1.0, 0.5);
        for slope in [[0.9, 0.0], [3.0, 0.5]] {
            for wanted in [0.3, 0.5, 0.7, 0.9] {
                let asked = Asked {
                    contrast: wanted,
                    ..NOISY
                };
                let g = alone(&optics, slope, asked);
                let found = contrast(&optics.blur, g, slope.map(|j| g * j));
                let free = alone(&optics, slope, NOISY);
                assert!(found >= wanted, "{found} for {wanted}");
                assert!(found < 1.05 * wanted || g == free, "{found} for {wanted}");
            }
        }
    }

    #[test]
    fn dark_pixels_ask_for_contrast_and_bright_ones_for_none() {
        let light = Light {
            modulation: vec![120.0, 30.0, 10.0, f64::NAN],
            noise: 3.0,
            least: 16.0,
        };
        let asked: Vec<f64> = (0..4).map(|pixel| light.asked(pixel).contrast).collect();
        assert!((asked[0] - 19.0 / 120.0).abs() < 1e-9, "{asked:?}");
        assert!((asked[1] - 19.0 / 30.0).abs() < 1e-9, "{asked:?}");
        assert_eq!(asked[2..], [MOST_CONTRAST; 2]);
    }

    #[test]
    fn the_squares_of_a_sharp_projector_ask_for_a_longer_pitch_where_noise_is_low() {
        let pitch = |blur: f64, noise: f64| {
            let asked = Asked { noise, ..NOISY };
            1.0 / alone(&blurred(blur, 0.0), [0.9, 0.0], asked)
        };
        for blur in [0.25, 0.5] {
            assert!(pitch(blur, 0.003) > 1.2 * pitch(blur, 0.1), "{blur}");
        }
        assert!(pitch(0.25, 0.013) > pitch(0.5, 0.013));
    }

    #[test]
    fn the_best_frequency_is_the_one_that_trying_all_of_them_finds() {
        // Each search begins where the one before ended.
        let mut near = [0; 3];
        for at in 0..6000 {
            let optics = FringeOptics {
                projector_pitch: 4.0 + f64::from(at % 3),
                image_pitch: IMAGE_PITCH,
                ..blurred(
                    [0.0, 0.25, 0.5, 0.7, 2.0, 5.0][at as usize % 6],
                    f64::from(at % 5) / 2.0,
                )
            };
            let asked = Asked {
                contrast: f64::from(at % 10) / 10.0,
                noise: [0.003, 0.01, 0.03, 0.1][at as usize % 4],
            };
            let angle = f64::from(at % 400);
            let slope = 0.01 * libm::pow(1.02, angle);
            let [ju, jv] = [slope * libm::cos(angle), slope * libm::sin(angle)];
            let coarsest = 1.0 / MAX_PITCH;
            let finest = (1.0 / optics.projector_pitch)
                .min(1.0 / (IMAGE_PITCH * libm::hypot(ju, jv)))
                .max(coarsest);
            let ratio = libm::pow(finest / coarsest, 1.0 / STEPS as f64);
            let kept = |g: f64| contrast(&optics.blur, g, [g * ju, g * jv]);
            let all = || {
                let all = (0..=STEPS).map(|i| coarsest * libm::pow(ratio, i as f64));
                all.filter(|&g| g == coarsest || kept(g) >= asked.contrast)
            };
            let worth = |g: f64| {
                let squares = replicas(&optics.blur, g, [ju, jv]);
                g * kept(g) / libm::sqrt(asked.noise * asked.noise + squares * squares / 2.0)
            };
            let best = all().map(worth).fold(0.0, f64::max);
            let found = all().find(|&g| worth(g) >= ENOUGH * best).unwrap();
            let searched = best_frequency(&optics, [ju, jv], asked, &mut near);
            assert!(
                (searched / found - 1.0).abs() < 1e-12,
                "{optics:?} {asked:?} {ju} {jv}: {searched} for {found}"
            );
        }
    }

    #[test]
    fn limits_of_pitch_hold() {
        let optics = FringeOptics {
            projector_pitch: 8.0,
            image_pitch: 5.0,
            ..FREE
        };
        for (slope, limit) in [([0.1, 0.0], 0.125), ([3.0, 4.0], 1.0 / 25.0)] {
            let g = alone(&optics, slope, NOISY);
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
        let [now, then] = predict(&sigma, &map, &before, &after, &Blur::default()).unwrap();
        assert!((now - 0.1).abs() < 1e-8);
        // The pixel's own box takes a little of the finer contrast.
        assert!((0.5..0.51).contains(&(then / now)), "{then}");
        let unknown = [f32::NAN; 64];
        assert_eq!(
            predict(&unknown, &map, &before, &after, &Blur::default()),
            None
        );
    }
}
