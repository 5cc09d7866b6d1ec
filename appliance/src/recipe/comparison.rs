//! The fixed pattern against the adaptive one on the taught part, as measured while teaching with
//! equally many frames.

use algo::pattern::MAX_FRAMES;
use algo::phase::Trust;
use algo::pipeline::{HeightMap, PhaseMap};
use hal::bounded;
use hal::bounds::{Fields, MAX_SIGMA_MM};

bounded! {
    /// Both measurements.
    pub struct ComparisonFile {
        /// With straight, equidistant fringes.
        pub fixed: QualityFile = Fields,
        /// With the part's adaptive pattern.
        pub adaptive: QualityFile = Fields,
    }

    /// Noise and coverage of one measurement.
    #[derive(Copy)]
    pub struct QualityFile {
        /// Frames of the sequence.
        pub frames: usize = 1..=MAX_FRAMES,
        /// Predicted σ_z from the measured modulation, RMS over the pixels that both resolve, mm.
        pub sigma_mm: f64 = 0.0..=MAX_SIGMA_MM,
        /// Share of the frame that is resolved.
        pub coverage: f64 = 0.0..=1.0,
    }
}

/// A measurement with so many frames.
type Measurement<'a> = (usize, &'a PhaseMap, &'a HeightMap);

impl ComparisonFile {
    /// Compares a measurement with the fixed pattern and one with the adaptive pattern.
    pub fn of(fixed: Measurement<'_>, adaptive: Measurement<'_>) -> Self {
        let resolved =
            |(_, phases, _): Measurement<'_>, at: usize| phases.trust[at] == Trust::Resolved;
        let both: Vec<usize> = (0..fixed.1.trust.len())
            .filter(|&at| resolved(fixed, at) && resolved(adaptive, at))
            .collect();
        let quality = |(frames, phases, heights): Measurement<'_>| {
            let squares = both.iter().map(|&at| f64::from(heights.sigma[at]).powi(2));
            QualityFile {
                frames,
                sigma_mm: (squares.sum::<f64>() / both.len().max(1) as f64).sqrt(),
                coverage: phases.count(Trust::Resolved) as f64 / phases.trust.len().max(1) as f64,
            }
        };
        Self {
            fixed: quality(fixed),
            adaptive: quality(adaptive),
        }
    }
}
