//! The phase function Φ_P(ξ, η) of a pattern.

use super::interpolate::catmull_rom;
use alloc::vec::Vec;
use core::fmt;

/// Largest |Φ_P| and largest phase of a level, in turns: a projector of 4,096 columns at 4 pixels
/// per turn. The kernels compute fringe orders in 16-bit words with at least 4 fractional bits.
pub const MAX_TURNS: f64 = 1000.0;

/// The phase function Φ_P(ξ, η) of a pattern in turns, over projector pixels (ξ = column, η = row,
/// centres at integers). Defined for every real ξ and η: it continues linearly outside its raster,
/// so that a reference phase map can extend beyond the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseFunction {
    columns: usize,
    rows: usize,
    shape: FunctionShape,
}

#[derive(Clone, Debug, PartialEq)]
enum FunctionShape {
    /// Φ_P = fringes · ξ / columns.
    Vertical { fringes: f64 },
    /// Φ_P = fringes · η / rows.
    Horizontal { fringes: f64 },
    /// One value per pixel centre, row-major; between them Catmull–Rom (continuous first
    /// derivative).
    Sampled(Vec<f64>),
}

/// The values that a phase function takes over the pixel centres of its raster, in turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseRange {
    /// Smallest Φ_P.
    pub min: f64,
    /// Largest Φ_P.
    pub max: f64,
}

/// A phase function that no projector can show.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhaseFunctionError {
    /// The raster has no pixels, or fewer than two rows or columns of a sampled function.
    #[error("a phase function of {columns} x {rows} pixels is empty or too small")]
    Size {
        /// Projector columns.
        columns: usize,
        /// Projector rows.
        rows: usize,
    },
    /// The number of fringes is not a positive number of at most [`MAX_TURNS`].
    #[error("{0} fringes: give a positive number of at most {MAX_TURNS}")]
    Fringes(f64),
    /// The number of samples is not rows × columns.
    #[error("the phase function has {given} samples where the projector has {expected} pixels")]
    Length {
        /// rows × columns.
        expected: usize,
        /// Samples given.
        given: usize,
    },
    /// A sample is not finite or beyond ± [`MAX_TURNS`].
    #[error(
        "the phase function is {value} at column {column}, row {row}: every sample must be \
         finite and within ± {MAX_TURNS} turns"
    )]
    Sample {
        /// Projector column.
        column: usize,
        /// Projector row.
        row: usize,
        /// The value found.
        value: f64,
    },
}

impl PhaseFunction {
    /// Fringes parallel to the projector's columns: Φ_P = fringes · ξ / columns.
    ///
    /// # Errors
    /// If the raster is empty or `fringes` is not in (0, [`MAX_TURNS`]].
    pub fn vertical(columns: usize, rows: usize, fringes: f64) -> Result<Self, PhaseFunctionError> {
        Self::fixed(columns, rows, fringes, FunctionShape::Vertical { fringes })
    }

    /// Fringes parallel to the projector's rows: Φ_P = fringes · η / rows.
    ///
    /// # Errors
    /// As for [`Self::vertical`].
    pub fn horizontal(
        columns: usize,
        rows: usize,
        fringes: f64,
    ) -> Result<Self, PhaseFunctionError> {
        Self::fixed(
            columns,
            rows,
            fringes,
            FunctionShape::Horizontal { fringes },
        )
    }

    fn fixed(
        columns: usize,
        rows: usize,
        fringes: f64,
        shape: FunctionShape,
    ) -> Result<Self, PhaseFunctionError> {
        if columns == 0 || rows == 0 {
            return Err(PhaseFunctionError::Size { columns, rows });
        }
        if !(fringes > 0.0 && fringes <= MAX_TURNS) {
            return Err(PhaseFunctionError::Fringes(fringes));
        }
        Ok(Self {
            columns,
            rows,
            shape,
        })
    }

