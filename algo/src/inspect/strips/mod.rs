//! From frames to the readings of gauges in one pass: strips of rows, each finished while it is in the cache.
//!
//! A strip decodes one row at a time, turns it into rises above the golden surface, counts, and slides the sums of each
//! smoothing down by a row; it keeps as many rows as the largest smoothing has. No map of the whole frame is written,
//! except that of the heights when somebody wants to see it. Strips overlap by half a smoothing. All sums are whole
//! numbers, so the findings do not depend on the number of strips or threads; they are those of
//! [`Comparison`](super::Comparison), which this is checked against.
//!
//! Where the part's motion is wanted, some rows are decoded beforehand and a few points of each kept: the motion is found
//! from these, in the order of the rows, and the strips then compare every pixel with the place of golden where the part had it.

mod columns;
mod displaced;
mod exact;
mod extreme;
mod findings;
mod light;
mod spots;
mod squares;
mod stance;
mod strip;

pub use findings::{Findings, Skipped};
pub use light::Light;
pub use strip::Strip;

use super::Region;
use super::align::{Alignment, GoldenSurface, Placed, levels};
use super::gauge::{Grid, Measure, TaughtCell, TooFine, taught_cells};
use crate::frame::FrameView;
use crate::geometry::{Triangulator, Vector};
use crate::phase::{DecodeError, Decoder};
use crate::pipeline::{COMPARED, Rises, SIGMA, SQUARE, VARIANCE_UNIT_NM, for_each};
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Modulation};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use stance::Stance;

/// A gauge: where it measures what.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    /// Where; empty for a placement.
    pub region: Region,
    /// The region that a step starts from.
    pub from: Option<Region>,
    /// What.
    pub measure: Measure,
}

/// The cells of a gauge's region.
#[derive(Debug)]
struct Patch {
    /// Which of the regions.
    region: usize,
    grid: Grid,
    taught: Vec<TaughtCell>,
}

/// The part as taught, as far as parts are compared with it; row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taught(Vec<u16>);

impl Taught {
    /// Unit of σ in nm.
    const SIGMA_UNIT_NM: f64 = 32.0;

    /// From where the part is compared and σ of its heights in mm, NaN where not known. σ is stored in units of 32 nm, at
    /// most half a mm.
    pub fn new(pixels: impl Iterator<Item = (bool, f64)>) -> Self {
        let stored = |(compared, mm): (bool, f64)| {
            let units = libm::rint(mm * 1e6 / Self::SIGMA_UNIT_NM);
            let sigma = match units.is_finite() {
                true => units.clamp(1.0, f64::from(SIGMA)) as u16,
                false => 0,
            };
            sigma | if compared { COMPARED } else { 0 }
        };
        Self(pixels.map(stored).collect())
    }

    /// Marks the places where the four pixels to the right and below are all compared.
    fn mark_squares(&mut self, width: usize) {
        for place in 0..self.0.len().saturating_sub(width + 1) {
            let corners = [place, place + 1, place + width, place + width + 1];
            if place % width + 1 < width && corners.iter().all(|&at| self.compared(at)) {
                self.0[place] |= SQUARE;
            }
        }
    }

    /// Whether the part is compared at a place.
    pub(super) fn compared(&self, place: usize) -> bool {
        self.0[place] & COMPARED != 0
    }

    /// σ in its units.
    fn sigma(&self, place: usize) -> u16 {
        self.0[place] & SIGMA
    }

    /// σ in mm, 0 where not known.
    pub(super) fn sigma_mm(&self, place: usize) -> f64 {
        f64::from(self.sigma(place)) * (Self::SIGMA_UNIT_NM * 1e-6)
    }
}

/// Everything that inspecting parts needs, worked out once.
#[derive(Debug)]
pub struct Production {
    decoder: Decoder,
    triangulator: Arc<Triangulator>,
    rises: Arc<Rises>,
    /// Φ₀ that phases are unwrapped about, where it is not that of the rises.
    map: Option<Vec<AbsolutePhase>>,
    taught: Taught,
    gauges: Vec<Gauge>,
    /// One per gauge, then those that steps start from.
    regions: Vec<Region>,
    /// Cells, and of each gauge which are its: one, two of a step, or none.
    patches: Vec<Patch>,
    patches_of: Vec<Range<usize>>,
    alignment: Option<Alignment>,
    /// The middle of golden's heights and half their span, mm.
    levels: (f64, f64),
    /// The sides of the gauges' squares, each once.
    sides: Vec<usize>,
    window: Vec<Range<usize>>,
    /// Pixels inside the window that are compared.
    compared: u64,
    noise_counts: f64,
    /// See [`crate::pipeline::Seen`].
    noise: f32,
}

