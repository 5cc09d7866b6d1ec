//! Stage 5, gauge: the sums of all strips → readings and their errors.

use super::contours::{FoundFeature, Signal};
use super::counts::TRUSTS;
use super::coverage;
use super::decode::Input;
use super::fits::Fit;
use super::gauges::{Gauge, MAX_FEATURES, MAX_GAUGES};
use super::plan::Production;
use super::pose::PoseField;
use super::squares::extreme::Extreme;
use super::squares::rivals::rivals;
use super::strip::{CellBuffers, Strip, Strips};
use super::uncertainty::Made;
use crate::inspect::align::Placed;
use crate::inspect::contour::State;
use crate::inspect::feature::{Sum, TaughtCell, cells};
use crate::inspect::gauge::{Basis, Evidence, Facts, MAX_PLACES, Reading};
use crate::phase::Trust;
use crate::pipeline::{VARIANCE_UNIT_NM, for_each_item};
use alloc::vec::Vec;

/// Everything that is known of a part after one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Per gauge; `None` where there was nothing to measure.
    pub readings: heapless::Vec<Option<Reading>, MAX_GAUGES>,
    /// Per gauge without a value, why.
    pub missing: heapless::Vec<Option<Missing>, MAX_GAUGES>,
    /// The planes and contours that gauges need.
    pub features: heapless::Vec<FoundFeature, MAX_FEATURES>,
    /// Pixels with a height.
    pub resolved: u64,
    /// Share of the compared surface inside the window that has a height.
    pub coverage: f64,
    /// RMS of σ_z over the compared pixels, mm; 0 if there are none.
    pub height_noise_mm: f64,
    /// RMS of the taught σ_z over the pixels with a height, mm; 0 if there are none.
    pub taught_noise_mm: f64,
    /// Share of the pixels with enough light whose levels contradict each other.
    pub contradicting: f64,
    /// How the part lies; none if it was not aligned.
    pub placed: Option<Placed>,
    /// What was not computed.
    pub skipped: Skipped,
}

/// Why a gauge has no value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Missing {
    /// There was nothing to measure.
    Nothing,
    /// Of cells: which share of each of its features as taught was measured.
    Cells([f64; MAX_PLACES]),
    /// One of [`Findings::features`] was not found.
    Feature(usize),
    /// The value depends on how the part lies along a direction that its shape leaves open.
    Open,
}

/// What was not computed, or not by the fast way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Skipped {
    /// Pixels outside of every gauge's region and smoothing.
    pub outside: u64,
    /// Pixels without a known phase to unwrap about.
    pub unexpected: u64,
    /// Pixels that the pattern's light does not reach, without finer levels.
    pub dark: u64,
    /// Heights too far from golden for the cubics, triangulated exactly.
    pub exact: u64,
}

impl Production {
    pub(super) fn findings(
        &self,
        (input, light): (Input<'_>, Signal<'_>),
        strips: &mut Strips,
    ) -> Findings {
        let mut trusts = [0; TRUSTS];
        let mut tally = crate::pipeline::HeightTally::default();
        let mut exact = 0;
        for strip in &strips.strips {
            tally.add(&strip.counts.tally);
            exact += strip.counts.exact;
            for (all, here) in trusts.iter_mut().zip(&strip.counts.trusts) {
                *all += here;
            }
        }
        let seen: u64 = trusts.iter().sum();
        let pixels = self.golden.cubics.surface().phase.len() as u64;
        let rms_mm = |sum: u64, count: u64| {
            libm::sqrt(sum as f64 / count.max(1) as f64) * VARIANCE_UNIT_NM * 1e-6
        };
        let (height_noise_mm, taught_noise_mm) = (
            rms_mm(tally.variance, tally.summed),
            rms_mm(tally.taught_variance, tally.taught),
        );
        // The ratio of σ_z to that as taught.
        let noisier = height_noise_mm / taught_noise_mm.max(f64::MIN_POSITIVE);
        // From the noise of independent pixels to that of the map.
        let windows = libm::sqrt(self.budget.square_variance(1));
        self.fit(strips, noisier);
        self.find_contours(strips, light);
        self.find_sections(strips);
        let features = self.features(strips);
        let readings: heapless::Vec<Option<Reading>, MAX_GAUGES> = (0..self.gauges.list.len())
            .map(|gauge| self.reading(gauge, input, noisier, strips))
            .collect();
        let missing = |(gauge, reading): (usize, &Option<Reading>)| match reading {
            Some(_) => None,
            None => Some(self.missing(gauge, &features, &strips.strips)),
        };
        let missing = readings.iter().enumerate().map(missing).collect();
        let count = |trust: Trust| trusts[trust as usize];
        let contradicting = count(Trust::Residual);
        Findings {
            readings,
            missing,
            features,
            resolved: trusts[Trust::Resolved as usize],
            coverage: tally.compared as f64 / self.golden.compared.max(1) as f64,
            height_noise_mm: height_noise_mm * windows,
            taught_noise_mm: taught_noise_mm * windows,
            contradicting: contradicting as f64
                / (contradicting + count(Trust::Resolved)).max(1) as f64,
            placed: strips.pose.placed.clone(),
            skipped: Skipped {
                outside: pixels - seen,
                unexpected: trusts[Trust::Unexpected as usize],
                dark: trusts[Trust::Dark as usize],
                exact,
            },
        }
    }

