//! The projector's grey response: the light of each grey level, as the camera sees it.

use super::pictures::{Lit, greys, pictures};
use hal::error::Error;
use hal::head::Head;

/// Largest decrease of the response that noise can explain, share of white.
const MOST_FALL: f64 = 0.02;

/// The light of grey levels over the lit pixels: 0 is that of black, 1 that of white. `progress`
/// gets the share done.
///
/// # Errors
/// The error of a device.
pub fn lights(
    head: &mut Head,
    settle: u32,
    lit: &Lit,
    levels: &[u8],
    progress: &dyn Fn(f64),
) -> Result<Vec<f64>, Error> {
    let mut lights = Vec::with_capacity(levels.len());
    let patterns = greys(head.projector_size(), levels.iter().copied());
    pictures(head, settle, patterns, &mut |counts| {
        lights.push(lit.share_of_white(lit.mean(&counts)));
        progress(lights.len() as f64 / levels.len() as f64);
    })?;
    Ok(lights)
}

/// The light of all 256 grey levels on a linear scale: 0 for black, 255 for white, non-decreasing.
///
/// Noise is removed by isotonic regression: the result is the non-decreasing sequence nearest to
/// the measured one in least squares (pool adjacent violators: Ayer et al. 1955).
///
/// # Errors
/// The error of a device, or if light falls where grey rises.
pub fn response(
    head: &mut Head,
    settle: u32,
    lit: &Lit,
    progress: &dyn Fn(f64),
) -> Result<[f64; 256], Error> {
    let levels: Vec<u8> = (0..=u8::MAX).collect();
    let raw = lights(head, settle, lit, &levels, progress)?;
    let monotonic = isotonic(&raw);
    let off = |at: &usize| (raw[*at] - monotonic[*at]).abs();
    if let Some(at) = (0..raw.len()).find(|at| !(off(at) <= MOST_FALL)) {
        return Err(Error::unsupported(
            format!("a projector whose light falls where grey rises (near level {at})"),
            "switch off its dynamic contrast and picture improvement",
        ));
    }
    // Black and white may have been pooled with their neighbours.
    let (dark, bright) = (monotonic[0], monotonic[monotonic.len() - 1]);
    let mut linear = [0.0; 256];
    for (out, light) in linear.iter_mut().zip(&monotonic) {
        *out = 255.0 * (light - dark) / (bright - dark);
    }
    Ok(linear)
}

/// The non-decreasing sequence nearest to `values` in least squares.
fn isotonic(values: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::with_capacity(values.len());
    for value in values {
        let mut pool = (*value, 1);
        while let Some((mean, count)) = pools.last().copied().filter(|last| last.0 > pool.0) {
            let all = count + pool.1;
            pool = (
                (mean * count as f64 + pool.0 * pool.1 as f64) / all as f64,
                all,
            );
            pools.pop();
        }
        pools.push(pool);
    }
    let spread = |(mean, count)| std::iter::repeat_n(mean, count);
    pools.into_iter().flat_map(spread).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_falls_is_levelled_to_its_mean_and_what_rises_is_kept() {
        assert_eq!(
            isotonic(&[0.0, 1.0, 3.0, 2.0, 4.0]),
            [0.0, 1.0, 2.5, 2.5, 4.0]
        );
        assert_eq!(isotonic(&[3.0, 2.0, 1.0]), [2.0, 2.0, 2.0]);
        assert_eq!(isotonic(&[1.0, 2.0]), [1.0, 2.0]);
        assert!(isotonic(&[]).is_empty());
    }
}
