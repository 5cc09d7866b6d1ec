//! The two precisions of floating point, as the platform computes them.

use std::ops::{Add, Div, Mul, Sub};

/// `f32` or `f64`.
pub trait Real:
    Copy
    + Send
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + From<u16>
    + Into<f64>
{
    /// The nearest value to a number.
    fn of(x: f64) -> Self;
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
