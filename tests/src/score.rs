//! Comparing measured heights with the truth (docs/measurement.md, *Which pixels count*).

/// |e| above this is a gross error, mm.
const GROSS_MM: f64 = 1.0;

/// Errors of heights, e = z − truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Number of pixels that were compared.
    pub scored: usize,
    /// RMS without gross errors, mm.
    pub rms_mm: f64,
    /// Mean without gross errors, mm.
    pub bias_mm: f64,
    /// Median of |e|, mm.
    pub median_mm: f64,
    /// 99 % quantile of |e|, mm.
    pub p99_mm: f64,
    /// Number of gross errors.
    pub gross: usize,
}

/// Scores `heights` (NaN = unresolved) over the pixels of class 2.
pub fn score(heights: &[f32], truth: &[f32], class: &[u8]) -> Score {
    let mut errors = Vec::new();
    for pixel in 0..heights.len() {
        let error = f64::from(heights[pixel]) - f64::from(truth[pixel]);
        if class[pixel] == 2 && !error.is_nan() {
            errors.push(error);
        }
    }
    let fine: Vec<f64> = errors
        .iter()
        .copied()
        .filter(|error| error.abs() <= GROSS_MM)
        .collect();
    let count = fine.len() as f64;
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let quantile = |share: f64| sizes[((sizes.len() - 1) as f64 * share).round() as usize];
    Score {
        scored: errors.len(),
        rms_mm: rms(&fine),
        bias_mm: fine.iter().sum::<f64>() / count,
        median_mm: quantile(0.5),
        p99_mm: quantile(0.99),
        gross: errors.len() - fine.len(),
    }
}

/// √(mean of squares).
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}