/// Gauges that cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmeasurable {
    /// A smoothing over so many pixels that sums of heights over them could overflow.
    TooSmooth {
        /// Side of the square in pixels.
        side: usize,
    },
    /// More cells than are kept.
    TooFine(TooFine),
}

impl core::fmt::Display for Unmeasurable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooSmooth { side } => write!(
                f,
                "a smoothing over {side}x{side} pixels is too wide for the working range"
            ),
            Self::TooFine(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for Unmeasurable {}

/// What production is made of.
#[derive(Debug)]
pub struct Parts {
    /// How frames become phases.
    pub decoder: Decoder,
    /// Exact heights.
    pub triangulator: Arc<Triangulator>,
    /// How phases become heights.
    pub rises: Arc<Rises>,
    /// Φ₀ that phases are unwrapped about, row-major, where it is not that of the rises; a part of it.
    pub map: Option<Vec<AbsolutePhase>>,
    /// The part as taught.
    pub taught: Taught,
    /// What is measured.
    pub gauges: Vec<Gauge>,
    /// The columns of each row that are looked at: every gauge's region with half its smoothing and the part's motion around.
    pub window: Vec<Range<usize>>,
    /// σ of one sample.
    pub noise_counts: f64,
    /// Whether the part's motion is found and taken back.
    pub aligned: bool,
}

impl Production {
    /// Joins what is known of head and part.
    ///
    /// # Errors
    /// If a gauge's squares are so large that sums of heights over them could overflow, or so small that there are too many.
    pub fn new(parts: Parts) -> Result<Self, Unmeasurable> {
        let Parts {
            decoder,
            triangulator,
            rises,
            map,
            mut taught,
            gauges,
            window,
            noise_counts,
            aligned,
        } = parts;
        taught.mark_squares(rises.surface().width.max(1));
        let range = triangulator.range();
        let span_nm = (range.high - range.low) * 1e6;
        let mut sides = Vec::new();
        for gauge in &gauges {
            if let Measure::Deviation { side } = gauge.measure
                && !sides.contains(&side)
            {
                if !extreme::fits(side, span_nm) {
                    return Err(Unmeasurable::TooSmooth { side });
                }
                sides.push(side);
            }
        }
        let width = rises.surface().width;
        let compared = window.iter().enumerate().map(|(v, columns)| {
            let row = v * width + columns.start..v * width + columns.end;
            row.filter(|&place| taught.compared(place)).count() as u64
        });
        let compared = compared.sum();
        let turns = decoder.phase_noise(Modulation::from_bits(1), noise_counts) / rises.range();
        let noise = (turns / VARIANCE_UNIT_NM) * (turns / VARIANCE_UNIT_NM);
        let golden = GoldenSurface {
            triangulator: &triangulator,
            surface: rises.surface(),
            taught: &taught,
        };
        let alignment = match aligned {
            true => Alignment::new(golden, &window),
            false => None,
        };
        let mut regions: Vec<Region> = gauges.iter().map(|gauge| gauge.region.clone()).collect();
        let (mut patches, mut patches_of) = (Vec::new(), Vec::new());
        for (at, gauge) in gauges.iter().enumerate() {
            let first = patches.len();
            let mut places = vec![at];
            if let Some(from) = &gauge.from {
                places.push(regions.len());
                regions.push(from.clone());
            }
            if let Some(side) = gauge.measure.cell_side() {
                for region in places {
                    let grid = Grid::over(&regions[region], side).map_err(Unmeasurable::TooFine)?;
                    let about = alignment
                        .as_ref()
                        .map_or((Vector::default(), 1.0), |a| (a.centre, a.radius));
                    patches.push(Patch {
                        region,
                        grid,
                        taught: taught_cells(&grid, &regions[region], golden, about),
                    });
                }
            }
            patches_of.push(first..patches.len());
        }
        Ok(Self {
            levels: levels(&rises.surface().height, width, &window),
            decoder,
            triangulator,
            rises,
            map,
            taught,
            gauges,
            regions,
            patches,
            patches_of,
            alignment,
            sides,
            window,
            compared,
            noise_counts,
            noise: noise as f32,
        })
    }

    /// The plan of the alignment, if there is one.
    pub fn alignment(&self) -> Option<&Alignment> {
        self.alignment.as_ref()
    }

    /// Columns and rows of the frame.
    fn size(&self) -> (usize, usize) {
        (self.rises.surface().width, self.window.len())
    }

    fn golden(&self) -> GoldenSurface<'_> {
        GoldenSurface {
            triangulator: &self.triangulator,
            surface: self.rises.surface(),
            taught: &self.taught,
        }
    }

    /// The same on another back-end of this machine, with the same bits.
    pub fn with_backend(self, backend: Backend) -> Self {
        let decoder = self.decoder.with_backend(backend);
        Self { decoder, ..self }
    }

    /// The columns of each row that are looked at.
    pub fn window(&self) -> &[Range<usize>] {
        &self.window
    }

    /// How phases become heights.
    pub fn rises(&self) -> &Rises {
        &self.rises
    }

    /// How frames become phases.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Exact heights.
    pub fn triangulator(&self) -> &Triangulator {
        &self.triangulator
    }

    /// Room for strips of `rows` rows that cover the frame.
    pub fn strips(&self, rows: usize) -> Vec<Strip> {
        let height = self.window.len();
        (0..height)
            .step_by(rows.max(1))
            .map(|top| Strip::new(self, top..(top + rows.max(1)).min(height)))
            .collect()
    }

    /// Inspects a part, in strips from [`Self::strips`]. Where `heights` is given (as long as a frame, row-major) it gets
    /// z in mm, NaN where not resolved or not looked at. The same as [`Self::place`] and [`Self::inspect_placed`].
    ///
    /// # Errors
    /// If the frames are not what the decoder was made for. Nothing else can fail.
    pub fn inspect(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut [Strip],
        heights: Option<&mut [f32]>,
    ) -> Result<Findings, DecodeError> {
        let light = Light::Frames(frames);
        let placed = self.place(light, strips)?;
        self.inspect_placed(light, strips, placed, heights)
    }

    /// The first half: how the part lies, from a few rows of each strip; none if that is not asked for, or too little of it
    /// is seen.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn place(
        &self,
        light: Light<'_>,
        strips: &mut [Strip],
    ) -> Result<Option<Placed>, DecodeError> {
        self.check(light)?;
        let Some(alignment) = &self.alignment else {
            return Ok(None);
        };
        for_each(
            strips.iter_mut().collect(),
            || (),
            |_, strip, ()| strip.sample(self, alignment, light),
        );
        let Some((first, others)) = strips.split_first_mut() else {
            return Ok(None);
        };
        for strip in others {
            first.samples.extend(&strip.samples);
        }
        let fitting = alignment.fitting(self.golden());
        Ok(fitting.fit(&first.samples, &mut first.room))
    }

    /// The second half: the readings of a part that lies so, from the light and strips that it was placed with.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn inspect_placed(
        &self,
        light: Light<'_>,
        strips: &mut [Strip],
        placed: Option<Placed>,
        heights: Option<&mut [f32]>,
    ) -> Result<Findings, DecodeError> {
        self.check(light)?;
        let width = self.rises.surface().width;
        let stance = Stance::new(self, placed);
        let mut left = heights;
        let mut work = Vec::with_capacity(strips.len());
        for strip in strips.iter_mut() {
            let mine = left.take().map(|map| {
                let (mine, rest) = map.split_at_mut(strip.rows().len() * width);
                left = Some(rest);
                mine
            });
            work.push((strip, mine));
        }
        for_each(
            work,
            || (),
            |_, (strip, heights), ()| strip.inspect(self, &stance, light, heights),
        );
        Ok(self.findings(light, stance, strips))
    }

    /// The map that phases are unwrapped about, row-major.
    pub fn map(&self) -> &[AbsolutePhase] {
        self.map.as_ref().unwrap_or(&self.rises.surface().phase)
    }

    /// The row of the map that phases are unwrapped about, if the sequence needs one.
    fn map_row(&self, v: usize) -> &[AbsolutePhase] {
        let width = self.rises.surface().width;
        if self.decoder.unwrapping().needs_map() {
            &self.map()[v * width..(v + 1) * width]
        } else {
            &[]
        }
    }
}
