//! Whether the light may change at all: what every cycle pays, some 600 pixels of a level.

use super::level::SeenRun;

/// A ripple of so many σ is worth a closer look.
const SUSPECT: f64 = 4.5;
/// Smaller ripples, as shares of the modulation, move heights by less than a few µm.
const LEAST: f64 = 0.004;
/// Runs on one side of the circle, as a share of all: less are chance, more are of a level whose
/// fringes are longer than a run.
const ONE_SIDED: [f64; 2] = [0.08, 0.6];

/// What ripples of the modulation have in common with the harmonics of fringes, 1 and 2.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ripple {
    products: [f64; 4],
    squares: [f64; 4],
    variance: f64,
    count: f64,
    one_sided: usize,
    runs: usize,
}

impl Ripple {
    /// Adds a run.
    pub fn add(&mut self, run: &SeenRun) {
        self.runs += 1;
        if run.is_one_sided() {
            self.one_sided += 1;
            return;
        }
        let ripple = run.ripple();
        let mean = ripple.iter().sum::<f64>() / ripple.len() as f64;
        for (value, [sin, cos]) in ripple.iter().zip(&run.phase) {
            let value = value - mean;
            let waves = [*sin, *cos, 2.0 * sin * cos, cos * cos - sin * sin];
            for (at, wave) in waves.into_iter().enumerate() {
                self.products[at] += value * wave;
                self.squares[at] += wave * wave;
            }
            self.variance += value * value;
            self.count += 1.0;
        }
    }

    fn one_sided(&self) -> f64 {
        self.one_sided as f64 / self.runs.max(1) as f64
    }

    /// Whether fringes are too long to tell.
    pub fn is_mute(&self) -> bool {
        self.one_sided() > ONE_SIDED[1]
    }

    /// Whether it may be more than noise.
    pub fn is_suspect(&self) -> bool {
        if self.is_mute() {
            return false;
        }
        if self.one_sided() > ONE_SIDED[0] {
            return true;
        }
        let variance = self.variance / self.count;
        let mut all = self.products.iter().zip(&self.squares);
        all.any(|(product, square)| {
            let amplitude = product / square;
            let far = amplitude * amplitude * square > SUSPECT * SUSPECT * variance;
            far && amplitude.abs() > LEAST
        })
    }
}
