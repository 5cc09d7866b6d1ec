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

/// Demodulates one pixel without its samples at full scale, `full` counts: by least squares over the
/// longest run of whole ones, of equally long runs over the one that begins with the smallest shift. The modulation is
/// that of a pixel with all samples whose phase is as uncertain. None with fewer than three.
pub fn demodulate_whole(samples: &[f64], shifts: &[f64], full: f64) -> Option<Demodulated> {
    let count = samples.len();
    let turns = |k: &usize| (shifts[*k] + 1e-9).rem_euclid(1.0);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| turns(a).total_cmp(&turns(b)));
    let mut run: Vec<usize> = Vec::new();
    for first in 0..count {
        if samples[order[(first + count - 1) % count]] < full {
            continue;
        }
        let from = order.iter().cycle().skip(first).take(count);
        let whole: Vec<usize> = from.copied().take_while(|&k| samples[k] < full).collect();
        if whole.len() > run.len() {
            run = whole;
        }
    }
    if run.len() < 3 {
        return None;
    }
    // Means over the run are taken out of both waves: A drops out.
    let wave = |of: fn(f64) -> f64| -> Vec<f64> {
        let all: Vec<f64> = run.iter().map(|&k| of(TAU * shifts[k])).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        all.iter().map(|value| value - mean).collect()
    };
    let (cos, sin) = (wave(f64::cos), wave(f64::sin));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let light: Vec<f64> = run.iter().map(|&k| samples[k]).collect();
    let (cc, cs, ss) = (dot(&cos, &cos), dot(&cos, &sin), dot(&sin, &sin));
    let (ic, is) = (dot(&light, &cos), dot(&light, &sin));
    let determinant = cc * ss - cs * cs;
    let a = (ss * ic - cs * is) / determinant;
    let b = (cc * is - cs * ic) / determinant;
    let power = a * a + b * b;
    // The variance of b da − a db, of samples of variance 1.
    let variance = (b * b * ss + 2.0 * a * b * cs + a * a * cc) / determinant / power;
    let plain = demodulate(samples, shifts);
    Some(Demodulated {
        turns: a.atan2(b) / TAU,
        modulation: (power * 2.0 / (count as f64 * variance)).sqrt(),
        brightest: 0.0,
        ..plain
    })
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

    #[test]
    fn clipped_samples_are_not_needed() {
        for count in 5..12 {
            let shifts: Vec<f64> = (0..count)
                .map(|k| f64::from(k) / f64::from(count))
                .collect();
            for turns in [-0.4, -0.1, 0.2, 0.45] {
                let light = |s: &f64| (100.0 + 90.0 * (TAU * (turns + s)).sin()).min(160.0);
                let samples: Vec<f64> = shifts.iter().map(light).collect();
                let found = demodulate_whole(&samples, &shifts, 160.0).unwrap();
                assert!((found.turns - turns).abs() < 1e-10);
                assert!(found.modulation < 90.0);
            }
        }
    }
}
