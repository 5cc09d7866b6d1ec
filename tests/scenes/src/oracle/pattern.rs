//! The phase function Φ_P(ξ, η) of a recorded pattern.

use hal::replay::Recording;
use hal::replay::recording::PatternSpec;

/// A pattern on its projector.
#[derive(Clone, Debug)]
pub struct Pattern {
    spec: PatternSpec,
    columns: f64,
    rows: f64,
}

impl Pattern {
    /// Pattern number `at` of a recording.
    pub fn of(recording: &Recording, at: usize) -> Self {
        Self::new(
            recording.patterns[at].clone(),
            recording.projector.width,
            recording.projector.height,
        )
    }

    /// A pattern on a projector of `columns` × `rows` pixels.
    pub fn new(spec: PatternSpec, columns: u32, rows: u32) -> Self {
        Self {
            spec,
            columns: f64::from(columns),
            rows: f64::from(rows),
        }
    }

    /// Whether the phase function is given by samples.
    pub fn is_sampled(&self) -> bool {
        matches!(self.spec, PatternSpec::File { .. })
    }

    /// Φ_P in turns at any point.
    pub fn at(&self, xi: f64, eta: f64) -> f64 {
        match &self.spec {
            PatternSpec::Vertical { fringes } => fringes * xi / self.columns,
            PatternSpec::Horizontal { fringes } => fringes * eta / self.rows,
            PatternSpec::File {
                rows,
                columns,
                turns,
            } => catmull_rom(eta, |row| {
                extended(row, *rows, |row| {
                    catmull_rom(xi, |column| {
                        extended(column, *columns, |column| turns[row * columns + column])
                    })
                })
            }),
        }
    }

    /// Smallest and largest Φ_P over the projector's pixel centres.
    pub fn range(&self) -> (f64, f64) {
        match &self.spec {
            PatternSpec::Vertical { .. } => (0.0, self.at(self.columns - 1.0, 0.0)),
            PatternSpec::Horizontal { .. } => (0.0, self.at(0.0, self.rows - 1.0)),
            PatternSpec::File { turns, .. } => turns
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| {
                    (low.min(*t), high.max(*t))
                }),
        }
    }
}

/// The Catmull–Rom spline through samples at the integers (Catmull & Rom 1974): a cubic with the
/// slopes (p₁ − p₋₁)/2 and (p₂ − p₀)/2 at its ends, in Hermite form.
fn catmull_rom(x: f64, sample: impl Fn(i64) -> f64) -> f64 {
    let cell = x.floor();
    let t = x - cell;
    let i = cell as i64;
    let (p0, p1) = (sample(i), sample(i + 1));
    let m0 = (p1 - sample(i - 1)) / 2.0;
    let m1 = (sample(i + 2) - p0) / 2.0;
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * p0
        + (t3 - 2.0 * t2 + t) * m0
        + (3.0 * t2 - 2.0 * t3) * p1
        + (t3 - t2) * m1
}

/// Sample `i`, going on linearly beyond both ends.
fn extended(i: i64, count: usize, sample: impl Fn(usize) -> f64) -> f64 {
    let last = count as i64 - 1;
    if i < 0 {
        sample(0) + i as f64 * (sample(1) - sample(0))
    } else if i > last {
        sample(count - 1) + (i - last) as f64 * (sample(count - 1) - sample(count - 2))
    } else {
        sample(i as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spline_goes_through_its_samples_and_on_in_a_line() {
        let (rows, columns) = (4, 5);
        let turns: Vec<f64> = (0..20)
            .map(|i| f64::from(i % 5).powi(2) + f64::from(i / 5))
            .collect();
        let spec = PatternSpec::File {
            rows,
            columns,
            turns: turns.clone(),
        };
        let pattern = Pattern::new(spec, 5, 4);
        for (i, turns) in turns.iter().enumerate() {
            let (xi, eta) = ((i % 5) as f64, (i / 5) as f64);
            assert!((pattern.at(xi, eta) - turns).abs() < 1e-12);
        }
        // Beyond the last column the slope is that of the last two samples, 16 − 9.
        let step = pattern.at(31.5, 1.0) - pattern.at(30.5, 1.0);
        assert!((step - 7.0).abs() < 1e-9);
        // Inside, a quadratic is met exactly: central differences have the slope of a parabola.
        assert!((pattern.at(1.5, 0.0) - 2.25).abs() < 1e-12);
    }
}
