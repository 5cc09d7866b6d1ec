//! What the fit multiplies and sums up of each pixel of a row.

use crate::units::AbsolutePhase;
use alloc::vec::Vec;

/// The window's side in pixels.
pub const SIDE: usize = 7;
pub const REACH: usize = SIDE / 2;
/// Pixels of a window.
pub const PIXELS: f64 = (SIDE * SIDE) as f64;
/// By so many bits the terms of pixels are smaller where golden is not compared: beside the others
/// they hardly count.
pub const FAINT: u8 = 3;

/// A row as the fit needs it. Whole blocks of pixels; those behind the row are 0, and nothing is
/// expected there.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    pub phase: Vec<AbsolutePhase>,
    pub compared: Vec<bool>,
    /// (I₁ + I₂) / 2 in the unit of the sums, less than 0 where a sample is at full scale.
    pub light: Vec<f32>,
    /// s, c and d in 12 bits.
    pub s: Vec<i16>,
    pub c: Vec<i16>,
    pub d: Vec<i16>,
}

impl Terms {
    pub fn clear(&mut self, pixels: usize) {
        refill(&mut self.phase, pixels, AbsolutePhase::UNKNOWN);
        refill(&mut self.compared, pixels, false);
        refill(&mut self.light, pixels, 0.0);
        for list in [&mut self.s, &mut self.c, &mut self.d] {
            refill(list, pixels, 0);
        }
    }
}

pub fn refill<T: Copy>(list: &mut Vec<T>, length: usize, value: T) {
    list.clear();
    list.resize(length, value);
}