    /// The reading of a gauge; `noisier` is the ratio of σ_z to that as taught.
    fn reading(
        &self,
        gauge: usize,
        input: Input<'_>,
        noisier: f64,
        strips: &mut Strips,
    ) -> Option<Reading> {
        let Strips {
            strips,
            pose,
            cells,
            fits,
            contours,
            sections,
            ..
        } = strips;
        match self.gauges.list[gauge].measure.facts().basis {
            Basis::Pixels => {
                let pixels = self.gauges.region(pose, gauge)?.len();
                let (mut covered, mut variance) = (0, 0);
                for strip in strips {
                    covered += strip.counts.covered[gauge];
                    variance += strip.counts.variance[gauge];
                }
                (pixels > 0).then(|| Reading {
                    value: covered as f64 / pixels as f64,
                    sigma: Some(coverage::sigma(variance, pixels)),
                    expected: None,
                    systematic: 0.0,
                    compared: 0.0,
                    rims: 0.0,
                    square: None,
                })
            }
            Basis::Squares(_) => {
                let mut largest: Option<Reading> = None;
                let squares = self.gauges.squares.iter().enumerate();
                for (at, squares) in squares.filter(|(_, squares)| squares.gauge == gauge) {
                    for below in 1..strips.len() {
                        if let [above, below] = &mut strips[below - 1..=below] {
                            below.squares.extremes[at].join(&mut above.squares.extremes[at]);
                        }
                    }
                    let found = rivals(strips.iter().map(|strip| &strip.squares.extremes[at]));
                    let (found, strip) = ((&found[..], squares.side), strips.first_mut()?);
                    let noise_of =
                        |square: &Extreme| strip.noise_of(self, pose, input, square, squares.side);
                    let (placed, gauge) = (pose.placed.as_ref(), (gauge, noisier));
                    let next = self.budget.deviation(found, noise_of, placed, gauge);
                    let less = |next: &Reading| {
                        largest.is_some_and(|of| libm::fabs(next.value) < libm::fabs(of.value))
                    };
                    largest = next.filter(|next| !less(next)).or(largest);
                }
                largest
            }
            Basis::Motion(component) => {
                let (value, sigma) = pose.placed.as_ref()?.component(component as usize)?;
                let budget = &self.budget;
                let systematic = libm::hypot(
                    sigma * libm::sqrt(budget.golden_variance(noisier) / budget.spot_variance()),
                    value * budget.calibration.length,
                );
                Some(Reading {
                    value,
                    sigma: Some(sigma),
                    expected: None,
                    systematic,
                    // A motion is what the part differs by from golden.
                    compared: systematic,
                    rims: 0.0,
                    square: None,
                })
            }
            Basis::Cells(_) | Basis::Region => self.of_cells(gauge, noisier, pose, strips, cells),
            Basis::Geometry => self.of_geometry(gauge, noisier, pose, (fits, contours)),
            Basis::Rim => self.of_rim(gauge, contours),
            Basis::Section => {
                let Gauge { of, measure, .. } = &self.gauges.list[gauge];
                let found = sections.iter().find(|section| section.is_of(of))?;
                found.reading(measure.kind(), self.budget.golden_variance(noisier))
            }
        }
    }

