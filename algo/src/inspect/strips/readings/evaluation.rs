//! Stage 5, gauge: its plan, and its steps in their order.

use super::contours::{ContourFit, Contours, FoundFeature, REACH_MM, Signal};
use super::deviation::SquareNoise;
use super::findings::{Findings, Skipped};
use super::joints::SectionFit;
use super::planes::PlaneFit;
use super::uncertainty::{ErrorBudget, Taken};
use crate::inspect::align::Placed;
use crate::inspect::contour::State;
use crate::inspect::feature::{Cell, Sum};
use crate::inspect::gauge::Reading;
use crate::inspect::strips::accumulate::squares::extreme::Extreme;
use crate::inspect::strips::accumulate::{
    Gauges, MAX_FEATURES, MAX_GAUGES, Sections, StripSums, TRUSTS, add_up,
};
use crate::inspect::strips::align::PoseField;
use crate::inspect::strips::golden::Golden;
use crate::phase::Trust;
use crate::pipeline::{HeightTally, VARIANCE_UNIT_NM, for_each, for_each_item};
use alloc::vec;
use alloc::vec::Vec;

/// What is planned of readings.
#[derive(Debug)]
pub struct ReadingPlan {
    /// The planes of features as taught.
    pub planes: Vec<PlaneFit>,
    /// `None` if no gauge is of one.
    pub contours: Option<Contours>,
    pub budget: ErrorBudget,
    /// How far a part may lie from its place as taught, mm.
    pub tolerance_mm: f64,
}

/// This plan with those of the stages before.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation<'a> {
    pub golden: &'a Golden,
    pub gauges: &'a Gauges,
    pub sections: &'a Sections,
    pub plan: &'a ReadingPlan,
}

/// What is found of a part, with its buffers.
#[derive(Debug)]
pub struct PartFeatures {
    pub cells: CellBuffers,
    /// One per plane that a gauge needs.
    pub fits: Vec<PlaneFit>,
    /// One per contour that a gauge needs.
    pub contours: Vec<ContourFit>,
    /// One per section that a gauge needs.
    pub joints: Vec<SectionFit>,
}

/// Buffers for the cells of one gauge after the other.
#[derive(Debug, Default)]
pub struct CellBuffers {
    pub sums: Vec<Sum>,
    pub cells: Vec<Cell>,
    pub weights: Vec<f64>,
}

/// The noise of the pixels of a square of so many pixels a side: its rows are measured once more.
pub type NoiseOf<'a> = &'a mut dyn FnMut(&Extreme, usize) -> SquareNoise;

impl ReadingPlan {
    /// How far from its place on a part that lies so a contour may be, mm: a part is known to lie
    /// within the placement tolerance where nothing tells more.
    pub fn contour_reach_mm(&self, placed: Option<&Placed>) -> f64 {
        let is_open = placed.is_some_and(|placed| !placed.free.is_empty());
        REACH_MM + if is_open { self.tolerance_mm } else { 0.0 }
    }
}

impl PartFeatures {
    /// Nothing yet of what is planned.
    pub fn new(plan: &ReadingPlan, sections: &Sections) -> Self {
        let contours = plan.contours.as_ref().map_or(0, |of| of.all.len());
        Self {
            cells: CellBuffers::default(),
            fits: plan.planes.clone(),
            contours: vec![ContourFit::default(); contours],
            joints: vec![SectionFit::default(); sections.all.len()],
        }
    }
}

