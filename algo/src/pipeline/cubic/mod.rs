//! Height offsets from a known surface: z − z₀ as a cubic of Φ − Φ₀, planned for every pixel.
//!
//! With y = (Φ − Φ₀) / range: z − z₀ = a y + b y² + c y³, a least-squares fit to exact evaluations
//! of Φ(z) on the pixel's line of sight (`fit.rs`). Each cubic is used within the pixel's own
//! reach, the largest |Φ − Φ₀| up to the declared range for which it is within 1 µm of the exact
//! height at the fitted points. Further away, and where no cubic fits, the exact triangulation is
//! used. A pixel takes 9 bytes beside Φ₀ and z₀.

mod fit;
mod row;

pub(crate) use row::{
    COMPARED, CubicInput, CubicOutput, CubicRow, HeightTally, NO_OFFSET, SIGMA, SQUARE,
    VARIANCE_UNIT_NM, offset_row, sum_variances,
};

use super::{Done, Progress, Window, for_each};
use crate::geometry::Triangulator;
use crate::phase::Trust;
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Height, Modulation};
use alloc::vec;
use alloc::vec::Vec;
use fit::{CubicFit, NearBlocks};

/// A known surface, row-major: its phases and heights.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownSurface {
    /// Pixels per row.
    pub width: usize,
    /// Φ₀, [`AbsolutePhase::UNKNOWN`] where it is not known.
    pub phase: Vec<AbsolutePhase>,
    /// z₀, the height that has this phase.
    pub height: Vec<Height>,
}

/// The cubics of all pixels, which give their heights about a known surface.
#[derive(Clone, Debug)]
pub struct HeightCubics {
    surface: KnownSurface,
    /// The declared range in turns: |Φ − Φ₀| at y = 1.
    range: f64,
    /// Coefficient of y, nm.
    first: Vec<f32>,
    /// Coefficients of y² and y³, units of [`fit::UNIT_NM`].
    second: Vec<i16>,
    third: Vec<i16>,
    /// |Φ − Φ₀| below which the cubic is used, units of [`REACH_UNIT`] turns; 0 without a cubic.
    reach: Vec<u8>,
}

/// The unit of a pixel's reach in turns.
const REACH_UNIT: f64 = 1.0 / 128.0;
/// The largest range that a reach can express, turns.
const MAX_RANGE: f64 = 127.0 * REACH_UNIT;

impl HeightCubics {
    /// Plans the pixels inside `window` for |Φ − Φ₀| up to `range` turns (or a little less than a
    /// turn).
    ///
    /// Where z₀ is known and Φ₀ is not, Φ₀ is computed from z₀: exactly within `around` pixels of a
    /// pixel where it is known; further away, where nothing is expected and there are no cubics,
    /// interpolated between exact values. `progress` gets the share that is done.
    pub fn new(
        triangulator: &Triangulator,
        surface: KnownSurface,
        range: f64,
        window: Window<'_>,
        around: usize,
        progress: Progress<'_>,
    ) -> Self {
        let pixels = surface.phase.len();
        let width = surface.width.max(1);
        let range = range.clamp(REACH_UNIT, MAX_RANGE);
        let near = NearBlocks::new(&surface, around);
        let mut cubics = Self {
            surface,
            range,
            first: vec![0.0; pixels],
            second: vec![0; pixels],
            third: vec![0; pixels],
            reach: vec![0; pixels],
        };
        let fitting = CubicFit::new(triangulator, range);
        let heights = &cubics.surface.height;
        let rows = cubics
            .surface
            .phase
            .chunks_mut(width)
            .zip(cubics.first.chunks_mut(width))
            .zip(cubics.second.chunks_mut(width))
            .zip(cubics.third.chunks_mut(width))
            .zip(cubics.reach.chunks_mut(width))
            .collect();
        let done = Done::new(progress, pixels / width);
        for_each(rows, |v, ((((phases, first), second), third), reach)| {
            let heights = &heights[v * width..(v + 1) * width];
            for (columns, near) in near.row(v) {
                if !near {
                    fitting.between(v, columns, phases, heights);
                    continue;
                }
                for u in columns {
                    if !window[v].contains(&u) {
                        fitting.complete((u, v), &mut phases[u], heights[u]);
                    } else if let Some(cubic) = fitting.cubic((u, v), &mut phases[u], heights[u]) {
                        first[u] = cubic.first;
                        (second[u], third[u]) = (cubic.second, cubic.third);
                        reach[u] = cubic.reach;
                    }
                }
            }
            done.row();
        });
        cubics
    }

