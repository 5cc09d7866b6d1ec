//! Applies a chain to the wrapped phases of its levels.

use super::Chain;
use crate::phase::Trust;
use crate::pipeline::{PhaseMap, for_each_row};
use crate::units::AbsolutePhase;
use alloc::vec;

/// Largest rounding residual of a step, in turns: as in the production kernels.
const MAX_RESIDUAL: f64 = 0.40;

impl Chain {
    /// The absolute phase of every pixel, from the wrapped phases of all levels (coarse to fine, of one size) and, where the chain
    /// starts from a code, the cell that each pixel sees (row-major).
    ///
    /// The modulation is the finest level's. A pixel is `Dark` or of `LowModulation` where a level that takes part is, the former if
    /// it is the coarsest of them; its phase is a `Residual` where a fringe order would be a guess or the cell is none of the
    /// projector's.
    pub fn unwrap(&self, wrapped: &[PhaseMap], cells: Option<&[u16]>) -> PhaseMap {
        self.unwrap_within(MAX_RESIDUAL, wrapped, cells)
    }

    /// As [`Self::unwrap`], with another largest residual of the steps between levels, in turns: of phases that have nothing to do with
    /// each other a share of twice this limit passes each step. The step from a code is as in [`Self::unwrap`].
    pub fn unwrap_within(
        &self,
        residual: f64,
        wrapped: &[PhaseMap],
        cells: Option<&[u16]>,
    ) -> PhaseMap {
        let finest = &wrapped[wrapped.len() - 1];
        let width = finest.width;
        let uses = self.uses();
        let coarsest = uses.iter().position(|&used| used).unwrap_or(0);
        let mut pixels = vec![(AbsolutePhase::UNKNOWN, Trust::Dark); finest.phase.len()];
        for_each_row(&mut pixels, width, |v, row| {
            for (u, pixel) in row.iter_mut().enumerate() {
                let at = v * width + u;
                let levels = || wrapped.iter().zip(&uses).filter(|(_, used)| **used);
                let refusal = levels()
                    .map(|(level, _)| level.trust[at])
                    .filter(|trust| !trust.has_phase())
                    .min();
                pixel.1 = match refusal {
                    Some(Trust::Dark) if wrapped[coarsest].trust[at] != Trust::Dark => {
                        Trust::LowModulation
                    }
                    Some(refusal) => refusal,
                    None => match self.phase(residual, wrapped, cells, at) {
                        None => Trust::Residual,
                        Some(turns) => {
                            pixel.0 = AbsolutePhase::from_turns(turns);
                            Trust::Resolved
                        }
                    },
                };
            }
        });
        let mut map = finest.clone();
        for (at, (phase, trust)) in pixels.into_iter().enumerate() {
            (map.phase[at], map.trust[at]) = (phase, trust);
            if trust != Trust::Resolved {
                map.modulation[at] = Default::default();
            }
        }
        map
    }

    /// Φ of a pixel in turns; `None` if a residual is too large.
    fn phase(
        &self,
        residual: f64,
        wrapped: &[PhaseMap],
        cells: Option<&[u16]>,
        at: usize,
    ) -> Option<f64> {
        let mut estimate = match (self.cells, cells) {
            (Some(code), Some(cells)) => {
                let cell = cells[at];
                if u32::from(cell) >= code.count {
                    return None;
                }
                Some(code.origin + (f64::from(cell) + 0.5) * code.width)
            }
            _ => None,
        };
        let mut limit = if estimate.is_some() {
            MAX_RESIDUAL
        } else {
            residual
        };
        for link in &self.links {
            let terms = wrapped.iter().zip(&link.weights);
            let phase: f64 = terms
                .map(|(level, &weight)| level.phase[at].turns() * f64::from(weight))
                .sum();
            let absolute = match estimate {
                None => {
                    let above = phase - self.lowest;
                    self.lowest + (above - libm::floor(above))
                }
                Some(turns) => {
                    let order = link.ratio * turns - phase;
                    let whole = libm::rint(order);
                    if libm::fabs(order - whole) > limit {
                        return None;
                    }
                    limit = residual;
                    phase + whole
                }
            };
            estimate = Some(absolute / link.ratio);
        }
        estimate
    }
}
