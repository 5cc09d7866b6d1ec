//! Colours of a height.

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// Where nothing was resolved.
pub const UNRESOLVED: Rgb = [38, 40, 46];

/// The colour of a share 0…1 of the scale: viridis, which is even in lightness and readable without
/// colour vision. Fit of degree 6 by M. Zucker (CC0).
pub fn viridis(share: f64) -> Rgb {
    const RED: [f64; 7] = [
        0.27772733,
        0.10509304,
        -0.33086183,
        -4.6342305,
        6.22827,
        4.776385,
        -5.435456,
    ];
    const GREEN: [f64; 7] = [
        0.005407345,
        1.4046135,
        0.21484756,
        -5.799101,
        14.179933,
        -13.745145,
        4.6458526,
    ];
    const BLUE: [f64; 7] = [
        0.3340998, 1.3845901, 0.09509516, -19.33244, 56.690552, -65.35303, 26.312435,
    ];
    let t = share.clamp(0.0, 1.0);
    [RED, GREEN, BLUE].map(|channel| {
        let value = channel.iter().rev().fold(0.0, |sum, c| sum * t + c);
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::viridis;

    #[test]
    fn lightness_rises_over_the_whole_scale() {
        let lightness = |share: f64| {
            let [r, g, b] = viridis(share).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let steps: Vec<f64> = (0..=32).map(|i| lightness(f64::from(i) / 32.0)).collect();
        assert!(
            steps.windows(2).all(|pair| pair[1] > pair[0] - 0.5),
            "{steps:?}"
        );
        assert!(steps[32] - steps[0] > 150.0);
    }
}
