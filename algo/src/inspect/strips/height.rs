//! Heights and errors of single pixels, and the points that a part's motion is found from.

use super::{Light, Production, Strip};
use crate::geometry::Solution;
use crate::inspect::align::{Alignment, Sample};
use crate::pipeline::{NO_RISE, RowTally};
use crate::units::{AbsolutePhase, Height, Modulation};

impl Strip {
    /// Keeps the points of its rows that the part's motion is found from.
    pub(super) fn sample(&mut self, plan: &Production, alignment: &Alignment, light: Light<'_>) {
        self.samples.clear();
        let (first, spots) = alignment.spots(self.rows());
        let mut decoded = None;
        for (at, spot) in spots.iter().enumerate() {
            let (u, v) = (spot.u, spot.v);
            if decoded != Some(v) {
                let columns = plan.window[v].clone();
                self.row(plan, light, v, columns, &mut RowTally::default());
                decoded = Some(v);
            }
            if self.rise[u] == NO_RISE {
                continue;
            }
            let base = plan.rises.surface().height[v * self.width + u];
            let height = Height::from_nm(base.nm().saturating_add(self.rise[u]));
            let slope = plan.slope((u, v), self.phase[u]);
            if let Some(point) = plan.triangulator.point(u, v, height) {
                self.samples.push(Sample {
                    point,
                    sigma: plan.sigma_nm(self.modulation[u], slope) * 1e-6,
                    over: Some((first + at, f64::from(self.rise[u]) * 1e-6)),
                });
            }
        }
    }
}

impl Production {
    /// The exact height of a phase.
    pub(super) fn solve(&self, (u, v): (usize, usize), phase: AbsolutePhase) -> Option<Solution> {
        let (column, row) = (u as f64, v as f64);
        let place = v * self.rises.surface().width + u;
        match self.rises.near(place, phase) {
            Some(near) => self
                .triangulator
                .solve_near(column, row, phase.turns(), near),
            None => self.triangulator.solve(column, row, phase.turns()),
        }
    }

    /// ∂z/∂Φ in mm per turn.
    pub(super) fn slope(&self, (u, v): (usize, usize), phase: AbsolutePhase) -> f64 {
        let place = v * self.rises.surface().width + u;
        self.rises.slope(place, phase).unwrap_or_else(|| {
            self.solve((u, v), phase)
                .map_or(0.0, |solution| 1.0 / solution.slope)
        })
    }

    /// σ_z in nm.
    pub(super) fn sigma_nm(&self, modulation: Modulation, slope: f64) -> f64 {
        let turns = self.decoder.phase_noise(modulation, self.noise_counts);
        libm::fabs(turns * slope) * 1e6
    }
}
