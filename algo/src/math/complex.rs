//! Complex numbers, as far as demodulated light needs them.

use core::f64::consts::TAU;
use core::ops::{Add, AddAssign, Mul, Sub};

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// Light that is not known: sums and products with it are not known either.
    pub const UNKNOWN: Self = Self::new(f64::NAN, f64::NAN);

    /// From its parts.
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// The number of length 1 at an angle in turns, |turns| < 2⁴⁰: Taylor's series about the nearest
    /// quarter of a turn, within 2e-9.
    pub fn turned(turns: f64) -> Self {
        // Added and taken away again, this rounds to whole numbers.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let quarters = 4.0 * turns;
        let whole = (quarters + WHOLE) - WHOLE;
        let x = TAU / 4.0 * (quarters - whole);
        let y = x * x;
        let sin = y * (1.0 / 120.0 - y * (1.0 / 5_040.0 - y / 362_880.0));
        let sin = x * (1.0 - y * (1.0 / 6.0 - sin));
        let cos = y * (1.0 / 720.0 - y * (1.0 / 40_320.0 - y / 3_628_800.0));
        let cos = 1.0 - y * (0.5 - y * (1.0 / 24.0 - cos));
        // Casts keep to the range of their type. Selections, not branches: quarters come at random.
        let quarter = whole as i64;
        let (re, im) = if quarter & 1 == 0 {
            (cos, sin)
        } else {
            (sin, cos)
        };
        let sign = |is_negative: bool| if is_negative { -1.0 } else { 1.0 };
        Self::new(
            re * sign((quarter + 1) & 2 != 0),
            im * sign(quarter & 2 != 0),
        )
    }

    /// Itself, if it is known.
    pub fn known(self) -> Option<Self> {
        (!self.re.is_nan()).then_some(self)
    }

    /// The conjugate.
    pub const fn conj(self) -> Self {
        Self::new(self.re, -self.im)
    }

    /// The scalar product of two numbers as vectors.
    pub fn dot(self, other: Self) -> f64 {
        self.re * other.re + self.im * other.im
    }

    /// The square of the length.
    pub fn square(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    /// The length.
    pub fn length(self) -> f64 {
        libm::sqrt(self.square())
    }

    /// The angle, −½ to ½ turn.
    pub fn turns(self) -> f64 {
        libm::atan2(self.im, self.re) / TAU
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl AddAssign for Complex {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.re * other.re - self.im * other.im,
            self.re * other.im + self.im * other.re,
        )
    }
}

impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.re * factor, self.im * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_turned_within_what_is_promised() {
        for i in -4000..4000 {
            let turns = f64::from(i) * 0.001_7;
            let (found, angle) = (Complex::turned(turns), TAU * turns);
            assert!((found.re - libm::cos(angle)).abs() < 2e-9, "{turns}");
            assert!((found.im - libm::sin(angle)).abs() < 2e-9, "{turns}");
        }
    }
}
