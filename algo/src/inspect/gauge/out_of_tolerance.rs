//! The share of a region that deviates from golden by more than a tolerance.

use super::extreme::{ExtremeOfNoise, below, motion};
use super::kind::*;
use crate::math::normal_density;

/// Cells further than this many σ from the tolerance lie on the same side of it in every
/// measurement.
const SURE: f64 = 8.0;
/// Where all cells are counted, one that lies more than this many scatters off the mean belongs to
/// the rim of a defect: by noise alone one cell in 2000 does.
const RIM: f64 = 3.5;

kind! {
    /// The share of the cells that deviate from golden along its normal by more than a tolerance.
    OutOfTolerance {
        /// Side of the cells, pixels.
        smoothing_px: usize = Domain::Pixels { odd: false },
        /// The tolerance, mm.
        tolerance_mm: f64 = Domain::Length { positive: true },
    }
}

impl Kind for OutOfTolerance {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Share,
            words: "of {tolerance_mm} mm over {smoothing_px} px",
            compares: true,
            noise_limit: Some(self.tolerance_mm),
            ..Facts::new(Basis::Cells(self.smoothing_px), SURFACE)
        }
    }

    /// Share of the cells that deviate by more than `tolerance` mm. A cell of true deviation m lies
    /// outside with p = Q((T − m)/σ) + Q((T + m)/σ), Q the upper tail of the normal distribution,
    /// so σ² = Σ p(1 − p) / n² + gᵀ C g: the error of the motion moves all cells together, g = Σ p′
    /// j / n. True deviations are estimated by `ExtremeOfNoise`; the cells of the rim of a defect, whose
    /// true deviations scatter more than those of the rest, by an estimate of their own.
    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let (cells, sigma, tolerance) = (of.cells(), of.sigma, self.tolerance_mm);
        let (columns, room) = (of.columns, of.room);
        if cells.is_empty() {
            return None;
        }
        let count = cells.len() as f64;
        let sizes = cells.iter().map(|cell| libm::fabs(cell.deviation));
        let outside = sizes.filter(|size| *size > tolerance).count() as f64;
        let drawn = ExtremeOfNoise::of(cells.iter().map(|cell| cell.deviation), sigma);
        mark_beside(
            (cells, columns),
            |cell| drawn.is_off(cell.deviation, RIM),
            room,
        );
        let rim = cells.iter().zip(&*room);
        let rim = rim.filter(|(cell, mark)| **mark > 0.0 && !drawn.is_off(cell.deviation, RIM));
        let rim = ExtremeOfNoise::of(rim.map(|(cell, _)| cell.deviation), sigma);
        let (mut variance, mut lever, mut g) = (0.0, 0.0, [0.0; 6]);
        for (cell, mark) in cells.iter().zip(&*room) {
            let m = match drawn.is_off(cell.deviation, RIM) || *mark == 0.0 {
                true => drawn.value(cell.deviation, RIM),
                false => rim.value(cell.deviation, RIM),
            };
            let [upper, lower] = [(tolerance - m) / sigma, (tolerance + m) / sigma];
            if libm::fabs(upper).min(libm::fabs(lower)) < SURE {
                let p = below(-upper) + below(-lower);
                variance += (p * (1.0 - p)).max(0.0);
                let slope = (normal_density(upper) - normal_density(lower)) / (sigma * count);
                lever += libm::fabs(slope);
                for (g, j) in g.iter_mut().zip(cell.taught.jacobian) {
                    *g += slope * j;
                }
            }
        }
        Some(FoundValue {
            value: outside / count,
            pixels: variance / (count * count),
            motion: motion(&g, of.placed),
            lever,
            unknown: 0.0,
        })
    }
}

/// Marks by 1 the cells that have a cell of a defect beside them, and all others by 0, in a grid of
/// so many columns.
fn mark_beside(
    (cells, columns): (&[Cell], usize),
    is_defect: impl Fn(&Cell) -> bool,
    marks: &mut Vec<f64>,
) {
    marks.clear();
    marks.resize(cells.len(), 0.0);
    let row = |at: usize| at / columns;
    for defect in cells.iter().filter(|cell| is_defect(cell)) {
        for middle in [
            defect.at.wrapping_sub(columns),
            defect.at,
            defect.at + columns,
        ] {
            let first = cells.partition_point(|cell| cell.at + 1 < middle);
            let near = cells[first..].iter().zip(&mut marks[first..]);
            near.take_while(|(cell, _)| cell.at <= middle + 1)
                .filter(|(cell, _)| row(cell.at) == row(middle))
                .for_each(|(_, mark)| *mark = 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beside_a_defect_is_marked_and_rows_do_not_wrap() {
        let deviating = [0, 14, 23];
        // Six columns; cell 7 was not measured.
        let cells = (0..24).filter(|at| *at != 7).map(|at| Cell {
            at,
            pixels: 25.0,
            height: 0.0,
            deviation: if deviating.contains(&at) { 1.0 } else { 0.0 },
            taught: Default::default(),
        });
        let cells: Vec<Cell> = cells.collect();
        let mut marks = Vec::new();
        mark_beside((&cells, 6), |cell| cell.deviation > 0.5, &mut marks);
        let marked = cells.iter().zip(&marks).filter(|(_, mark)| **mark == 1.0);
        let marked: Vec<usize> = marked.map(|(cell, _)| cell.at).collect();
        let expected = [0, 1, 6, 8, 9, 13, 14, 15, 16, 17, 19, 20, 21, 22, 23];
        assert_eq!(marked, expected);
    }
}
