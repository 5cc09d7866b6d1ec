//! Slices of units as slices of the plain numbers that they wrap, for loads and stores.

use crate::units::{AbsolutePhase, Modulation};

/// Phases as their bits.
pub(crate) fn phase_bits(phases: &[AbsolutePhase]) -> &[i32] {
    // SAFETY: `AbsolutePhase` is a transparent wrapper of `i32`.
    unsafe { core::slice::from_raw_parts(phases.as_ptr().cast(), phases.len()) }
}

/// Phases as their bits.
pub(crate) fn phase_bits_mut(phases: &mut [AbsolutePhase]) -> &mut [i32] {
    // SAFETY: `AbsolutePhase` is a transparent wrapper of `i32`, and every `i32` is one.
    unsafe { core::slice::from_raw_parts_mut(phases.as_mut_ptr().cast(), phases.len()) }
}

/// Modulations as their bits.
pub(crate) fn modulation_bits_mut(modulations: &mut [Modulation]) -> &mut [u16] {
    // SAFETY: `Modulation` is a transparent wrapper of `u16`, and every `u16` is one.
    unsafe { core::slice::from_raw_parts_mut(modulations.as_mut_ptr().cast(), modulations.len()) }
}
