//! What the limits of a gauge come from, and what another instrument has measured.

use super::gauge::GaugeFile;
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

impl GaugeFile {
    /// Whether golden must be measured for its limits or its master.
    pub fn needs_golden(&self) -> bool {
        let by_golden = |tolerance: &Tolerance| tolerance.about == About::Golden;
        self.master.is_some() || self.tolerance.as_ref().is_some_and(by_golden)
    }

    /// What its master makes of readings; none without a master.
    pub(super) fn substitution(&self) -> Option<Substitution> {
        let (Master { value, u }, golden) = self.master.zip(self.golden_value)?;
        let shift = value - golden;
        Some(Substitution { shift, u })
    }

    /// The middle of its tolerance, where it has one and that is known.
    pub(super) fn middle(&self) -> Option<f64> {
        match self.tolerance?.about {
            About::Nominal(nominal) => Some(nominal),
            // What golden reads with a master is the master's value.
            About::Golden => self.master.map(|master| master.value).or(self.golden_value),
        }
    }

    /// Works out its limits, where they come from something that is known.
    pub(super) fn set_limits(&mut self) {
        if let Some((tolerance, middle)) = self.tolerance.zip(self.middle()) {
            [self.low, self.high] = tolerance.limits(middle);
        }
    }

    /// Takes over what golden reads; its limits follow.
    pub(super) fn set_golden(&mut self, golden: Option<&Reading>) {
        if self.needs_golden() {
            self.golden_value = golden.map(|reading| reading.value);
            self.set_limits();
        }
    }
}
