//! The part as taught: where parts are compared with it, how noisy its heights were, and how much
//! deviations count.

use super::weight::{Factor, Weight};
use crate::pipeline::{COMPARED, SIGMA, SQUARE};
use alloc::vec::Vec;
use core::ops::Range;

/// The part as taught, as far as parts are compared with it; row-major. Its σ are those of one
/// measurement with the sequence that parts are compared by: golden may be the mean of several
/// ([`Parts::golden_noise`](super::Parts::golden_noise)).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taught {
    /// [`COMPARED`], [`SQUARE`] and σ.
    pixels: Vec<u16>,
    /// Empty where all that is compared counts in full.
    weights: Vec<Weight>,
    /// What deviations are multiplied by.
    factors: Vec<Factor>,
    /// The least side of the squares about each pixel; empty where any will do.
    sides: Vec<u8>,
}

impl Taught {
    /// Unit of σ in nm.
    const SIGMA_UNIT_NM: f64 = 32.0;

    /// From the weights of pixels, the shares of their height differences that lie along the normal
    /// ([`normal_shares`](crate::inspect::normal_shares)), and σ of their heights in mm, NaN where
    /// not known. σ is stored in units of 32 nm, at most half a mm.
    pub fn new(pixels: impl Iterator<Item = (Weight, f32, f64)>) -> Self {
        let mut weights = Vec::with_capacity(pixels.size_hint().0);
        let mut factors = Vec::with_capacity(pixels.size_hint().0);
        let stored = |(weight, share, mm): (Weight, f32, f64)| {
            weights.push(weight);
            factors.push(Factor::of(weight.share() * f64::from(share)));
            let units = libm::rint(mm * 1e6 / Self::SIGMA_UNIT_NM);
            let sigma = match units.is_finite() {
                true => units.clamp(1.0, f64::from(SIGMA)) as u16,
                false => 0,
            };
            sigma | if weight.compared() { COMPARED } else { 0 }
        };
        let pixels = pixels.map(stored).collect();
        if !weights.iter().any(|weight| weight.partial()) {
            weights = Vec::new();
        }
        Self {
            pixels,
            weights,
            factors,
            sides: Vec::new(),
        }
    }

    /// With the least side that the squares of a deviation have about each pixel, row-major; empty
    /// where any will do.
    #[must_use]
    pub fn with_least_sides(self, sides: Vec<u8>) -> Self {
        Self { sides, ..self }
    }

    /// The side of the square about a place for a deviation in squares of `side` pixels.
    pub(super) fn side(&self, place: usize, side: usize) -> usize {
        let least = self.sides.get(place).copied().unwrap_or_default();
        side.max(usize::from(least))
    }

    /// All sides that [`Self::side`] has, each once, the smallest first.
    pub(super) fn sides(&self, side: usize) -> Vec<usize> {
        let mut known = [false; 256];
        for &least in &self.sides {
            known[usize::from(least)] = true;
        }
        let least = (0..known.len()).filter(|&least| known[least]);
        let mut sides: Vec<usize> = least.map(|least| side.max(least)).collect();
        sides.dedup();
        if sides.is_empty() {
            sides.push(side);
        }
        sides
    }

    /// The least sides of the pixels of row `v` of a frame of `width` columns; empty where any will
    /// do.
    pub(super) fn least_sides(&self, v: usize, width: usize) -> &[u8] {
        self.sides.get(v * width..(v + 1) * width).unwrap_or(&[])
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.pixels)
            + size_of_val(&*self.weights)
            + size_of_val(&*self.factors)
            + self.sides.len()
    }

    /// All pixels, row-major: [`COMPARED`], [`SQUARE`] and σ.
    pub(super) fn pixels(&self) -> &[u16] {
        &self.pixels
    }

    /// The pixels of row `v` of a frame of `width` columns.
    pub(super) fn row(&self, v: usize, width: usize) -> &[u16] {
        &self.pixels[v * width..(v + 1) * width]
    }

    /// Marks the places where the four pixels to the right and below are all compared.
    pub(super) fn mark_squares(&mut self, width: usize) {
        for place in 0..self.pixels.len().saturating_sub(width + 1) {
            let corners = [place, place + 1, place + width, place + width + 1];
            if place % width + 1 < width && corners.iter().all(|&at| self.compared(at)) {
                self.pixels[place] |= SQUARE;
            }
        }
    }

    /// How much the deviation at a compared place counts.
    fn weight(&self, place: usize) -> Weight {
        self.weights.get(place).copied().unwrap_or(Weight::FULL)
    }

    /// What height differences at all places are multiplied by, row-major: the share along the
    /// normal times the weight.
    pub(super) fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// The same at one place.
    pub(super) fn factor(&self, place: usize) -> f64 {
        self.factors[place].number()
    }

    /// Whether the part is compared at a place, and its deviation counts in full.
    pub(super) fn full(&self, place: usize) -> bool {
        self.compared(place) && self.weight(place) == Weight::FULL
    }

    /// Whether the part is compared at a place.
    pub(super) fn compared(&self, place: usize) -> bool {
        self.pixels[place] & COMPARED != 0
    }

    /// Whether the part has a height at a place that was measured.
    pub(super) fn is_seen(&self, place: usize) -> bool {
        self.pixels[place] & SIGMA != 0
    }

    /// Whether the part is compared at all of these places.
    pub(super) fn all_compared(&self, places: Range<usize>) -> bool {
        let common = self.pixels[places]
            .iter()
            .fold(COMPARED, |all, at| all & at);
        common != 0
    }

    /// The same, and all their deviations count in full.
    pub(super) fn all_full(&self, places: Range<usize>) -> bool {
        let partial = |weights: &[Weight]| weights.iter().any(|weight| *weight != Weight::FULL);
        self.all_compared(places.clone())
            && (self.weights.is_empty() || !partial(&self.weights[places]))
    }

    /// σ in units of 32 nm, 0 where not known.
    pub(super) fn sigma(&self, place: usize) -> u16 {
        self.pixels[place] & SIGMA
    }

    /// σ in mm, 0 where not known.
    pub(super) fn sigma_mm(&self, place: usize) -> f64 {
        f64::from(self.sigma(place)) * (Self::SIGMA_UNIT_NM * 1e-6)
    }
}
