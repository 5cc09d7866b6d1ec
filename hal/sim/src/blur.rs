//! Separable Gaussian blur of a picture; edge pixels are repeated beyond the border.

use rayon::prelude::*;

/// Blurs `picture` of `width` columns with a Gaussian of σ `sigma` pixels; σ = 0 leaves it
/// unchanged.
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
}
