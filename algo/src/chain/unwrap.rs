//! Applies a chain to the wrapped phases of its levels.

use super::{Cells, Chain, CodeWord, Edges};
use crate::chain::{ChainStart, Link};
use crate::phase::Trust;
use crate::pipeline::{PhaseMap, for_each_row};
use crate::trust::MAX_RESIDUAL;
use crate::units::AbsolutePhase;
use alloc::vec;

impl Chain {
    /// The chain with the cells of its code moved to where they end within the fringes of the
    /// finest level, if that is near to where they should: half a pixel of the projector, or an
    /// edge that is seen brighter than in its middle, is then no wrong order.
    #[must_use]
    pub fn aligned(mut self, edges: &Edges) -> Self {
        let finest = self.links[self.links.len() - 1].ratio;
        if let ChainStart::Code(cells) = &mut self.start {
            cells.origin += edges.misalignment(cells, finest).unwrap_or(0.0) / finest;
        }
        self
    }

    /// The absolute phase of every pixel, from the wrapped phases of all levels (coarse to fine, of
    /// one size) and, where the chain starts from a code, what each pixel sees of it (row-major).
    ///
    /// The modulation is the finest level's. A pixel is `Dark` or of `LowModulation` where a level
    /// that takes part is, the former if it is the coarsest of them; its phase is a `Residual`
    /// where a fringe order would be a guess or the cell lies outside the projector's raster.
    pub fn unwrap(&self, wrapped: &[PhaseMap], code: Option<&[CodeWord]>) -> PhaseMap {
        self.unwrap_within(MAX_RESIDUAL, wrapped, code)
    }

    /// As [`Self::unwrap`] for a chain that starts about a map: Φ in turns, row-major. A pixel is
    /// `Unexpected` where the map is unknown.
    pub fn unwrap_about(&self, wrapped: &[PhaseMap], map: &[AbsolutePhase]) -> PhaseMap {
        self.unwrap_from(MAX_RESIDUAL, wrapped, &Given::Map(map))
    }

    /// As [`Self::unwrap`], with another largest residual of the steps between levels, in turns: of
    /// phases that have nothing to do with each other a share of twice this limit passes each step.
    /// The step from a code is as in [`Self::unwrap`].
    pub fn unwrap_within(
        &self,
        residual: f64,
        wrapped: &[PhaseMap],
        code: Option<&[CodeWord]>,
    ) -> PhaseMap {
        self.unwrap_from(residual, wrapped, &code.map_or(Given::Nothing, Given::Code))
    }

    fn unwrap_from(&self, residual: f64, wrapped: &[PhaseMap], given: &Given<'_>) -> PhaseMap {
        let finest = &wrapped[wrapped.len() - 1];
        let width = finest.width;
        let uses = self.uses();
        let coarsest = uses.iter().position(|&used| used).unwrap_or(0);
        let mut pixels = vec![(AbsolutePhase::UNKNOWN, Trust::Dark); finest.phase.len()];
        for_each_row(&mut pixels, width, |v, row| {
            for (u, pixel) in row.iter_mut().enumerate() {
                let index = v * width + u;
                let levels = || wrapped.iter().zip(&uses).filter(|(_, used)| **used);
                let refusal = levels()
                    .map(|(level, _)| level.trust[index])
                    .filter(|trust| !trust.has_phase())
                    .min();
                pixel.1 = match refusal {
                    Some(Trust::Dark) if wrapped[coarsest].trust[index] != Trust::Dark => {
                        Trust::LowModulation
                    }
                    Some(refusal) => refusal,
                    None => match self.phase(residual, wrapped, given, index) {
                        Err(refusal) => refusal,
                        Ok(turns) => {
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

    /// Φ of a pixel in turns.
    ///
    /// # Errors
    /// If a residual is too large, or nothing is known to start from.
    fn phase(
        &self,
        residual: f64,
        wrapped: &[PhaseMap],
        given: &Given<'_>,
        at: usize,
    ) -> Result<f64, Trust> {
        let (mut estimate, mut limit) = match (&self.start, given) {
            (ChainStart::Code(cells), Given::Code(code)) => {
                let (turns, limit) = self.first(cells, code[at], wrapped, at)?;
                (Some(turns), limit)
            }
            (_, Given::Map(map)) if map[at].is_known() => (Some(map[at].turns()), 0.5),
            (ChainStart::Itself(_), Given::Nothing) => (None, residual),
            _ => return Err(Trust::Unexpected),
        };
        for link in &self.links {
            let phase = link.phase(wrapped, at);
            let absolute = match (estimate, &self.start) {
                (None, ChainStart::Itself(lowest)) => {
                    let above = phase - lowest;
                    lowest + (above - libm::floor(above))
                }
                (known, _) => {
                    let order = link.ratio * known.unwrap_or(0.0) - phase;
                    let whole = libm::rint(order);
                    if libm::fabs(order - whole) > limit {
                        return Err(Trust::Residual);
                    }
                    limit = residual;
                    phase + whole
                }
            };
            estimate = Some(absolute / link.ratio);
        }
        estimate.ok_or(Trust::Unexpected)
    }

    /// Φ in the middle of the cell that a pixel sees, and the largest residual of the first link
    /// there.
    ///
    /// # Errors
    /// If the cell lies outside the projector's raster.
    fn first(
        &self,
        cells: &Cells,
        seen: CodeWord,
        wrapped: &[PhaseMap],
        at: usize,
    ) -> Result<(f64, f64), Trust> {
        let cell = u32::from(cells.coding.cell(seen.word, cells.bits));
        if cell >= cells.count {
            return Err(Trust::Residual);
        }
        let middle = cells.origin + (f64::from(cell) + 0.5) * cells.width;
        let first = &self.links[0];
        let wide = first.ratio * cells.width > 2.0 * MAX_RESIDUAL;
        let aside = first.ratio * middle - first.phase(wrapped, at);
        let decided = wide && cells.decides(cell, aside - libm::rint(aside), seen);
        let limit = if decided {
            0.5 - first.noise
        } else {
            MAX_RESIDUAL
        };
        Ok((middle, limit))
    }
}

/// What is known of each pixel beside its wrapped phases.
enum Given<'a> {
    Nothing,
    Code(&'a [CodeWord]),
    Map(&'a [AbsolutePhase]),
}

impl Link {
    /// Σ m_i φ_i of a pixel, turns.
    fn phase(&self, wrapped: &[PhaseMap], at: usize) -> f64 {
        let terms = wrapped.iter().zip(&self.weights);
        terms
            .map(|(level, &weight)| level.phase[at].turns() * f64::from(weight))
            .sum()
    }
}

impl Cells {
    /// Whether a pixel is surely in this cell and not in the neighbour at whose far side it would
    /// have the same phase: the bits in which both differ are decisive. `aside` is how far the
    /// pixel lies before the middle of the cell, in turns.
    fn decides(&self, cell: u32, aside: f64, seen: CodeWord) -> bool {
        let neighbour = match aside > 0.0 {
            true => Some(cell + 1).filter(|&neighbour| neighbour < self.count),
            false => cell.checked_sub(1),
        };
        neighbour.is_none_or(|neighbour| {
            let word = |cell| self.coding.word(cell, self.bits);
            let differ = word(cell) ^ word(neighbour);
            seen.decisive & differ == differ
        })
    }
}
