//! Axes: from values to pixels, and the values of ticks.

/// An axis.
pub struct Axis {
    logarithmic: bool,
    low: f64,
    high: f64,
    step: f64,
    ends: [f64; 2],
}

impl Axis {
    /// An axis over values with some space around them, drawn between the ends (pixels).
    pub fn over(values: Vec<f64>, from_zero: bool, ends: [f64; 2]) -> Self {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (least, most) = if least <= most {
            (least, most)
        } else {
            (0.0, 1.0)
        };
        let least = if from_zero { 0.0 } else { least };
        let span = (most - least).max(1e-3 * most.abs()).max(1e-9);
        let low = if from_zero { 0.0 } else { least - 0.09 * span };
        let high = most + 0.09 * span;
        Self {
            logarithmic: false,
            low,
            high,
            step: round_step((high - low) / 6.0),
            ends,
        }
    }

    /// A logarithmic axis over values above zero with some space around them; low and high are then
    /// decimal logarithms.
    pub fn decades(values: Vec<f64>, ends: [f64; 2]) -> Self {
        let logarithms = values.into_iter().filter(|value| *value > 0.0);
        let linear = Self::over(logarithms.map(f64::log10).collect(), false, ends);
        Self {
            logarithmic: true,
            ..linear
        }
    }

    /// The pixel of a value.
    pub fn at(&self, value: f64) -> f64 {
        let value = if self.logarithmic {
            value.log10()
        } else {
            value
        };
        let share = (value - self.low) / (self.high - self.low);
        self.ends[0] + share * (self.ends[1] - self.ends[0])
    }

    /// The values that get a tick.
    pub fn ticks(&self) -> Vec<f64> {
        if self.logarithmic {
            let decades = self.low.floor() as i32..=self.high.floor() as i32;
            let ticks = decades.flat_map(|n| [1.0, 2.0, 5.0].map(|m| m * 10_f64.powi(n)));
            let inside = |tick: &f64| (self.low..=self.high).contains(&tick.log10());
            return ticks.filter(inside).collect();
        }
        let (first, last) = (
            (self.low / self.step).ceil(),
            (self.high / self.step).floor(),
        );
        let count = (last - first).max(0.0) as usize;
        // Plus zero: no minus before a zero.
        (0..=count)
            .map(|i| (first + i as f64) * self.step + 0.0)
            .collect()
    }

    /// A tick's number.
    pub fn number(&self, value: f64) -> String {
        if self.logarithmic {
            // 2 × 10ⁿ is 0.2 or 200, not 0.20000000000000001.
            return format!("{}", (value * 1e6).round() / 1e6);
        }
        let digits = (-self.step.log10().floor() + 1e-9).max(0.0) as usize;
        format!("{value:.digits$}")
    }
}

/// The smallest of 1, 2, 5 × 10ⁿ that is at least `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade);
    let found = steps.into_iter().find(|step| *step >= least * 0.999_999);
    found.unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis_has_equal_steps_for_equal_factors() {
        let axis = Axis::decades(vec![0.5, 50.0], [0.0, 100.0]);
        let steps = [0.5, 5.0, 50.0].map(|value| axis.at(value));
        assert!((steps[1] - steps[0] - (steps[2] - steps[1])).abs() < 1e-9);
        let ticks: Vec<String> = axis.ticks().iter().map(|tick| axis.number(*tick)).collect();
        assert_eq!(ticks, ["0.5", "1", "2", "5", "10", "20", "50"]);
    }
}