    /// A sampled function, from one value in turns for each projector pixel, row-major.
    ///
    /// # Errors
    /// If the size does not fit the samples, is smaller than 2 × 2, or a sample is not usable.
    pub fn sampled(
        columns: usize,
        rows: usize,
        turns: Vec<f64>,
    ) -> Result<Self, PhaseFunctionError> {
        if columns < 2 || rows < 2 {
            return Err(PhaseFunctionError::Size { columns, rows });
        }
        let expected = columns.saturating_mul(rows);
        if turns.len() != expected {
            return Err(PhaseFunctionError::Length {
                expected,
                given: turns.len(),
            });
        }
        // Written so that a NaN is caught as well.
        if let Some(at) = turns.iter().position(|&t| !(libm::fabs(t) <= MAX_TURNS)) {
            return Err(PhaseFunctionError::Sample {
                column: at % columns,
                row: at / columns,
                value: turns[at],
            });
        }
        Ok(Self {
            columns,
            rows,
            shape: FunctionShape::Sampled(turns),
        })
    }

    /// Projector columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Projector rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether the function is given by samples, so that it need not be monotone.
    pub fn is_sampled(&self) -> bool {
        matches!(self.shape, FunctionShape::Sampled(_))
    }

    /// The samples of a sampled function, row-major.
    pub(super) fn samples(&self) -> Option<&[f64]> {
        match &self.shape {
            FunctionShape::Sampled(turns) => Some(turns),
            _ => None,
        }
    }

    /// Whether all rows are equal, so that one encoded row serves for all.
    pub(super) fn is_vertical(&self) -> bool {
        matches!(self.shape, FunctionShape::Vertical { .. })
    }

    /// Φ_P at the centre of a pixel of the raster, in turns.
    #[inline]
    pub fn at_pixel(&self, column: usize, row: usize) -> f64 {
        match &self.shape {
            FunctionShape::Sampled(turns) => turns[row * self.columns + column],
            _ => self.at(column as f64, row as f64),
        }
    }

    /// Φ_P of every pixel in turns, row-major.
    pub fn turns(&self) -> Vec<f64> {
        let places = 0..self.columns * self.rows;
        places
            .map(|at| self.at_pixel(at % self.columns, at / self.columns))
            .collect()
    }

    /// Φ_P(ξ, η) in turns, anywhere.
    #[inline]
    pub fn at(&self, xi: f64, eta: f64) -> f64 {
        match &self.shape {
            FunctionShape::Vertical { fringes } => fringes * xi / self.columns as f64,
            FunctionShape::Horizontal { fringes } => fringes * eta / self.rows as f64,
            FunctionShape::Sampled(turns) => {
                catmull_rom(turns, (self.columns, self.rows), (xi, eta))
            }
        }
    }

    /// Smallest and largest pitch along the rows of the raster, pixels.
    pub fn pitches(&self) -> [f64; 2] {
        let places =
            (0..self.rows).flat_map(|row| (1..self.columns).map(move |column| (column, row)));
        let pitches = places.map(|(column, row)| {
            1.0 / (self.at_pixel(column, row) - self.at_pixel(column - 1, row))
        });
        pitches.fold([f64::INFINITY, 0.0], |[low, high], pitch| {
            [low.min(pitch), high.max(pitch)]
        })
    }

    /// The values over the pixel centres of the raster.
    pub fn range(&self) -> PhaseRange {
        match &self.shape {
            FunctionShape::Vertical { .. } | FunctionShape::Horizontal { .. } => PhaseRange {
                min: 0.0,
                max: self.at_pixel(self.columns - 1, self.rows - 1),
            },
            FunctionShape::Sampled(turns) => turns.iter().fold(
                PhaseRange {
                    min: f64::INFINITY,
                    max: f64::NEG_INFINITY,
                },
                |range, &t| PhaseRange {
                    min: range.min.min(t),
                    max: range.max.max(t),
                },
            ),
        }
    }
}

