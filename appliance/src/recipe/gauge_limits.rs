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
            let [low, high] = tolerance.limits(middle);
            [self.low, self.high] = [low.filter(|low| self.can_miss(*low)), high];
        }
    }

    /// Whether a value can lie below a limit: one that is never negative is never below 0.
    pub(super) fn can_miss(&self, low: f64) -> bool {
        low >= 0.0 || !self.measures.facts().never_negative
    }

    /// Takes over what golden reads; its limits follow.
    pub(super) fn set_golden(&mut self, golden: Option<&Reading>) {
        if self.needs_golden() {
            self.golden_value = golden.map(|reading| reading.value);
            self.set_limits();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use algo::inspect::kinds::{Flatness, MeanHeight};

    #[test]
    fn a_value_that_is_never_negative_gets_no_limit_below_0() {
        let limits = |measures: algo::inspect::Measure| {
            let mut gauge = GaugeFile::new(1, "gauge", measures, &["face"]);
            gauge.tolerance = Some(Tolerance {
                about: About::Golden,
                plus: Some(0.1),
                minus: Some(0.1),
            });
            gauge.golden_value = Some(0.02);
            gauge.set_limits();
            [gauge.low, gauge.high].map(|limit| limit.map(|limit| (limit * 100.0).round()))
        };
        let flatness = Flatness { smoothing_px: 9 };
        assert_eq!(limits(flatness.into()), [None, Some(12.0)]);
        assert_eq!(limits(MeanHeight {}.into()), [Some(-8.0), Some(12.0)]);
    }
}
