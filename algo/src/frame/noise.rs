//! The noise of a sample by the light that its pixel gets.

/// σ of a sample by the light of its pixel, read noise and shot noise: σ² = read² + shot · I
/// (photon transfer: Janesick 1987).
///
/// The light is given by the mean signal I, or by the modulation B: both grow with the light that
/// the part returns ([`signal_by_modulation`](crate::pipeline::signal_by_modulation)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleNoise {
    /// Variance without light, counts².
    read: f64,
    /// Variance per count of light, counts.
    shot: f64,
}

impl SampleNoise {
    /// σ = `counts`, whatever the light.
    pub fn constant(counts: f64) -> Self {
        let read = counts * counts;
        Self { read, shot: 0.0 }
    }

    /// σ without light in counts, and the variance in counts² that a count of light adds.
    pub fn new(read_counts: f64, shot: f64) -> Self {
        let read = read_counts * read_counts;
        Self { read, shot }
    }

    /// σ without light, counts.
    pub fn read_counts(self) -> f64 {
        libm::sqrt(self.read)
    }

    /// Variance in counts² that a count of light adds.
    pub fn shot(self) -> f64 {
        self.shot
    }

    /// σ in counts with so many counts of light.
    pub fn at(self, light: f64) -> f64 {
        libm::sqrt(self.read + self.shot * light)
    }

    /// The noise as a function of another measure of the light: 0 counts of that measure are
    /// `offset` counts of the present one, and each further count is `slope` counts.
    #[must_use]
    pub fn by(self, [offset, slope]: [f64; 2]) -> Self {
        Self {
            read: self.read + self.shot * offset,
            shot: self.shot * slope,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_grows_with_the_light() {
        let noise = SampleNoise::new(0.5, 0.04);
        assert_eq!(noise.at(0.0), 0.5);
        assert!((noise.at(100.0) - libm::sqrt(4.25)).abs() < 1e-12);
        assert_eq!(noise.by([0.0, 0.5]).at(200.0), noise.at(100.0));
        assert_eq!(noise.by([20.0, 2.0]).at(40.0), noise.at(100.0));
        assert_eq!(SampleNoise::constant(2.0).at(77.0), 2.0);
    }
}
