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
    /// From its parts.
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// The number of length 1 at an angle in turns.
    pub fn turned(turns: f64) -> Self {
        let angle = TAU * turns;
        Self::new(libm::cos(angle), libm::sin(angle))
    }

    /// The conjugate.
    pub const fn conj(self) -> Self {
        Self::new(self.re, -self.im)
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
