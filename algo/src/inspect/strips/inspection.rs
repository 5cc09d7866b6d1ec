//! The stages of an inspection in their order, for all strips.

use super::contours::{ContourFit, Signal};
use super::decode::Input;
use super::findings::Findings;
use super::maps::Maps;
use super::plan::Production;
use super::pose::PoseField;
use super::sections::{SectionFit, SectionSight};
use super::strip::{CellBuffers, Strip, Strips};
use crate::frame::FrameView;
use crate::inspect::align::{FitBuffers, Motion, Placed};
use crate::phase::DecodeError;
use crate::pipeline::{arrive_rest, for_each, for_each_item};
use alloc::vec;
use alloc::vec::Vec;

impl Production {
    /// Strips of `rows` rows that cover the frame.
    pub fn strips(&self, rows: usize) -> Strips {
        let (height, rows) = (self.golden.window.len(), rows.max(1));
        let tops = (0..height).step_by(rows);
        Strips {
            strips: tops
                .map(|top| Strip::new(self, top..(top + rows).min(height)))
                .collect(),
            rows,
            pose: PoseField::new(&self.golden, &self.gauges.regions, self.alignment.is_some()),
            samples: Vec::new(),
            fitting: FitBuffers::default(),
            pictures: Vec::new(),
            cells: CellBuffers::default(),
            fits: self.planes.clone(),
            contours: match &self.contours {
                Some(contours) => vec![ContourFit::default(); contours.all.len()],
                None => Vec::new(),
            },
            anchors: vec![ContourFit::default(); self.anchors.len()],
            sights: vec![SectionSight::default(); self.sections.all.len()],
            sections: vec![SectionFit::default(); self.sections.all.len()],
        }
    }

    /// Checks that `frames` are those of the sequence: their number, size and samples.
    ///
    /// # Errors
    /// Naming the frame that is not.
    pub fn check(&self, frames: &[FrameView<'_>]) -> Result<(), DecodeError> {
        self.phase.check_frames(frames, self.golden.size())
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
        self.check(frames)?;
        let (width, height) = self.golden.size();
        let mut arrived = self.decoder().arrived(width, height);
        let last = arrive_rest(self.decoder(), frames, &mut arrived)?;
        let input = Input::Finest(&arrived, &last);
        let placed = self.place(input, strips)?;
        let maps = Maps {
            heights,
            deviation: None,
        };
        self.inspect_placed((input, Signal::Frames(frames)), strips, placed, maps)
    }

    /// The first half: how the part lies, from a few rows of each strip, and by the picture where
    /// heights do not determine it ([`Self::with_picture`]). None if parts are not aligned ([`Parts::aligned`](super::Parts::aligned)), or if too few points are resolved.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn place(
        &self,
        input: Input<'_>,
        strips: &mut Strips,
    ) -> Result<Option<Placed>, DecodeError> {
        let placed = self.place_from(input, strips, None)?;
        let steered = placed.as_ref();
        let steered = steered.and_then(|placed| self.steer(input, placed, strips));
        Ok(steered.or(placed))
    }

    /// As [`Self::place`], from a motion that is nearly right.
    pub(super) fn place_from(
        &self,
        input: Input<'_>,
        strips: &mut Strips,
        from: Option<Motion>,
    ) -> Result<Option<Placed>, DecodeError> {
        self.phase.check(input, self.golden.size())?;
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
        let mut fitting = alignment.fitting(self.golden.surface());
        fitting.from = from;
        Ok(fitting.fit(&strips.samples, &mut strips.fitting))
    }

    /// The second half: the readings of a part that lies so, from the input and strips that it was
    /// placed with, and `maps` of it. Contours are found in `light`, and place the part where heights leave its
    /// motion open.
    ///
    /// # Errors
    /// As [`Self::inspect`].
    pub fn inspect_placed(
        &self,
        (input, light): (Input<'_>, Signal<'_>),
        strips: &mut Strips,
        placed: Option<Placed>,
        maps: Maps<'_>,
    ) -> Result<Findings, DecodeError> {
        self.phase.check(input, self.golden.size())?;
        let by_contours = placed.as_ref();
        let by_contours = by_contours.and_then(|of| self.place_by_contours(of, light, strips));
        let placed = by_contours.or(placed);
        let regions = &self.gauges.regions;
        strips.pose.set(&self.golden, regions, placed);
        let Strips {
            strips: all,
            rows,
            pose,
            sights,
            ..
        } = &mut *strips;
        let pose = &*pose;
        let work: Vec<_> = sights.iter_mut().zip(&self.sections.all).collect();
        for_each(work, |_, (sight, expected)| {
            let region = pose.region(regions, expected.feature);
            let motion = pose.placed.as_ref().map(|placed| &placed.motion);
            sight.set(expected, &self.golden, region, motion);
        });
        let part = (pose, &sights[..]);
        if maps.is_empty() {
            for_each_item(all, |strip| {
                strip.inspect(self, part, input, Maps::default());
            });
        } else {
            let maps = maps.split((*rows * self.golden.size().0).max(1));
            let work = all.iter_mut().zip(maps).collect();
            for_each(work, |_, (strip, maps)| {
                strip.inspect(self, part, input, maps);
            });
        }
        Ok(self.findings((input, light), strips))
    }
}
