//! The blur of lenses: a Gaussian blur of whole pictures, and how the light of a projector's pixel
//! spreads.
//!
//! A projector's pixel is a bright square, which the lens blurs. The light at a point (x, y) of the projector plane is Σ raster(i, j) · k(x − i) · k(y − j), in
//! projector pixels, with k = box ⊗ Gaussian of σ, which is k(d) = F((d + ½) / σ) − F((d − ½) / σ),
//! where F is the cumulative normal distribution. The Gaussian is cut at ± 4 σ and scaled so that
//! the weights of all pixels sum to 1 at every point.
//!
//! F is interpolated linearly in a table. The error of k is below 1e-6 for the interpolation, and
//! below 6.4e-5 of k for the cut
//! (`a_pixels_light_is_the_integral_of_the_gaussian_over_its_square`).

use rayon::prelude::*;

/// The Gaussian is cut at this many σ.
const CUT: f64 = 4.0;
/// Entries of the table per σ. Linear interpolation is off by at most max |F″| / (8 · 256²) = 0.242
/// / 524 288 = 4.6e-7.
const ENTRIES: f64 = 256.0;
/// Up to this σ the weights hold the whole blur.
const WIDEST: f64 = 1.25;
/// For a larger σ, the part of it that the weights hold, so that their number stays small.
const KEPT: f64 = 1.0;

/// Blurs `picture` of `width` columns with a Gaussian of σ `sigma` pixels; edge pixels are repeated
/// beyond the border. σ = 0 leaves it unchanged.
///
/// The kernel reaches to 4 σ and sums to 1. The result is the same for any number of threads.
pub(super) fn gaussian(picture: &mut [f32], width: usize, sigma: f64) {
    if sigma <= 0.0 || picture.is_empty() {
        return;
    }
    let kernel = kernel(sigma);
    let reach = kernel.len() / 2;
    let height = picture.len() / width;
    let mut across = vec![0.0_f32; picture.len()];
    across
        .par_chunks_mut(width)
        .zip(picture.par_chunks(width))
        .for_each(|(to, from)| {
            let [first, last] =
                [from[0], from[width - 1]].map(|edge| std::iter::repeat_n(edge, reach));
            let longer: Vec<f32> = first.chain(from.iter().copied()).chain(last).collect();
            weigh(&kernel, to, |d| &longer[d..]);
        });
    picture
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, to)| {
            let inside = |d: usize| (y + d).saturating_sub(reach).min(height - 1);
            weigh(&kernel, to, |d| &across[inside(d) * width..]);
        });
}

/// Writes Σ kernel[d] · row(d), pixel by pixel.
fn weigh<'a>(kernel: &[f32], to: &mut [f32], row: impl Fn(usize) -> &'a [f32]) {
    to.fill(0.0);
    for (d, weight) in kernel.iter().enumerate() {
        let pixels = to.iter_mut().zip(row(d));
        pixels.for_each(|(to, from)| *to += weight * from);
    }
}

