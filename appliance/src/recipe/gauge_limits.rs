//! The limits of a gauge where they come from something else, and its master.

use super::gauge::GaugeFile;
use super::tolerance::{About, Substitution, Tolerance};
use algo::inspect::Reading;

impl GaugeFile {
    /// Whether golden must be measured for its limits or its master.
    pub fn needs_golden(&self) -> bool {
        let by_golden = |tolerance: &Tolerance| tolerance.about == About::Golden;
        self.master.is_some() || self.tolerance.as_ref().is_some_and(by_golden)
    }

    /// What its master makes of readings; none without a master.
    pub(super) fn substitution(&self) -> Option<Substitution> {
        let (master, golden) = self.master.zip(self.golden_value)?;
        Some(Substitution::new(master, golden))
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
