//! Demodulation by N shifts, directly from the equations.
//!
//! I_k = A + B sin 2π(φ + s_k); S = Σ I_k cos 2πs_k, C = Σ I_k sin 2πs_k, φ = atan2(S, C) / 2π,
//! B = (2/N) √(S² + C²), for N shifts that divide the turn evenly.

use std::f64::consts::TAU;

/// The demodulated samples of one level at one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Demodulated {
    /// φ in turns, −½ … ½.
    pub turns: f64,
    /// B in counts.
    pub modulation: f64,
    /// A, the mean of the samples, counts.
    pub offset: f64,
    /// The largest sample, counts.
    pub brightest: f64,
}

/// Demodulates one pixel; `samples[k]` was taken at `shifts[k]` turns.
pub fn demodulate(samples: &[f64], shifts: &[f64]) -> Demodulated {
    let mut s = 0.0;
    let mut c = 0.0;
    let mut sum = 0.0;
    let mut brightest = 0.0_f64;
    for (sample, shift) in samples.iter().zip(shifts) {
        s += sample * (TAU * shift).cos();
        c += sample * (TAU * shift).sin();
        sum += sample;
        brightest = brightest.max(*sample);
    }
    Demodulated {
        turns: s.atan2(c) / TAU,
        modulation: 2.0 / samples.len() as f64 * (s * s + c * c).sqrt(),
        offset: sum / samples.len() as f64,
        brightest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_gives_back_its_phase_and_modulation() {
        for count in 3..12 {
            let shifts: Vec<f64> = (0..count)
                .map(|k| 0.3 - f64::from(k) / f64::from(count))
                .collect();
            let samples: Vec<f64> = shifts
                .iter()
                .map(|s| 100.0 + 40.0 * (TAU * (0.2 + s)).sin())
                .collect();
            let found = demodulate(&samples, &shifts);
            assert!((found.turns - 0.2).abs() < 1e-12);
            assert!((found.modulation - 40.0).abs() < 1e-10);
        }
    }
}
