//! How much a pixel's deviation counts in the mean over a square: its weight, and the share of a
//! height difference that lies along the surface's normal.
//!
//! Weights are in the recipe's `valid.npy`; teaching sets them (`set_limits` in the daemon's
//! `recipe/teach/limits.rs`).

/// The weight of a pixel as a byte: 0 if it is not compared, 1 if its deviation counts in full, n
/// from 2 on if its deviation is multiplied by n/256.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weight(u8);

/// Weights are multiples of 1/256.
const UNITS: f64 = 256.0;
/// A weight of fewer units, below 1/16, is 0.
const LEAST: f64 = 16.0;

impl Weight {
    /// Not compared.
    pub const NONE: Self = Self(0);
    /// Counts in full.
    pub const FULL: Self = Self(1);

    /// From a byte.
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits)
    }

    /// As a byte.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The largest weight that is not above a share.
    pub fn of_share(share: f64) -> Self {
        match libm::floor(share * UNITS) {
            units if units >= UNITS => Self::FULL,
            units if units >= LEAST => Self(units as u8),
            _ => Self::NONE,
        }
    }

    /// Whether the pixel is compared.
    pub fn compared(self) -> bool {
        self != Self::NONE
    }

    /// Whether the pixel counts with a weight below 1.
    pub fn partial(self) -> bool {
        self.0 > 1
    }

    /// As a number.
    pub fn share(self) -> f64 {
        match self.partial() {
            true => f64::from(self.0) / UNITS,
            false => f64::from(self.0),
        }
    }
}

/// What a height difference along a line of sight is multiplied by, as a byte: n stands for (n +
/// 1)/192, so that factors reach 1.33. It is the share of the difference that lies along the
/// surface's normal ([`normal_shares`](super::normal_shares)), times the pixel's [`Weight`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Factor(u8);

impl Factor {
    /// 1/192.
    pub const UNIT: f64 = 1.0 / 192.0;

    /// The factor nearest to a number.
    pub fn of(number: f64) -> Self {
        Self((libm::rint(number / Self::UNIT) - 1.0).clamp(0.0, f64::from(u8::MAX)) as u8)
    }

    /// As a number.
    pub fn number(self) -> f64 {
        f64::from(self.units()) * Self::UNIT
    }

    /// As a multiple of [`Self::UNIT`].
    #[inline(always)]
    pub fn units(self) -> i32 {
        i32::from(self.0) + 1
    }
}

impl From<bool> for Weight {
    /// Full weight if the pixel is compared, else none.
    fn from(compared: bool) -> Self {
        match compared {
            true => Self::FULL,
            false => Self::NONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_is_a_share_rounded_down_and_a_factor_the_nearest_one() {
        for (share, bits) in [(0.0, 0), (0.0624, 0), (0.0625, 16), (0.5, 128)] {
            assert_eq!(Weight::of_share(share).bits(), bits, "{share}");
        }
        for (share, bits) in [(0.999, 255), (1.0, 1), (7.0, 1), (f64::NAN, 0)] {
            assert_eq!(Weight::of_share(share).bits(), bits, "{share}");
        }
        for bits in 0..=255 {
            let weight = Weight::from_bits(bits);
            assert_eq!(weight.compared(), bits > 0);
            assert_eq!(weight.partial(), bits > 1);
        }
        for number in [1.33, 1.0, 0.75, 0.26, 1.0 / 192.0] {
            let factor = Factor::of(number).number();
            assert!((factor - number).abs() <= 0.5 / 192.0, "{number}");
        }
        assert_eq!(Factor::of(1.0).number(), 1.0);
        assert_eq!(Factor::of(0.0), Factor::of(1.0 / 192.0));
    }
}
