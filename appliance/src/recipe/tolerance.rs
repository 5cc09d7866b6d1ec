//! What the limits of a gauge come from, and what another instrument has measured.

use algo::inspect::Reading;

/// What limits are worked out from: they lie `minus` below and `plus` above a middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// The middle.
    pub about: About,
    /// How far above it the upper limit lies; none: there is no upper limit.
    pub plus: Option<f64>,
    /// How far below it the lower limit lies; none: there is no lower limit.
    pub minus: Option<f64>,
}

/// The middle of a tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum About {
    /// A value from the drawing.
    Nominal(f64),
    /// What the gauge reads of the part that was taught.
    Golden,
}

/// What another instrument has measured of the part that was taught (substitution, ISO
/// 15530-3:2011).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Master {
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty.
    pub u: f64,
}

/// What a master makes of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substitution {
    /// The master's value less golden's own, which is added to each value.
    shift: f64,
    /// The master's standard uncertainty.
    u: f64,
}

impl Substitution {
    /// By a master, in place of golden's own value.
    pub(super) fn new(master: Master, golden: f64) -> Self {
        Self {
            shift: master.value - golden,
            u: master.u,
        }
    }

    /// Value and systematic error of a reading. What the measurements of golden and of the part
    /// share is in the difference no more; golden's noise and the error over the displacement are.
    pub fn of(self, reading: &Reading) -> (f64, f64) {
        (reading.value + self.shift, reading.compared.hypot(self.u))
    }
}

impl Tolerance {
    /// The limits about this middle.
    pub fn limits(&self, middle: f64) -> [Option<f64>; 2] {
        [
            self.minus.map(|minus| middle - minus),
            self.plus.map(|plus| middle + plus),
        ]
    }
}