impl Evaluation<'_> {
    /// The findings of a part that lies as in a field, whose contours are found in this light.
    pub fn findings(
        &self,
        light: Signal<'_>,
        pose: &PoseField,
        sums: &mut [StripSums],
        noise_of: NoiseOf<'_>,
        found: &mut PartFeatures,
    ) -> Findings {
        let mut trusts = [0; TRUSTS];
        let mut tally = HeightTally::default();
        let mut exact = 0;
        for strip in &*sums {
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
        let taken = Taken {
            noisier: height_noise_mm / taught_noise_mm.max(f64::MIN_POSITIVE),
            unsteady: height_noise_mm * light.unsteady(),
        };
        // From the noise of independent pixels to that of the map.
        let windows = libm::sqrt(self.plan.budget.square_variance(1));
        self.fit(sums, pose, taken.noisier, &mut found.fits);
        self.find_contours(pose, light, found);
        self.find_joints(sums, found);
        let features = self.features(found);
        let readings: heapless::Vec<Option<Reading>, MAX_GAUGES> = (0..self.gauges.list.len())
            .map(|gauge| self.reading(gauge, taken, pose, sums, noise_of, found))
            .collect();
        let missing = |(gauge, reading): (usize, &Option<Reading>)| match reading {
            Some(_) => None,
            None => Some(self.missing(gauge, &features, sums)),
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
            placed: pose.placed.clone(),
            skipped: Skipped {
                outside: pixels - seen,
                unexpected: trusts[Trust::Unexpected as usize],
                dark: trusts[Trust::Dark as usize],
                exact,
            },
        }
    }

    /// Fits the planes of features, one per task.
    fn fit(&self, sums: &[StripSums], pose: &PoseField, noisier: f64, fits: &mut [PlaneFit]) {
        let placed = pose.placed.as_ref();
        for_each_item(fits, |fit: &mut PlaneFit| {
            let patch = &self.gauges.patches[fit.patch];
            add_up(sums, fit.patch, patch.grid.len(), &mut fit.sums);
            let side = patch.pixels().isqrt() as usize;
            let smoothed = self.plan.budget.square_variance(side);
            let pixel = patch.pixel_variance(false);
            let bend = placed.and_then(|placed| fit.bend(self.golden, &placed.motion));
            fit.find(patch, pixel * noisier * noisier * smoothed, bend);
        });
    }

    /// Finds the contours of features in their planes, one per task.
    fn find_contours(&self, pose: &PoseField, light: Signal<'_>, found: &mut PartFeatures) {
        let Some(contours) = &self.plan.contours else {
            return;
        };
        let PartFeatures {
            fits,
            contours: found,
            ..
        } = found;
        let (fits, placed) = (&fits[..], pose.placed.as_ref());
        let work: Vec<_> = found.iter_mut().zip(&contours.all).collect();
        let reach_mm = self.plan.contour_reach_mm(placed);
        for_each(work, |_, (found, expected)| {
            let plane = &fits[expected.plane];
            let expected = (contours, expected);
            found.find(expected, self.golden, plane, (placed, reach_mm), light);
        });
    }

    /// Finds the joints of sections in the points of all strips, one per task.
    fn find_joints(&self, sums: &[StripSums], found: &mut PartFeatures) {
        let work: Vec<_> = found.joints.iter_mut().zip(&self.sections.all).collect();
        for_each(work, |at, (found, expected)| {
            let points = sums.iter().map(|strip| &strip.sections.all[at][..]);
            found.find(expected, points, &self.plan.budget);
        });
    }

    /// The planes and contours that gauges need.
    fn features(&self, found: &PartFeatures) -> heapless::Vec<FoundFeature, MAX_FEATURES> {
        let own = |fit: &&PlaneFit| !found.contours.iter().any(|of| of.is_of(fit.feature));
        let planes = found.fits.iter().filter(own).map(|fit| {
            let geometry = fit.geometry();
            FoundFeature {
                feature: fit.feature,
                state: match geometry {
                    Some(_) => State::Found,
                    None => State::Unseen,
                },
                found: fit.share(&self.gauges.patches[fit.patch]),
                rim: None,
                lost: None,
                geometry,
            }
        });
        let contours = found.contours.iter().filter_map(|of| of.of.clone());
        let joints = found.joints.iter().filter_map(|of| of.of.clone());
        planes.chain(contours).chain(joints).collect()
    }
}