    /// The reading of a gauge of cells.
    fn of_cells(
        &self,
        gauge: usize,
        noisier: f64,
        pose: &PoseField,
        strips: &[Strip],
        buffers: &mut CellBuffers,
    ) -> Option<Reading> {
        let measure = &self.gauges.list[gauge].measure;
        let Facts {
            basis, compares, ..
        } = measure.facts();
        let side = basis.cell_side()?;
        let patches = &self.gauges.patches_of[gauge];
        let (&first, &last) = (patches.first()?, patches.last()?);
        buffers.cells.clear();
        buffers.weights.clear();
        let taught: &[TaughtCell] = &self.gauges.patches[first].taught;
        self.gather(first, side, strips, buffers);
        let count = buffers.cells.len();
        if patches.len() > 1 {
            // Both regions' cells behind each other: the motion moves them together.
            self.gather(last, side, strips, buffers);
        }
        let CellBuffers { cells, weights, .. } = buffers;
        if compares {
            for cell in &mut *cells {
                cell.deviation *= cell.taught.normal;
                cell.taught = cell.taught.along_normal();
            }
        }
        // A region without cells as a square of its area.
        let smoothed = self.budget.square_variance(match side {
            0 => pixels(taught).isqrt() as usize,
            side => side,
        });
        let variance = |taught| pixel_variance(taught, compares) * noisier * noisier * smoothed;
        let pixel = variance(taught);
        let from = variance(&self.gauges.patches[last].taught);
        let placed = pose.placed.as_ref();
        let mut found = measure.kind().find(Evidence {
            all: cells,
            count,
            columns: self.gauges.patches[first].grid.columns(),
            sigma: libm::sqrt(pixel) / side.max(1) as f64,
            variances: [pixel, from],
            placed,
            room: weights,
        })?;
        let made = match compares {
            true => {
                found.pixels *= self.budget.cells_together(side);
                Made::OfDeviations
            }
            false => Made::OfHeights,
        };
        Some(
            self.budget
                .reading_of(found, made, (noisier, smoothed), placed),
        )
    }

    /// Why a gauge has no value, where these features were found.
    fn missing(&self, gauge: usize, features: &[FoundFeature], strips: &[Strip]) -> Missing {
        let of = &self.gauges.list[gauge];
        let own = &self.gauges.patches_of[gauge];
        if !own.is_empty() {
            let mut shares = [1.0; MAX_PLACES];
            for (share, &patch) in shares.iter_mut().zip(own) {
                let had = pixels(&self.gauges.patches[patch].taught);
                let sums = strips.iter().flat_map(|strip| &strip.counts.cells[patch]);
                let has: i64 = sums.map(|sum| sum.count).sum();
                *share = has as f64 / f64::from(had.max(1));
            }
            return Missing::Cells(shares);
        }
        let needed = |feature: &FoundFeature| {
            of.of
                .iter()
                .chain(&of.datum)
                .any(|&at| at == feature.feature)
        };
        let lost = |feature: &&FoundFeature| needed(feature) && feature.state != State::Found;
        // What is absent makes a part bad only if nothing else is unseen.
        let mut all = features.iter().filter(lost);
        let first = all.clone().find(|feature| feature.state == State::Unseen);
        match first.or(all.next()) {
            Some(feature) => Missing::Feature(feature.feature),
            None if of.measure.facts().basis == Basis::Geometry => Missing::Open,
            None => Missing::Nothing,
        }
    }

    /// Fits the planes of features, one per task.
    fn fit(&self, strips: &mut Strips, noisier: f64) {
        let Strips {
            strips, fits, pose, ..
        } = strips;
        let placed = pose.placed.as_ref();
        let strips = &strips[..];
        for_each_item(fits, |fit: &mut Fit| {
            let patch = &self.gauges.patches[fit.patch];
            add_up(strips, fit.patch, patch.grid.len(), &mut fit.sums);
            let side = pixels(&patch.taught).isqrt() as usize;
            let smoothed = self.budget.square_variance(side);
            let pixel = pixel_variance(&patch.taught, false);
            let bend = placed.and_then(|placed| fit.bend(&self.golden, &placed.motion));
            fit.find(patch, pixel * noisier * noisier * smoothed, bend);
        });
    }

    /// Appends the cells of a patch.
    fn gather(&self, at: usize, side: usize, strips: &[Strip], buffers: &mut CellBuffers) {
        let patch = &self.gauges.patches[at];
        let CellBuffers {
            sums, cells: out, ..
        } = buffers;
        add_up(strips, at, patch.grid.len(), sums);
        let least = (side > 0).then(|| patch.grid.least());
        cells(sums, &patch.taught, least, out);
    }
}

/// The sums of all strips over the cells of a patch.
fn add_up(strips: &[Strip], patch: usize, cells: usize, sums: &mut Vec<Sum>) {
    sums.clear();
    sums.resize(cells, Sum::default());
    for strip in strips {
        for (sum, more) in sums.iter_mut().zip(&strip.counts.cells[patch]) {
            sum.add(more);
        }
    }
}

/// The pixels of cells as taught.
fn pixels(taught: &[TaughtCell]) -> u32 {
    taught.iter().map(|cell| cell.pixels).sum()
}

/// The mean variance of a pixel as taught, in height or along the normal, mm².
fn pixel_variance(taught: &[TaughtCell], along_normal: bool) -> f64 {
    let variances = taught.iter().map(|cell| match along_normal {
        true => cell.along_normal().variance,
        false => cell.variance,
    });
    let sum: f64 = variances.sum();
    sum / f64::from(pixels(taught).max(1))
}
