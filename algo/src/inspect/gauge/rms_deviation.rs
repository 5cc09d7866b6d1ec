//! The root of the mean square of the deviations from golden.

use super::extreme::motion;
use super::kind::*;

kind! {
    /// The root of the mean square of the cells' deviations from golden along its normal, mm.
    RmsDeviation {
        /// Side of the cells, pixels.
        smoothing_px: usize = Domain::Pixels { odd: false },
    }
}

impl Kind for RmsDeviation {
    fn facts(&self) -> Facts {
        Facts {
            words: "over {smoothing_px} px",
            compares: true,
            never_negative: true,
            ..Facts::new(Basis::Cells(self.smoothing_px), SURFACE)
        }
    }

    /// Root of the mean square of the deviations, mm. Var(mean d²) = (4σ² Σd² − 2nσ⁴) / n² + gᵀ C
    /// g: the scatter of d² about fixed true deviations, whose squares are estimated by d² − σ²,
    /// and the error of the motion, g = Σ 2dᵢ jᵢ / n.
    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let (cells, sigma) = (of.cells(), of.sigma);
        if cells.is_empty() {
            return None;
        }
        let count = cells.len() as f64;
        let (mut squares, mut g) = (0.0, [0.0; 6]);
        for cell in cells {
            squares += cell.deviation * cell.deviation;
            for (sum, value) in g.iter_mut().zip(cell.taught.jacobian) {
                *sum += 2.0 * cell.deviation * value / count;
            }
        }
        let variance = sigma * sigma;
        // At least what noise alone gives.
        let least = 2.0 * count * variance * variance;
        let own = (4.0 * variance * squares - least).max(least) / (count * count);
        let value = libm::sqrt(squares / count);
        let slope = 2.0 * value.max(sigma).max(f64::MIN_POSITIVE);
        Some(FoundValue {
            value,
            pixels: own / (slope * slope),
            motion: motion(&g, of.placed) / (slope * slope),
            lever: 1.0,
            unknown: 0.0,
        })
    }
}
