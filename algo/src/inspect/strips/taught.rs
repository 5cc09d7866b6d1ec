//! The part as taught: where parts are compared with it, and how noisy its heights were.

use crate::pipeline::{COMPARED, SIGMA, SQUARE};
use alloc::vec::Vec;

/// The part as taught, as far as parts are compared with it; row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taught(pub(super) Vec<u16>);

impl Taught {
    /// Unit of σ in nm.
    const SIGMA_UNIT_NM: f64 = 32.0;

    /// From where the part is compared and σ of its heights in mm, NaN where not known. σ is stored in units of 32 nm, at
    /// most half a mm.
    pub fn new(pixels: impl Iterator<Item = (bool, f64)>) -> Self {
        let stored = |(compared, mm): (bool, f64)| {
            let units = libm::rint(mm * 1e6 / Self::SIGMA_UNIT_NM);
            let sigma = match units.is_finite() {
                true => units.clamp(1.0, f64::from(SIGMA)) as u16,
                false => 0,
            };
            sigma | if compared { COMPARED } else { 0 }
        };
        Self(pixels.map(stored).collect())
    }

    /// Marks the places where the four pixels to the right and below are all compared.
    pub(super) fn mark_squares(&mut self, width: usize) {
        for place in 0..self.0.len().saturating_sub(width + 1) {
            let corners = [place, place + 1, place + width, place + width + 1];
            if place % width + 1 < width && corners.iter().all(|&at| self.compared(at)) {
                self.0[place] |= SQUARE;
            }
        }
    }

    /// Whether the part is compared at a place.
    pub(in crate::inspect) fn compared(&self, place: usize) -> bool {
        self.0[place] & COMPARED != 0
    }

    /// σ in its units.
    pub(super) fn sigma(&self, place: usize) -> u16 {
        self.0[place] & SIGMA
    }

    /// σ in mm, 0 where not known.
    pub(in crate::inspect) fn sigma_mm(&self, place: usize) -> f64 {
        f64::from(self.sigma(place)) * (Self::SIGMA_UNIT_NM * 1e-6)
    }
}
