//! What inspecting parts needs, worked out once.

use super::anchors::{Anchors, anchors};
use crate::frame::SampleNoise;
use crate::geometry::{Triangulator, Vector};
use crate::inspect::align::{Alignment, Picture};
use crate::inspect::feature::Feature;
use crate::inspect::largest::Largest;
use crate::inspect::strips::accumulate::{Gauge, Gauges, Sections, Threshold, Unmeasurable};
use crate::inspect::strips::align::{Comparison, PoseField};
use crate::inspect::strips::golden::Golden;
use crate::inspect::strips::measure::PhasePlan;
use crate::inspect::strips::readings::{
    CalibrationUncertainty, Contours, ErrorBudget, Evaluation, GoldenSignal, Known, Levels,
    PlaneFit, ReadingPlan,
};
use crate::inspect::taught::Taught;
use crate::phase::Decoder;
use crate::pipeline::{HeightCubics, VARIANCE_UNIT_NM};
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Modulation};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

/// What production is made of.
#[derive(Debug)]
pub struct Parts {
    /// How frames become phases.
    pub decoder: Decoder,
    /// Exact heights.
    pub triangulator: Arc<Triangulator>,
    /// How phases become heights.
    pub cubics: Arc<HeightCubics>,
    /// Φ₀ that phases are unwrapped about and heights counted from, row-major, where it is not that
    /// of the cubics: a part of it, or the part's phase as taught by this sequence, where the
    /// cubics have that by another one.
    pub map: Option<Vec<AbsolutePhase>>,
    /// The part as taught.
    pub taught: Taught,
    /// What gauges are of. A feature without a gauge costs nothing.
    pub features: Vec<Feature>,
    /// What is measured.
    pub gauges: Vec<Gauge>,
    /// The columns of each row that are looked at: every gauge's region with half its smoothing and
    /// the part's motion around.
    pub window: Vec<Range<usize>>,
    /// The noise of one sample by this sequence.
    pub noise: SampleNoise,
    /// σ of a sample in counts, the same at all pixels, with which σ_z of the compared part as
    /// taught has the RMS that it has by `noise`.
    pub noise_counts: f64,
    /// Whether the part's motion is found and taken back.
    pub aligned: bool,
    /// How far a part may lie from its place as taught, mm.
    pub tolerance_mm: f64,
    /// σ of golden's heights, as a multiple of the taught σ, which is that of one measurement with
    /// this decoder.
    pub golden_noise: f64,
    /// Per gauge, what a deviation is on good parts whose only noise is golden's; of other gauges
    /// not used.
    pub largest: Vec<Largest>,
    /// Per gauge, what a deviation is on good parts that lie elsewhere than golden; none where it
    /// is not known.
    pub displaced: Vec<Option<Largest>>,
    /// The error of the head's calibration.
    pub calibration: CalibrationUncertainty,
    /// RMS of the periodic error of a mean height by this sequence, mm.
    pub ripple: f64,
    /// Heights that lie so many mm behind golden's, or farther, are those of the part's surroundings;
    /// `None` where nothing else is seen.
    pub surroundings: Option<f64>,
    /// The plane that the part lies on: z at x = y = 0, mm, and its rise along x and y.
    pub ground: Option<[f64; 3]>,
    /// How contours are demodulated, and golden's light; only read if gauges are of contours.
    pub light: Option<(Levels, GoldenSignal)>,
}

/// Everything that inspecting parts needs, worked out once: the plan of each stage.
#[derive(Debug)]
pub struct Production {
    pub(super) golden: Golden,
    pub(super) phase: PhasePlan,
    /// None where parts are taken to lie as taught.
    pub(super) alignment: Option<Alignment>,
    /// None where the motion is found without it.
    pub(super) picture: Option<Picture>,
    pub(super) gauges: Gauges,
    /// The contours that the part is placed by where heights leave its motion open.
    pub(super) anchors: Anchors,
    pub(super) sections: Sections,
    pub(super) readings: ReadingPlan,
}

