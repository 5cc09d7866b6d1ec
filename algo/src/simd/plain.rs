//! Units as the plain numbers that lanes are stored to.

use crate::trust::Trust;
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

/// Stores a block of trusts, given as their numbers.
///
/// # Panics
/// If a number is no [`Trust`]'s, or the block does not fit.
#[inline(always)]
pub(crate) fn store_trust<V: super::Lanes>(v: V, to: &mut [Trust], at: usize, trust: V::B) {
    let known = v.eq8(v.max8(trust, v.splat8(Trust::LAST)), v.splat8(Trust::LAST));
    assert!(v.all8(known), "a number that is no trust");
    // SAFETY: `Trust` is one byte, and the bytes that are stored are all numbers of a `Trust`, asserted above.
    let bytes = unsafe { core::slice::from_raw_parts_mut(to.as_mut_ptr().cast(), to.len()) };
    v.store8(bytes, at, trust);
}