    /// Its size in memory, bytes.
    pub fn bytes(&self) -> usize {
        let surface = size_of_val(&*self.surface.phase) + size_of_val(&*self.surface.height);
        let cubics = size_of_val(&*self.first) + size_of_val(&*self.second);
        surface + cubics + size_of_val(&*self.third) + size_of_val(&*self.reach)
    }

    /// The known surface.
    pub fn surface(&self) -> &KnownSurface {
        &self.surface
    }

    /// The declared range in turns.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// The largest |Φ − Φ₀| in turns for which the cubic of a pixel (row-major index) is used, 0
    /// where there is none.
    pub fn reach(&self, place: usize) -> f64 {
        f64::from(self.reach[place]) * REACH_UNIT
    }

    /// The heights of phases of row `v`, [`Height::UNKNOWN`] where the cubic does not reach them,
    /// as production computes them. Slices are as long as the row.
    pub fn heights(&self, backend: Backend, v: usize, phase: &[AbsolutePhase], out: &mut [Height]) {
        let width = self.surface.width;
        let seen = CubicInput {
            phase,
            modulation: &vec![Modulation::from_bits(1); width],
            trust: &vec![Trust::Resolved; width],
            taught: &vec![0; width],
            noise: 0.0,
        };
        let mut offset = vec![NO_OFFSET; width];
        let output = CubicOutput {
            offset: &mut offset,
            deviation: &mut vec![NO_OFFSET; width],
            tally: &mut HeightTally::default(),
            extent: &mut (0..0),
        };
        offset_row(backend, self.row(v), seen, 0..width, output);
        let bases = &self.surface.height[v * width..];
        for ((out, base), offset) in out.iter_mut().zip(bases).zip(offset) {
            *out = match offset {
                NO_OFFSET => Height::UNKNOWN,
                _ => Height::from_nm(base.nm() + offset),
            };
        }
    }

    /// y of a pixel's phase, if it is within the cubic's reach.
    fn share(&self, place: usize, phase: AbsolutePhase) -> Option<f64> {
        let base = self.surface.phase[place];
        let delta = (phase - base).turns();
        (base.is_known() && libm::fabs(delta) < self.reach(place)).then(|| delta / self.range)
    }

    /// ∂z/∂Φ in mm per turn at a pixel's phase, if it is within the cubic's reach.
    pub fn slope(&self, place: usize, phase: AbsolutePhase) -> Option<f64> {
        let y = self.share(place, phase)?;
        let [first, second, third] = self.coefficients(place);
        Some((first + y * (2.0 * second + y * 3.0 * third)) / self.range)
    }

    /// A height in mm near that of a pixel's phase, by the cubic's slope at the known height;
    /// `None` beyond twice the range.
    pub fn near(&self, place: usize, phase: AbsolutePhase) -> Option<f64> {
        let (base, height) = (self.surface.phase[place], self.surface.height[place]);
        let known = base.is_known() && height.is_known() && self.reach[place] > 0;
        let delta = (phase - base).turns();
        (known && libm::fabs(delta) <= 2.0 * self.range)
            .then(|| height.mm() + delta / self.range * self.coefficients(place)[0])
    }

    /// Coefficients of y, y² and y³ in mm.
    fn coefficients(&self, place: usize) -> [f64; 3] {
        [
            f64::from(self.first[place]),
            f64::from(self.second[place]) * fit::UNIT_NM,
            f64::from(self.third[place]) * fit::UNIT_NM,
        ]
        .map(|nm| nm * 1e-6)
    }

    /// The cubics of row `v`.
    pub(crate) fn row(&self, v: usize) -> CubicRow<'_> {
        let width = self.surface.width;
        let row = v * width..(v + 1) * width;
        CubicRow {
            base: &self.surface.phase[row.clone()],
            first: &self.first[row.clone()],
            second: &self.second[row.clone()],
            third: &self.third[row.clone()],
            reach: &self.reach[row],
            range: self.range,
        }
    }
}
