//! Random numbers of devices, from random words.

/// The sum of the four quarters of a random word, of mean 0 and variance 1. All sums are exact.
pub(super) fn normal(word: u64) -> f32 {
    let quarter = |at: u32| f32::from((word >> (16 * at)) as u16);
    let sum = quarter(0) + quarter(1) + quarter(2) + quarter(3);
    // Each quarter is uniform in 0…65535, of variance (2³² − 1) / 12; √3 / 2¹⁶ = 2.6429e-5.
    (sum - 131_070.0) * 2.642_899_8e-5
}
