//! From frames to the readings of gauges in one pass: strips of rows, each finished while it is in the cache.
//!
//! A strip decodes one row at a time, turns it into rises above the golden surface, counts, and slides the sums of each
//! smoothing down by a row; it keeps as many rows as the largest smoothing has. No map of the whole frame is written,
//! except that of the heights when somebody wants to see it. Strips overlap by half a smoothing. All sums are whole
//! numbers, so the findings do not depend on the number of strips or threads; they are those of
//! [`Comparison`](super::Comparison), which this is checked against.

mod columns;
mod extreme;
mod findings;
mod squares;
mod strip;

pub use findings::{Findings, Skipped};
pub use strip::Strip;

use super::Region;
use crate::frame::FrameView;
use crate::geometry::Triangulator;
use crate::phase::{DecodeError, Decoder};
use crate::pipeline::{COMPARED, Rises, VARIANCE_UNIT_NM, for_each};
use crate::simd::Backend;
use crate::units::Modulation;
use alloc::vec::Vec;
use core::ops::Range;

/// What a gauge measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The largest deviation from golden of squares of `side` pixels; see
    /// [`Comparison::deviation`](super::Comparison::deviation).
    Deviation {
        /// Odd; 1 = single pixels.
        side: usize,
    },
    /// The share of the region that has a height.
    Coverage,
}

/// The part as taught, as far as parts are compared with it; row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taught(Vec<u16>);

impl Taught {
    /// Unit of σ in nm.
    const SIGMA_UNIT_NM: f64 = 32.0;

    /// From where the part is compared and σ of its heights in mm, NaN where not known. σ is stored in units of 32 nm, at
    /// most 1 mm.
    pub fn new(pixels: impl Iterator<Item = (bool, f64)>) -> Self {
        let stored = |(compared, mm): (bool, f64)| {
            let units = libm::rint(mm * 1e6 / Self::SIGMA_UNIT_NM);
            let sigma = match units.is_finite() {
                true => units.clamp(1.0, f64::from(COMPARED - 1)) as u16,
                false => 0,
            };
            sigma | if compared { COMPARED } else { 0 }
        };
        Self(pixels.map(stored).collect())
    }

    fn compared(&self, place: usize) -> bool {
        self.0[place] & COMPARED != 0
    }

    /// σ in its units.
    fn sigma(&self, place: usize) -> u16 {
        self.0[place] & !COMPARED
    }
}

/// Everything that inspecting parts needs, worked out once.
#[derive(Debug)]
pub struct Production {
    decoder: Decoder,
    triangulator: Triangulator,
    rises: Rises,
    taught: Taught,
    gauges: Vec<(Region, Measure)>,
    /// The sides of the gauges' squares, each once.
    sides: Vec<usize>,
    window: Vec<Range<usize>>,
    /// Pixels inside the window that are compared.
    compared: u64,
    noise_counts: f64,
    /// See [`crate::pipeline::Seen`].
    noise: f32,
}

/// A smoothing over so many pixels that sums of heights over them could overflow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooSmooth {
    /// Side of the square in pixels.
    pub side: usize,
}

impl core::fmt::Display for TooSmooth {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "a smoothing over {0}x{0} pixels is too wide for the working range",
            self.side
        )
    }
}

impl core::error::Error for TooSmooth {}

impl Production {
    /// Joins what is known of head and part; `noise_counts` is σ of one sample. `window` holds the columns of each row
    /// that are looked at: every gauge's region with half its smoothing around.
    ///
    /// # Errors
    /// If sums of heights over a gauge's squares could overflow.
    pub fn new(
        decoder: Decoder,
        triangulator: Triangulator,
        rises: Rises,
        taught: Taught,
        gauges: Vec<(Region, Measure)>,
        window: Vec<Range<usize>>,
        noise_counts: f64,
    ) -> Result<Self, TooSmooth> {
        let range = triangulator.range();
        let span_nm = (range.high - range.low) * 1e6;
        let mut sides = Vec::new();
        for (_, measure) in &gauges {
            if let Measure::Deviation { side } = *measure
                && !sides.contains(&side)
            {
                if !extreme::fits(side, span_nm) {
                    return Err(TooSmooth { side });
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
        Ok(Self {
            decoder,
            triangulator,
            rises,
            taught,
            gauges,
            sides,
            window,
            compared,
            noise_counts,
            noise: noise as f32,
        })
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
    /// z in mm, NaN where not resolved or not looked at.
    ///
    /// # Errors
    /// If the frames are not what the decoder was made for. Nothing else can fail.
    pub fn inspect(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut [Strip],
        heights: Option<&mut [f32]>,
    ) -> Result<Findings, DecodeError> {
        self.decoder.check(frames)?;
        let width = self.rises.surface().width;
        let size = (width, self.window.len());
        let given = (frames[0].width(), frames[0].height());
        if given != size {
            return Err(DecodeError::FrameSize {
                frame: 0,
                expected: size,
                given,
            });
        }
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
            |_, (strip, heights), ()| strip.inspect(self, frames, heights),
        );
        Ok(self.findings(frames, strips))
    }

    /// The row of the map that phases are unwrapped about, if the sequence needs one.
    fn map_row(&self, v: usize) -> &[crate::units::AbsolutePhase] {
        let width = self.rises.surface().width;
        if self.decoder.unwrapping().needs_map() {
            &self.rises.surface().phase[v * width..(v + 1) * width]
        } else {
            &[]
        }
    }
}