impl Production {
    /// Joins what is known of head and part.
    ///
    /// # Errors
    /// If there are too many gauges or features, a gauge's kind does not measure its features, one's
    /// squares are so large that sums of heights over them could overflow, or so small that there
    /// are too many, or golden does not have a contour that a gauge is of.
    pub fn new(parts: Parts) -> Result<Self, Unmeasurable> {
        let Parts {
            decoder,
            triangulator,
            cubics,
            map,
            taught,
            features,
            gauges,
            window,
            noise,
            noise_counts,
            aligned,
            tolerance_mm,
            golden_noise,
            largest,
            displaced,
            calibration,
            ripple,
            surroundings,
            ground,
            light,
        } = parts;
        let turns = decoder.phase_noise(
            Modulation::from_bits(1),
            SampleNoise::constant(noise_counts),
        ) / cubics.range();
        let ground = ground.map(|plane| (plane, decoder.unwrapping().period()));
        let golden = Golden::new(triangulator, cubics, map, taught, window, ground);
        let alignment = match aligned {
            true => Alignment::new(golden.surface(), &golden.window),
            false => None,
        };
        let range = golden.triangulator.range();
        let span_nm = (range.high - range.low) * 1e6;
        let threshold = Threshold::new(&decoder, noise).in_front_of(surroundings);
        let surface = golden.surface();
        let gauges = Gauges::new(
            &features,
            gauges,
            surface,
            alignment.as_ref(),
            span_nm,
            threshold,
        )?;
        let planes = gauges.planes.iter().map(|&at| {
            let patch = &gauges.patches[at];
            PlaneFit::new(at, patch, &golden, features[patch.feature].thickness)
        });
        let planes: Vec<PlaneFit> = planes.collect();
        let full_scale = decoder.full_scale();
        let contours = match gauges.contours.first() {
            None => None,
            Some(&(feature, _)) => {
                let (levels, signal) = light.ok_or(Unmeasurable::NoContour { feature })?;
                let known = Known {
                    levels,
                    signal,
                    noise: noise_counts,
                    least: decoder.least_modulation().counts(full_scale),
                };
                let wanted = gauges.contours.iter().copied();
                Some(Contours::new(wanted, (&features, &planes), &golden, known)?)
            }
        };
        let is_open = alignment
            .as_ref()
            .is_some_and(|of| of.left_out.contains(&true));
        let anchors = match contours.as_ref().filter(|_| is_open) {
            Some(contours) => anchors(contours, &planes, &gauges.list),
            None => Anchors::new(),
        };
        let sections = Sections::new(gauges.sections.iter().copied(), &features, &golden);
        let sections = sections.map_err(|feature| Unmeasurable::NoSection { feature })?;
        Ok(Self {
            sections,
            anchors,
            readings: ReadingPlan {
                planes,
                contours,
                budget: ErrorBudget {
                    golden_noise,
                    largest,
                    displaced,
                    pixel_mm: golden.pixel_mm(),
                    calibration,
                    ripple,
                    shared: decoder.is_pair(),
                    pixels_per_spot: alignment.as_ref().map_or(1.0, Alignment::pixels_per_spot),
                },
                tolerance_mm,
            },
            phase: PhasePlan {
                decoder,
                noise,
                noise_counts,
                variance_scale: ((turns / VARIANCE_UNIT_NM) * (turns / VARIANCE_UNIT_NM)) as f32,
            },
            golden,
            alignment,
            picture: None,
            gauges,
        })
    }

    /// With golden's picture, from its modulation in counts (row-major), for parts within
    /// `tolerance_px` pixels. It is left out where it would not be looked at: where parts are not
    /// aligned, and, unless frames are a pair, where the shape determines their motion or edges say
    /// nothing of what the shape leaves free.
    #[must_use]
    pub fn with_picture(mut self, modulation: &[f32], tolerance_px: f64) -> Self {
        let pair = self.phase.decoder.is_pair();
        let needed = |open: &[bool; 6]| pair || open.contains(&true);
        let alignment = self.alignment.as_ref();
        let alignment = alignment.filter(|alignment| needed(&alignment.left_out));
        let picture = alignment.and_then(|alignment| {
            let (triangulator, surface) = (&self.golden.triangulator, self.golden.cubics.surface());
            let centre = alignment.centre;
            Picture::new(triangulator, surface, modulation, centre, tolerance_px)
        });
        let placed = alignment.and_then(|alignment| alignment.still(self.golden.surface()));
        let steers = |picture: &Picture| {
            let along = |placed| picture.steerable(&self.golden.triangulator, placed);
            placed
                .as_ref()
                .is_some_and(|placed| !along(placed).is_empty())
        };
        self.picture = picture.filter(|picture| pair || steers(picture));
        self
    }

    /// What stage 3 compares parts with that lie as in a field.
    pub(super) fn comparison<'a>(&'a self, pose: &'a PoseField) -> Comparison<'a> {
        Comparison {
            backend: self.phase.decoder.backend(),
            golden: &self.golden,
            pose,
        }
    }

    /// What stage 5 works readings out with.
    pub(super) fn evaluation(&self) -> Evaluation<'_> {
        Evaluation {
            golden: &self.golden,
            gauges: &self.gauges,
            sections: &self.sections,
            plan: &self.readings,
        }
    }

    /// The same on another back-end of this machine, with the same bits.
    pub fn with_backend(mut self, backend: Backend) -> Self {
        self.phase.decoder = self.phase.decoder.with_backend(backend);
        self
    }

    /// Corners of the box around the part as taught, mm; none if parts are not aligned.
    pub fn corners(&self) -> &[Vector] {
        self.alignment.as_ref().map_or(&[], Alignment::corners)
    }

    /// The columns of each row that are looked at.
    pub fn window(&self) -> &[Range<usize>] {
        &self.golden.window
    }

    /// Bytes of the cells and regions of its gauges.
    pub fn gauge_bytes(&self) -> usize {
        self.gauges.bytes()
    }

    /// The gauges, in the order of their readings.
    pub fn gauges(&self) -> &[Gauge] {
        &self.gauges.list
    }

    /// How phases become heights.
    pub fn cubics(&self) -> &HeightCubics {
        &self.golden.cubics
    }

    /// How frames become phases.
    pub fn decoder(&self) -> &Decoder {
        &self.phase.decoder
    }

    /// Exact heights.
    pub fn triangulator(&self) -> &Triangulator {
        &self.golden.triangulator
    }

    /// The same, to be kept.
    pub fn shared_triangulator(&self) -> Arc<Triangulator> {
        Arc::clone(&self.golden.triangulator)
    }

    /// The map that phases are unwrapped about, row-major.
    pub fn map(&self) -> &[AbsolutePhase] {
        self.golden.map()
    }
}