/// In words, for messages: kind, number of fringes, raster.
impl fmt::Display for PhaseFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (columns, rows) = (self.columns, self.rows);
        match &self.shape {
            FunctionShape::Vertical { fringes } => write!(f, "{fringes} vertical fringes"),
            FunctionShape::Horizontal { fringes } => write!(f, "{fringes} horizontal fringes"),
            FunctionShape::Sampled(_) => {
                let PhaseRange { min, max } = self.range();
                write!(f, "a sampled phase function of {min:.3} to {max:.3} turns")
            }
        }?;
        write!(f, " on {columns}x{rows} pixels")
    }
}

impl PhaseRange {
    /// max − min, in turns.
    pub fn span(&self) -> f64 {
        self.max - self.min
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn quadratic(columns: usize, rows: usize) -> Vec<f64> {
        (0..rows * columns)
            .map(|i| {
                let (x, y) = ((i % columns) as f64, (i / columns) as f64);
                0.5 * x + 0.01 * x * x + 0.2 * y
            })
            .collect()
    }

    #[test]
    fn a_sampled_function_reproduces_quadratics_inside_and_goes_on_linearly_outside() {
        let function = PhaseFunction::sampled(16, 8, quadratic(16, 8)).unwrap();
        let truth = |x: f64, y: f64| 0.5 * x + 0.01 * x * x + 0.2 * y;
        for (x, y) in [(3.0, 2.0), (7.3, 4.6), (12.9, 5.01)] {
            assert!((function.at(x, y) - truth(x, y)).abs() < 1e-12);
        }
        let slope = truth(15.0, 3.0) - truth(14.0, 3.0);
        for x in [17.5, 25.0, 4000.0] {
            let expected = truth(15.0, 3.0) + slope * (x - 15.0);
            assert!((function.at(x, 3.0) - expected).abs() < 1e-9, "at {x}");
        }
        let slope = truth(1.0, 3.0) - truth(0.0, 3.0);
        for x in [-2.5, -40.0] {
            assert!((function.at(x, 3.0) - (truth(0.0, 3.0) + slope * x)).abs() < 1e-9);
        }
    }

    #[test]
    fn the_first_derivative_is_continuous_across_the_edge_of_the_raster() {
        let function = PhaseFunction::sampled(16, 8, quadratic(16, 8)).unwrap();
        for edge in [-2.0, -1.0, 0.0, 5.0, 15.0, 16.0] {
            let h = 1e-6;
            let left = (function.at(edge, 3.3) - function.at(edge - h, 3.3)) / h;
            let right = (function.at(edge + h, 3.3) - function.at(edge, 3.3)) / h;
            assert!((left - right).abs() < 1e-5, "at {edge}: {left} {right}");
        }
    }

    #[test]
    fn unusable_phase_functions_are_refused_with_the_place() {
        assert!(PhaseFunction::vertical(1024, 768, f64::NAN).is_err());
        assert!(PhaseFunction::vertical(1024, 768, 0.0).is_err());
        assert!(PhaseFunction::vertical(0, 768, 8.0).is_err());
        let mut turns = quadratic(4, 4);
        turns[6] = f64::NAN;
        assert!(matches!(
            PhaseFunction::sampled(4, 4, turns),
            Err(PhaseFunctionError::Sample {
                column: 2,
                row: 1,
                ..
            })
        ));
        assert!(matches!(
            PhaseFunction::sampled(4, 3, quadratic(4, 4)),
            Err(PhaseFunctionError::Length {
                expected: 12,
                given: 16
            })
        ));
    }
    #[test]
    fn the_pitches_of_a_pattern_are_those_of_its_rows() {
        let straight = PhaseFunction::vertical(64, 3, 8.0).unwrap();
        assert_eq!(straight.pitches(), [8.0, 8.0]);
        let turns = (0..3 * 5).map(|at| [0.0, 0.25, 0.5, 0.625, 0.75][at % 5]);
        let curved = PhaseFunction::sampled(5, 3, turns.collect()).unwrap();
        assert_eq!(curved.pitches(), [4.0, 8.0]);
    }
}
