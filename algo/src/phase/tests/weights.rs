//! The loss of accuracy by averaging dense levels without weighting them by their modulations.

use core::f64::consts::TAU;

/// σ of a mean with weights r² over that with the best weights, r² B², where a blur of σ pixels
/// leaves a modulation of B = exp(−(2πσr/pitch)²/2).
fn loss(ratios: &[f64], blur_px: f64, pitch_px: f64) -> f64 {
    let (mut weights, mut scatter, mut information) = (0.0, 0.0, 0.0);
    for r in ratios {
        let angle = TAU * blur_px * r / pitch_px;
        let modulation = libm::exp(-angle * angle / 2.0);
        // The variance of a level's phase goes with 1/B², that of its D with 1/(r B)².
        weights += r * r;
        scatter += r * r / (modulation * modulation);
        information += r * r * modulation * modulation;
    }
    libm::sqrt(scatter * information) / weights
}

#[test]
fn weights_without_modulations_lose_next_to_nothing() {
    let three = |n: f64| [1.0 - 1.0 / n, 1.0 - 1.0 / (n * n), 1.0];
    let real = [
        loss(&three(6.0), 1.0, 8.0),
        loss(&three(4.0), 1.0, 8.0),
        loss(&[0.8, 1.0], 1.0, 8.0),
    ];
    std::println!("dense levels at a pitch of 8 pixels and a blur of 1: {real:?} of the least σ");
    assert!(real.iter().all(|loss| (1.0..1.01).contains(loss)));
    // A blur that leaves hardly a third of the contrast.
    let worst = loss(&three(4.0), 1.0, 4.2);
    assert!((1.03..1.10).contains(&worst), "{worst}");
}
