//! What the strips of a frame found together.

use super::columns::TRUSTS;
use super::extreme::Extreme;
use super::{Measure, Production, Strip};
use crate::frame::FrameView;
use crate::inspect::Reading;
use crate::phase::Trust;
use crate::pipeline::VARIANCE_UNIT_NM;
use alloc::vec::Vec;

/// Everything that is known of a part after one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Per gauge; `None` where there was nothing to measure.
    pub readings: Vec<Option<Reading>>,
    /// Pixels with a height.
    pub resolved: u64,
    /// Share of the compared surface inside the window that has a height.
    pub coverage: f64,
    /// RMS of σ_z over the compared pixels, mm; 0 if there are none.
    pub height_noise_mm: f64,
    /// RMS of the taught σ_z over the pixels with a height, mm; 0 if there are none.
    pub taught_noise_mm: f64,
    /// What was not computed.
    pub skipped: Skipped,
}

/// What was not computed, or not by the fast way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// Pixels outside of every gauge's region and smoothing.
    pub outside: u64,
    /// Pixels where nothing is known to unwrap about.
    pub unexpected: u64,
    /// Pixels that the pattern's light does not reach, without finer levels.
    pub dark: u64,
    /// Heights too far from golden for the cubics, solved exactly.
    pub exact: u64,
}

impl Production {
    pub(super) fn findings(&self, frames: &[FrameView<'_>], strips: &mut [Strip]) -> Findings {
        let mut trusts = [0; TRUSTS];
        let mut tally = crate::pipeline::RowTally::default();
        let mut exact = 0;
        for strip in strips.iter() {
            tally.add(&strip.found.tally);
            exact += strip.found.exact;
            for (all, here) in trusts.iter_mut().zip(&strip.found.trusts) {
                *all += here;
            }
        }
        let seen: u64 = trusts.iter().sum();
        let pixels = self.rises.surface().phase.len() as u64;
        let rms_mm = |sum: u64, count: u64| {
            libm::sqrt(sum as f64 / count.max(1) as f64) * VARIANCE_UNIT_NM * 1e-6
        };
        Findings {
            readings: (0..self.gauges.len())
                .map(|gauge| self.reading(gauge, frames, strips))
                .collect(),
            resolved: trusts[Trust::Resolved as usize],
            coverage: tally.compared as f64 / self.compared.max(1) as f64,
            height_noise_mm: rms_mm(tally.variance, tally.compared),
            taught_noise_mm: rms_mm(tally.taught_variance, tally.taught),
            skipped: Skipped {
                outside: pixels - seen,
                unexpected: trusts[Trust::Unexpected as usize],
                dark: trusts[Trust::Dark as usize],
                exact,
            },
        }
    }

    fn reading(
        &self,
        gauge: usize,
        frames: &[FrameView<'_>],
        strips: &mut [Strip],
    ) -> Option<Reading> {
        let (region, measure) = &self.gauges[gauge];
        match *measure {
            Measure::Coverage => {
                let covered: u64 = strips.iter().map(|strip| strip.found.covered[gauge]).sum();
                Some(Reading {
                    value: covered as f64 / region.len().max(1) as f64,
                    sigma: None,
                })
            }
            Measure::Deviation { side } => {
                let extremes = strips
                    .iter()
                    .filter_map(|strip| strip.found.extremes[gauge]);
                let best =
                    extremes.reduce(|best, next| if next.reaches(&best) { next } else { best })?;
                let strip = strips.first_mut()?;
                Some(self.deviation(best, side, frames, strip))
            }
        }
    }

    /// The reading of a square; its σ is worked out here, for this one square alone.
    fn deviation(
        &self,
        best: Extreme,
        side: usize,
        frames: &[FrameView<'_>],
        strip: &mut Strip,
    ) -> Reading {
        let half = side / 2;
        let bottom = (best.row + half + 1).min(self.window.len());
        let mut variance = 0.0;
        for v in best.row.saturating_sub(half)..bottom {
            let window = &self.window[v];
            let left = best.column.saturating_sub(half).max(window.start);
            let right = (best.column + half + 1).min(window.end);
            if left < right {
                variance += strip.variance(self, frames, v, left..right);
            }
        }
        let count = best.count as f64;
        let sigma = libm::sqrt(variance) / count / 1e6;
        Reading {
            value: best.sum as f64 / count / 1e6,
            sigma: (sigma > 0.0).then_some(sigma),
        }
    }
}
