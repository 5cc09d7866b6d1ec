//! The noise of one sample, estimated from the redundancy of levels with 4 or more shifts.

use super::map_rows;
use crate::frame::{FrameView, Samples};
use crate::pattern::{Level, Sequence};
use crate::phase::Trust;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// σ_I, the noise of one sample in counts; `None` if no level has 4 or more shifts or no
/// pixel is resolved.
///
/// A level of N shifts has N − 3 degrees of freedom beside offset, modulation and phase:
/// Σ I² − (ΣI)²/N − (2/N)(S² + C²) has the expectation (N − 3) σ_I²; for N = 4 it is
/// (I₀ + I₂ − I₁ − I₃)²/4. Averaged over all resolved pixels and all such levels.
pub fn sample_noise(sequence: &Sequence, frames: &[FrameView<'_>], trust: &[Trust]) -> Option<f64> {
    let levels: Vec<Fit> = sequence
        .levels()
        .iter()
        .filter(|level| level.shifts() >= 4)
        .map(Fit::new)
        .collect();
    let width = frames.first()?.width();
    let rows = map_rows(frames[0].height(), |v| {
        let rows: Vec<Samples<'_>> = frames.iter().map(|frame| frame.row(v)).collect();
        let (mut squares, mut freedom) = (0.0, 0.0);
        for u in (0..width).filter(|u| trust[v * width + u] == Trust::Resolved) {
            for level in &levels {
                squares += level.residual_square(&rows, u);
                freedom += (level.taps.len() - 3) as f64;
            }
        }
        (squares, freedom)
    });
    // Summed in the order of the rows, so that the result does not depend on the number of threads.
    let (squares, freedom) = rows
        .into_iter()
        .fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    (freedom > 0.0).then(|| libm::sqrt(squares / freedom))
}

/// A level's frames with cosine and sine of their shifts.
struct Fit {
    taps: Vec<(usize, f64, f64)>,
}

impl Fit {
    fn new(level: &Level) -> Self {
        let shifts = level.shifts();
        let taps = (0..shifts)
            .map(|k| {
                let angle = TAU * (level.start + k as f64 / shifts as f64);
                let frame = usize::from(level.frames[k]);
                (frame, libm::cos(angle), libm::sin(angle))
            })
            .collect();
        Self { taps }
    }

    /// Σ of the squared deviations of pixel `u` from its fitted sine, in counts².
    fn residual_square(&self, rows: &[Samples<'_>], u: usize) -> f64 {
        let shifts = self.taps.len() as f64;
        let (mut sum, mut squares, mut s, mut c) = (0.0, 0.0, 0.0, 0.0);
        for &(frame, cos, sin) in &self.taps {
            let count = match rows[frame] {
                Samples::Eight(row) => f64::from(row[u]),
                Samples::Sixteen(row) => f64::from(row[u]),
            };
            sum += count;
            squares += count * count;
            s += count * cos;
            c += count * sin;
        }
        (squares - sum * sum / shifts - 2.0 / shifts * (s * s + c * c)).max(0.0)
    }
}
