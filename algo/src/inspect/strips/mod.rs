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

mod coordinates;
mod counts;
mod coverage;
mod displaced;
mod findings;
mod height;
mod input;
mod pose;
mod squares;
mod strip;
mod taught;
mod weighted;

pub use findings::{Findings, Skipped};
pub use input::Light;
pub use taught::Taught;

use super::Region;
use super::align::{Alignment, GoldenSurface, Placed, Room, Sample, levels};
use super::gauge::{Cell, Grid, Measure, Sum, TaughtCell, TooFine, Weights, taught_cells};
use crate::frame::FrameView;
use crate::geometry::{Triangulator, Vector};
use crate::phase::{DecodeError, Decoder};
use crate::pipeline::{Rises, VARIANCE_UNIT_NM, for_each, for_each_item};
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Modulation};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use coverage::Threshold;
use pose::Stance;
use strip::Strip;
use weighted::WeightedTiles;

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

/// Everything that inspecting parts needs, worked out once.
#[derive(Debug)]
pub struct Production {
    decoder: Decoder,
    triangulator: Arc<Triangulator>,
    rises: Arc<Rises>,
    /// Φ₀ that phases are unwrapped about, where it is not that of the rises.
    map: Option<Vec<AbsolutePhase>>,
    taught: Taught,
    /// None where all that is compared counts in full.
    weighted: Option<WeightedTiles>,
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
    /// What coverage hangs on.
    threshold: Threshold,
    /// See [`crate::pipeline::Seen`].
    noise: f32,
}

/// The strips of a frame, with room for all that an inspection needs. Reused from cycle to cycle, so that a cycle allocates
/// nothing.
#[derive(Debug)]
pub struct Strips {
    strips: Vec<Strip>,
    /// Of each but the last.
    rows: usize,
    stance: Stance,
    /// Points of all strips that the part's motion is found from.
    samples: Vec<Sample>,
    fitting: Room,
    /// For one gauge after the other.
    cells: CellRoom,
}

/// Room for the cells of a gauge.
#[derive(Debug, Default)]
struct CellRoom {
    sums: Vec<Sum>,
    cells: Vec<Cell>,
    weights: Weights,
}

/// Gauges that a recipe may have.
pub const MAX_GAUGES: usize = 16;

/// Gauges that cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmeasurable {
    /// More than [`MAX_GAUGES`].
    TooMany {
        /// How many.
        gauges: usize,
    },
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
            Self::TooMany { gauges } => {
                write!(f, "{gauges} gauges where at most {MAX_GAUGES} are measured")
            }
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
    /// If there are too many gauges, or one's squares are so large that sums of heights over them could overflow, or so small
    /// that there are too many.
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
        if gauges.len() > MAX_GAUGES {
            let gauges = gauges.len();
            return Err(Unmeasurable::TooMany { gauges });
        }
        taught.mark_squares(rises.surface().width.max(1));
        let weighted = WeightedTiles::new(rises.surface().width, &taught);
        let range = triangulator.range();
        let span_nm = (range.high - range.low) * 1e6;
        let mut sides = Vec::new();
        for gauge in &gauges {
            if let Measure::Deviation { side } = gauge.measure
                && !sides.contains(&side)
            {
                if !squares::extreme::fits(side, span_nm) {
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
            threshold: Threshold::new(&decoder, noise_counts),
            decoder,
            triangulator,
            rises,
            map,
            taught,
            weighted,
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
    pub fn strips(&self, rows: usize) -> Strips {
        let (height, rows) = (self.window.len(), rows.max(1));
        let tops = (0..height).step_by(rows);
        Strips {
            strips: tops
                .map(|top| Strip::new(self, top..(top + rows).min(height)))
                .collect(),
            rows,
            stance: Stance::new(self),
            samples: Vec::new(),
            fitting: Room::default(),
            cells: CellRoom::default(),
        }
    }

    /// Inspects a part, in strips from [`Self::strips`]. Where `heights` is given (as long as a frame, row-major) it gets
    /// z in mm, NaN where not resolved or not looked at. The same as [`Self::place`] and [`Self::inspect_placed`].
    ///
    /// # Errors
    /// If the frames are not what the decoder was made for. Nothing else can fail.
    pub fn inspect(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut Strips,
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
        strips: &mut Strips,
    ) -> Result<Option<Placed>, DecodeError> {
        self.check(light)?;
        let Some(alignment) = &self.alignment else {
            return Ok(None);
        };
        for_each_item(&mut strips.strips, |_, strip| {
            strip.sample(self, alignment, light);
        });
        strips.samples.clear();
        for strip in &strips.strips {
            strips.samples.extend(&strip.samples);
        }
        let fitting = alignment.fitting(self.golden());
        Ok(fitting.fit(&strips.samples, &mut strips.fitting))
    }

    /// The second half: the readings of a part that lies so, from the light and strips that it was placed with.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn inspect_placed(
        &self,
        light: Light<'_>,
        strips: &mut Strips,
        placed: Option<Placed>,
        heights: Option<&mut [f32]>,
    ) -> Result<Findings, DecodeError> {
        self.check(light)?;
        strips.stance.place(self, placed);
        let (stance, width) = (&strips.stance, self.size().0);
        match heights {
            None => for_each_item(&mut strips.strips, |_, strip| {
                strip.inspect(self, stance, light, None);
            }),
            Some(map) => {
                let maps = map.chunks_mut((strips.rows * width).max(1));
                let work = strips.strips.iter_mut().zip(maps).collect();
                for_each(
                    work,
                    || (),
                    |_, (strip, map), ()| strip.inspect(self, stance, light, Some(map)),
                );
            }
        }
        Ok(self.findings(light, strips))
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
