//! From frames to the readings of gauges in one pass over strips of rows.
//!
//! # Idea
//! A strip works on one row at a time, so that everything stays in the processor's cache. Each row
//! goes through the stages
//!
//! 1. **decode** (`decode`): frames → absolute phase Φ, modulation, trust;
//! 2. **height** (`height`): Φ → height offset z − z₀ above the golden surface, on the pixel's own
//!    ray;
//! 3. **align** (`coordinates`, `displaced`): takes the part's motion back by the pose field
//!    (`pose`): the pixel's taught coordinates, and its deviation from golden there, in height and,
//!    weighted, along golden's normal ([`normal_shares`](super::normal_shares));
//! 4. **accumulate** (`counts`, `coverage`, `squares`): counts, the sums of the gauges' cells
//!    ([`gauge`](super::gauge)), and the square with the largest mean deviation along the normal;
//!    for the squares, the rows before this one are kept (`recent`);
//! 5. **gauge** (`findings`, `deviation`, `uncertainty`): after all strips, readings and their
//!    errors from these sums.
//!
//! Before that, where the part's motion is wanted, some rows go through stages 1 and 2 and a few
//! points of each are kept: the motion is found from these, in the order of the rows.
//!
//! # Shapes and units
//! No map of the whole frame is written, except those that are asked for (`maps`). Strips overlap
//! by half of the largest square, so each finds all squares about its own rows. Offsets and
//! deviations are in nm.
//!
//! # Accuracy
//! All sums are whole numbers, so the findings do not depend on the number of strips or threads.
//! They are those of a comparison of whole maps:
//! `strips_find_what_the_comparison_of_whole_maps_finds`,
//! `strips_weigh_deviations_as_the_comparison_of_whole_maps_does`.

mod coordinates;
mod counts;
mod coverage;
mod decode;
mod deviation;
mod displaced;
mod findings;
mod gauges;
mod height;
mod input;
mod maps;
mod pair;
mod plan;
mod pose;
mod recent;
mod rendered;
mod squares;
mod strip;
mod taught;
mod uncertainty;

pub use findings::{Findings, Skipped};
pub use gauges::{Gauge, MAX_GAUGES, Unmeasurable};
pub use input::Input;
pub use maps::Maps;
pub use pair::{Found, PairBuffers, PairPlaced, Picture};
pub use plan::{Parts, Production};
pub use taught::Taught;
pub use uncertainty::CalibrationError;

use super::align::{FitBuffers, Motion, Placed, Sample};
use super::gauge::{Cell, Sum};
use crate::frame::FrameView;
use crate::phase::DecodeError;
use crate::pipeline::{for_each, for_each_item};
use alloc::vec::Vec;
use core::ops::Range;
use pose::PoseField;
use strip::Strip;

/// The strips of a frame, with the buffers of an inspection. Reused from cycle to cycle, so that a
/// cycle allocates nothing.
#[derive(Debug)]
pub struct Strips {
    strips: Vec<Strip>,
    /// Rows of each strip; the last may have fewer.
    rows: usize,
    pose: PoseField,
    /// Points of all strips that the part's motion is found from.
    samples: Vec<Sample>,
    fitting: FitBuffers,
    cells: CellBuffers,
}

/// Buffers for the cells of one gauge after the other.
#[derive(Debug, Default)]
struct CellBuffers {
    sums: Vec<Sum>,
    cells: Vec<Cell>,
    weights: Vec<f64>,
}

impl Production {
    /// Strips of `rows` rows that cover the frame.
    pub fn strips(&self, rows: usize) -> Strips {
        let (height, rows) = (self.window.len(), rows.max(1));
        let tops = (0..height).step_by(rows);
        Strips {
            strips: tops
                .map(|top| Strip::new(self, top..(top + rows).min(height)))
                .collect(),
            rows,
            pose: PoseField::new(self),
            samples: Vec::new(),
            fitting: FitBuffers::default(),
            cells: CellBuffers::default(),
        }
    }

    /// Inspects a part, in strips from [`Self::strips`]. If `heights` is given (as long as a frame,
    /// row-major), it gets z in mm, NaN where not resolved and outside of [`Self::window`]. The
    /// same as [`Self::place`] and [`Self::inspect_placed`].
    ///
    /// # Errors
    /// If the frames are not what the decoder was made for. Nothing else can fail.
    pub fn inspect(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut Strips,
        heights: Option<&mut [f32]>,
    ) -> Result<Findings, DecodeError> {
        let input = Input::Frames(frames);
        let placed = self.place(input, strips)?;
        let maps = Maps {
            heights,
            deviation: None,
        };
        self.inspect_placed(input, strips, placed, maps)
    }

    /// The first half: how the part lies, from a few rows of each strip. None if parts are not
    /// aligned ([`Parts::aligned`]), or if too few points are resolved.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn place(
        &self,
        input: Input<'_>,
        strips: &mut Strips,
    ) -> Result<Option<Placed>, DecodeError> {
        self.place_from(input, strips, None)
    }

    /// As [`Self::place`], from a motion that is nearly right.
    fn place_from(
        &self,
        input: Input<'_>,
        strips: &mut Strips,
        from: Option<Motion>,
    ) -> Result<Option<Placed>, DecodeError> {
        self.check(input)?;
        let Some(alignment) = &self.alignment else {
            return Ok(None);
        };
        for_each_item(&mut strips.strips, |strip| {
            strip.sample(self, alignment, input);
        });
        strips.samples.clear();
        for strip in &strips.strips {
            strips.samples.extend(&strip.samples);
        }
        let mut fitting = alignment.fitting(self.golden());
        fitting.from = from;
        Ok(fitting.fit(&strips.samples, &mut strips.fitting))
    }

    /// The second half: the readings of a part that lies so, from the input and strips that it was
    /// placed with, and `maps` of it.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn inspect_placed(
        &self,
        input: Input<'_>,
        strips: &mut Strips,
        placed: Option<Placed>,
        maps: Maps<'_>,
    ) -> Result<Findings, DecodeError> {
        self.check(input)?;
        strips.pose.set(self, placed);
        let pose = &strips.pose;
        if maps.is_empty() {
            for_each_item(&mut strips.strips, |strip| {
                strip.inspect(self, pose, input, Maps::default());
            });
        } else {
            let maps = maps.split((strips.rows * self.size().0).max(1));
            let work = strips.strips.iter_mut().zip(maps).collect();
            for_each(work, |_, (strip, maps)| {
                strip.inspect(self, pose, input, maps);
            });
        }
        Ok(self.findings(input, strips))
    }
}

/// The intersection of two ranges of columns; it may be empty.
fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}
