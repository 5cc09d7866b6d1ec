//! The two precisions of floating point, as the platform computes them.

use std::ops::{Add, Div, Mul, Sub};

/// `f32` or `f64`.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The nearest value to a number.
    fn of(x: f64) -> Self;
    /// The value of a sample, exactly.
    fn count(sample: u16) -> Self;
    /// As `f64`.
    fn wide(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The angle of (other, self), radians.
    fn atan2(self, other: Self) -> Self;
    /// The whole number below.
    fn floor(self) -> Self;
    /// The nearest whole number.
    fn round(self) -> Self;
}

macro_rules! real {
    ($float:ident) => {
        impl Real for $float {
            fn of(x: f64) -> Self {
                x as Self
            }
            fn count(sample: u16) -> Self {
                Self::from(sample)
            }
            fn wide(self) -> f64 {
                self.into()
            }
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            fn atan2(self, other: Self) -> Self {
                self.atan2(other)
            }
            fn floor(self) -> Self {
                self.floor()
            }
            fn round(self) -> Self {
                self.round()
            }
        }
    };
}

real!(f32);
real!(f64);
