//! The median of some numbers.

/// The median; of an even number of values the mean of the two in the middle, `None` without
/// values.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.len() / 2;
    let middle = values.get(upper.saturating_sub(1 - values.len() % 2)..=upper)?;
    Some(middle.iter().sum::<f64>() / middle.len() as f64)
}
