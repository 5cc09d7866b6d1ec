//! Quantities as types with their units: phases, modulations, heights. A position and a difference
//! are different types.
//!
//! ```compile_fail
//! use algo::units::AbsolutePhase;
//! // Two positions cannot be added; only a difference can be added to a position.
//! let _ = AbsolutePhase::from_bits(1) + AbsolutePhase::from_bits(2);
//! ```

use core::ops::{Add, Sub};

/// One turn of a [`WrappedPhase`], in its bits.
const WRAPPED_TURN: f64 = 65_536.0;

/// A phase within its fringe: the full range of `u16` is one turn, so the wrap of the integer is
/// the wrap of the phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct WrappedPhase(u16);

impl WrappedPhase {
    /// From units of 1/65536 turn.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// In units of 1/65536 turn.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// The nearest representable phase; whole turns drop out. A NaN becomes 0.
    pub fn from_turns(turns: f64) -> Self {
        let fraction = turns - libm::floor(turns);
        Self(libm::rint(fraction * WRAPPED_TURN) as u32 as u16)
    }

    /// In turns, 0 ≤ φ < 1.
    pub fn turns(self) -> f64 {
        f64::from(self.0) / WRAPPED_TURN
    }

    /// The signed difference `self − other` on the short way round, −½ ≤ δ < ½ turn.
    pub const fn difference(self, other: Self) -> PhaseDelta {
        PhaseDelta(self.0.wrapping_sub(other.0) as i16 as i32)
    }
}

/// An absolute phase Φ in turns of its phase function, Q16.16: the high half is the fringe order,
/// the low half the wrapped phase. ± 32,768 turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct AbsolutePhase(i32);

impl AbsolutePhase {
    /// "No phase is known here". No arithmetic gives this value: it saturates one above it.
    pub const UNKNOWN: Self = Self(i32::MIN);

    /// From units of 1/65536 turn.
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// In units of 1/65536 turn.
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// The nearest representable phase, [`Self::UNKNOWN`] for anything out of range or not finite.
    pub fn from_turns(turns: f64) -> Self {
        let bits = libm::rint(turns * WRAPPED_TURN);
        if bits > f64::from(i32::MIN) && bits <= f64::from(i32::MAX) {
            Self(bits as i32)
        } else {
            Self::UNKNOWN
        }
    }

    /// In turns.
    pub fn turns(self) -> f64 {
        f64::from(self.0) / WRAPPED_TURN
    }

    /// Whether this is a phase and not [`Self::UNKNOWN`].
    pub fn is_known(self) -> bool {
        self != Self::UNKNOWN
    }

    /// The fringe order k = ⌊Φ⌋.
    pub const fn order(self) -> FringeOrder {
        FringeOrder((self.0 >> 16) as i16)
    }

    /// The wrapped part φ = Φ − k.
    pub const fn wrapped(self) -> WrappedPhase {
        WrappedPhase(self.0 as u16)
    }

    /// From 64-bit units of 1/65536 turn, saturating short of [`Self::UNKNOWN`].
    pub(crate) fn saturate(bits: i64) -> Self {
        Self(bits.clamp(i64::from(i32::MIN) + 1, i64::from(i32::MAX)) as i32)
    }
}

impl Sub for AbsolutePhase {
    type Output = PhaseDelta;
    fn sub(self, other: Self) -> PhaseDelta {
        PhaseDelta(self.0.saturating_sub(other.0))
    }
}

impl Add<PhaseDelta> for AbsolutePhase {
    type Output = Self;
    fn add(self, delta: PhaseDelta) -> Self {
        Self::saturate(i64::from(self.0) + i64::from(delta.0))
    }
}

/// A difference of absolute phases, Q16.16 turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PhaseDelta(i32);

impl PhaseDelta {
    /// From units of 1/65536 turn.
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// In units of 1/65536 turn.
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// In turns.
    pub fn turns(self) -> f64 {
        f64::from(self.0) / WRAPPED_TURN
    }
}

/// The whole number of fringes in front of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FringeOrder(i16);

impl FringeOrder {
    /// The number itself.
    pub const fn get(self) -> i16 {
        self.0
    }
}

/// A modulation B as a share of full scale, in units of full scale / 65535, so that it means the
/// same at every bit depth. At 8 bit one count is exactly 257 units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Modulation(u16);

impl Modulation {
    /// From units of full scale / 65535.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// In units of full scale / 65535.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// In counts of a sample with this full scale (255 at 8 bit).
    pub fn counts(self, full_scale: u16) -> f64 {
        f64::from(self.0) * f64::from(full_scale) / 65_535.0
    }
}

/// A height z in nanometres above the reference plane; ± 2.1 m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Height(i32);

impl Height {
    /// "No height is known here".
    pub const UNKNOWN: Self = Self(i32::MIN);

    /// From nanometres.
    pub const fn from_nm(nm: i32) -> Self {
        Self(nm)
    }

    /// In nanometres.
    pub const fn nm(self) -> i32 {
        self.0
    }

    /// The nearest representable height, [`Self::UNKNOWN`] for anything out of range or not finite.
    pub fn from_mm(mm: f64) -> Self {
        let nm = libm::rint(mm * 1e6);
        if nm > f64::from(i32::MIN) && nm <= f64::from(i32::MAX) {
            Self(nm as i32)
        } else {
            Self::UNKNOWN
        }
    }

    /// In millimetres, NaN if unknown.
    pub fn mm(self) -> f64 {
        if self.is_known() {
            f64::from(self.0) / 1e6
        } else {
            f64::NAN
        }
    }

    /// Whether this is a height and not [`Self::UNKNOWN`].
    pub fn is_known(self) -> bool {
        self != Self::UNKNOWN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wrap_of_the_integer_is_the_wrap_of_the_phase() {
        let near_end = WrappedPhase::from_turns(0.99);
        let near_start = WrappedPhase::from_turns(0.01);
        let delta = near_start.difference(near_end);
        assert!((delta.turns() - 0.02).abs() < 2e-5);
        assert_eq!(WrappedPhase::from_turns(-0.25).to_bits(), 0xC000);
        assert_eq!(WrappedPhase::from_turns(0.999_999_9).to_bits(), 0);
    }

    #[test]
    fn order_and_wrapped_part_make_up_the_absolute_phase() {
        for turns in [-3.75, -0.5, 0.0, 12.25, 1000.125] {
            let phase = AbsolutePhase::from_turns(turns);
            let sum = f64::from(phase.order().get()) + phase.wrapped().turns();
            assert_eq!(sum, turns);
        }
    }

    #[test]
    fn what_cannot_be_represented_is_unknown_and_arithmetic_never_gives_it() {
        assert!(!AbsolutePhase::from_turns(f64::NAN).is_known());
        assert!(!AbsolutePhase::from_turns(40_000.0).is_known());
        assert!(!Height::from_mm(f64::INFINITY).is_known());
        let lowest = AbsolutePhase::from_bits(i32::MIN + 1);
        assert!((lowest + PhaseDelta::from_bits(-9)).is_known());
    }
}
