//! What inspecting parts needs, worked out once.

use super::coverage::Threshold;
use super::gauges::{Gauge, Gauges, Unmeasurable};
use super::taught::Taught;
use super::uncertainty::CalibrationError;
use crate::frame::SampleNoise;
use crate::geometry::{Triangulator, Vector};
use crate::inspect::Largest;
use crate::inspect::align::{Alignment, GoldenSurface, levels};
use crate::phase::Decoder;
use crate::pipeline::{HeightCubics, VARIANCE_UNIT_NM};
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Height, Modulation};
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
    pub calibration: CalibrationError,
    /// RMS of the periodic error of a mean height by this sequence, mm.
    pub ripple: f64,
}

/// Everything that inspecting parts needs, worked out once.
#[derive(Debug)]
pub struct Production {
    pub(super) decoder: Decoder,
    /// Φ₀ that phases are unwrapped about, where it is not that of the cubics.
    pub(super) map: Option<Vec<AbsolutePhase>>,
    pub(super) triangulator: Arc<Triangulator>,
    pub(super) cubics: Arc<HeightCubics>,
    pub(super) taught: Taught,
    /// Columns of each row that are looked at.
    pub(super) window: Vec<Range<usize>>,
    /// Pixels inside the window that are compared.
    pub(super) compared: u64,
    /// See [`Parts`].
    pub(super) noise: SampleNoise,
    pub(super) noise_counts: f64,
    /// The same as [`crate::pipeline::CubicInput::noise`].
    pub(super) variance_scale: f32,
    /// None where parts are taken to lie as taught.
    pub(super) alignment: Option<Alignment>,
    /// The middle of golden's heights and half their span, mm.
    pub(super) levels: (f64, f64),
    pub(super) gauges: Gauges,
    /// See [`Parts`].
    pub(super) golden_noise: f64,
    pub(super) largest: Vec<Largest>,
    pub(super) displaced: Vec<Option<Largest>>,
    /// What a pixel in the middle of the frame sees of a surface at the middle height, mm.
    pub(super) pixel_mm: f64,
    pub(super) calibration: CalibrationError,
    pub(super) ripple: f64,
}

impl Production {
    /// Joins what is known of head and part.
    ///
    /// # Errors
    /// If there are too many gauges, or one's squares are so large that sums of heights over them
    /// could overflow, or so small that there are too many.
    pub fn new(parts: Parts) -> Result<Self, Unmeasurable> {
        let Parts {
            decoder,
            triangulator,
            cubics,
            map,
            mut taught,
            gauges,
            window,
            noise,
            noise_counts,
            aligned,
            golden_noise,
            largest,
            displaced,
            calibration,
            ripple,
        } = parts;
        let width = cubics.surface().width;
        taught.mark_squares(width.max(1));
        let compared = window.iter().enumerate().map(|(v, columns)| {
            let row = v * width + columns.start..v * width + columns.end;
            row.filter(|&place| taught.compared(place)).count() as u64
        });
        let compared = compared.sum();
        let turns = decoder.phase_noise(
            Modulation::from_bits(1),
            SampleNoise::constant(noise_counts),
        ) / cubics.range();
        let golden = GoldenSurface {
            triangulator: &triangulator,
            surface: cubics.surface(),
            taught: &taught,
        };
        let alignment = match aligned {
            true => Alignment::new(golden, &window),
            false => None,
        };
        let range = triangulator.range();
        let span_nm = (range.high - range.low) * 1e6;
        let threshold = Threshold::new(&decoder, noise);
        let gauges = Gauges::new(gauges, golden, alignment.as_ref(), span_nm, threshold)?;
        let levels = levels(&cubics.surface().height, width, &window);
        let height = Height::from_mm(levels.0);
        let middle = (width / 2, window.len() / 2);
        let sees = |u: usize| triangulator.point(u, middle.1, height);
        let pixel = sees(middle.0).zip(sees(middle.0 + 1));
        Ok(Self {
            levels,
            pixel_mm: pixel.map_or(0.0, |(one, next)| (next - one).length()),
            variance_scale: ((turns / VARIANCE_UNIT_NM) * (turns / VARIANCE_UNIT_NM)) as f32,
            decoder,
            map,
            triangulator,
            cubics,
            taught,
            window,
            compared,
            noise,
            noise_counts,
            alignment,
            gauges,
            golden_noise,
            largest,
            displaced,
            calibration,
            ripple,
        })
    }

    /// Columns and rows of the frame.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.cubics.surface().width, self.window.len())
    }

    pub(super) fn golden(&self) -> GoldenSurface<'_> {
        GoldenSurface {
            triangulator: &self.triangulator,
            surface: self.cubics.surface(),
            taught: &self.taught,
        }
    }

    /// The same on another back-end of this machine, with the same bits.
    pub fn with_backend(self, backend: Backend) -> Self {
        let decoder = self.decoder.with_backend(backend);
        Self { decoder, ..self }
    }

    /// Corners of the box around the part as taught, mm; none if parts are not aligned.
    pub fn corners(&self) -> &[Vector] {
        self.alignment.as_ref().map_or(&[], Alignment::corners)
    }

    /// The columns of each row that are looked at.
    pub fn window(&self) -> &[Range<usize>] {
        &self.window
    }

    /// The gauges, in the order of their readings.
    pub fn gauges(&self) -> &[Gauge] {
        &self.gauges.list
    }

    /// How phases become heights.
    pub fn cubics(&self) -> &HeightCubics {
        &self.cubics
    }

    /// How frames become phases.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Exact heights.
    pub fn triangulator(&self) -> &Triangulator {
        &self.triangulator
    }
}