fn kernel(sigma: f64) -> Vec<f32> {
    let reach = (4.0 * sigma).ceil() as i32;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|d| (-0.5 * (f64::from(d) / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| (weight / sum) as f32).collect()
}

/// The weights of a projector's pixels for the light at a point, along one axis.
pub(super) struct Spread {
    /// 1 / σ, finite also for σ = 0.
    per_sigma: f64,
    reach: f64,
    /// F at −4, −4 + 1/256, … 4.
    cumulative: Vec<f32>,
}

/// Splits a projector's blur of `sigma`: the σ of its [`Spread`], and that of a blur of the raster
/// before it. The second is 0 up to σ = 1.25.
///
/// Beyond, the variances of both add up to σ². A raster that is blurred beforehand still has the
/// replicas of its frequencies f at 1 − f, which light has not, but the spread's own Gaussian of
/// σ = 1 leaves 2e-6 of them at a pitch of 6 pixels, and 5e-5 at 4.
pub(super) fn split(sigma: f64) -> (f64, f64) {
    if sigma <= WIDEST {
        (sigma, 0.0)
    } else {
        (KEPT, (sigma * sigma - KEPT * KEPT).sqrt())
    }
}

impl Spread {
    /// The spread of a lens whose Gaussian blur has this σ, projector pixels.
    pub fn new(sigma: f64) -> Self {
        let normal = |t: f64| 0.5 * libm::erfc(-t / std::f64::consts::SQRT_2);
        let lost = normal(-CUT);
        let entries = (2.0 * CUT * ENTRIES) as usize;
        let at = |index: usize| (normal(index as f64 / ENTRIES - CUT) - lost) / (1.0 - 2.0 * lost);
        Self {
            per_sigma: 1.0 / sigma.max(1e-9),
            reach: 0.5 + CUT * sigma,
            cumulative: (0..=entries).map(|index| at(index) as f32).collect(),
        }
    }

    /// The pixels from whose squares light reaches `place`: the first, and the one after the last.
    pub fn pixels(&self, place: f64) -> [i64; 2] {
        let (first, last) = (place - self.reach, place + self.reach);
        [first.ceil() as i64, last.floor() as i64 + 1]
    }

    /// The weights at `place` of the pixels `first`, `first` + 1, …
    pub fn weights(&self, place: f64, first: i64, weights: &mut [f32]) {
        let mut before = self.cumulative(place - first as f64 + 0.5);
        for (pixel, weight) in (first..).zip(weights) {
            let after = self.cumulative(place - pixel as f64 - 0.5);
            *weight = before - after;
            before = after;
        }
    }

    /// The share of a blurred edge at 0 that is below `place`.
    fn cumulative(&self, place: f64) -> f32 {
        let end = self.cumulative.len() - 1;
        let at = ((place * self.per_sigma + CUT) * ENTRIES).clamp(0.0, end as f64);
        let index = (at as usize).min(end - 1);
        let [low, high] = [self.cumulative[index], self.cumulative[index + 1]];
        low + (high - low) * (at - index as f64) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_keeps_a_flat_picture_and_the_sum_of_a_point() {
        let mut flat = vec![3.0; 20 * 30];
        gaussian(&mut flat, 20, 1.3);
        assert!(flat.iter().all(|v| (v - 3.0).abs() < 1e-5));
        let mut point = vec![0.0; 41 * 41];
        point[20 * 41 + 20] = 1.0;
        gaussian(&mut point, 41, 2.0);
        assert!((point.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let second: f32 = (0..41)
            .map(|x| point[20 * 41 + x] * (x as f32 - 20.0).powi(2))
            .sum::<f32>()
            / (0..41).map(|x| point[20 * 41 + x]).sum::<f32>();
        assert!((second - 4.0).abs() < 0.05, "variance {second}, σ² is 4");
    }

    #[test]
    fn a_blur_of_no_width_changes_nothing() {
        let mut picture = vec![1.0, 2.0, 3.0, 4.0];
        gaussian(&mut picture, 2, 0.0);
        assert_eq!(picture, [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn a_pixels_light_is_the_integral_of_the_gaussian_over_its_square() {
        for sigma in [0.1, 0.5, 1.0, 1.25] {
            let spread = Spread::new(sigma);
            for step in 0..=400 {
                let place = f64::from(step) / 400.0 * (2.0 * spread.reach + 2.0) - 1.0;
                let mut weights = [0.0; 16];
                spread.weights(place, -1, &mut weights);
                let sum: f32 = weights.iter().sum();
                let [first, end] = spread.pixels(place);
                assert!(first < -1 || end > 15 || (sum - 1.0).abs() < 1e-6, "{sum}");
                // The midpoint rule; its error is below 1e-6 with 4000 steps.
                let (steps, root) = (4000, (2.0 * std::f64::consts::PI).sqrt() * sigma);
                let light = (0..steps).map(|at| {
                    let from = (f64::from(at) + 0.5) / f64::from(steps) - 0.5;
                    (-0.5 * ((place - 3.0 - from) / sigma).powi(2)).exp() / root
                });
                let integral = light.sum::<f64>() / f64::from(steps);
                let off = f64::from(weights[4]) - integral;
                assert!(
                    off.abs() < 6.5e-5,
                    "σ {sigma}, {place}: {} is off by {off}",
                    weights[4]
                );
            }
        }
    }

    #[test]
    fn pixels_beyond_the_reach_have_no_weight_and_sharp_ones_are_squares() {
        let spread = Spread::new(0.5);
        let [first, end] = spread.pixels(7.3);
        assert_eq!([first, end], [5, 10]);
        let mut weights = [0.0; 9];
        spread.weights(7.3, 3, &mut weights);
        for (pixel, weight) in (3..).zip(weights) {
            assert_eq!(weight > 0.0, (first..end).contains(&pixel), "{weights:?}");
        }
        let mut sharp = [0.0; 3];
        Spread::new(0.0).weights(7.3, 6, &mut sharp);
        assert_eq!(sharp, [0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_wide_blur_keeps_its_variance() {
        assert_eq!(split(1.25), (1.25, 0.0));
        let (kept, before) = split(1.6);
        assert!((kept * kept + before * before - 2.56_f64).abs() < 1e-12);
    }
}
