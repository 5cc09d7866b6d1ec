//! The stages of an inspection in their order, for all strips.
//!
//! # Parts whose shape leaves their motion open, such as plates
//! Heights come first and keep what they determine. The picture without fringes moves a part along
//! the other directions only ([`Picture::steer`](crate::inspect::Picture::steer)), and from there the
//! heights are fitted again, which hardly changes anything on a plate. Regions follow; the picture
//! measures nothing: what depends on these directions has no value unless contours determine them
//! (`by_openings`, [`Placed::component`]).

use super::by_openings::place_by_openings;
use super::plan::Production;
use super::rendered::Rendering;
use super::strip::{Maps, Strip, Strips};
use crate::frame::FrameView;
use crate::inspect::align::{Alignment, Equations, Found, Motion, Placed};
use crate::inspect::strips::accumulate::squares::extreme::Extreme;
use crate::inspect::strips::accumulate::{SectionSight, StripSums};
use crate::inspect::strips::align::PoseField;
use crate::inspect::strips::measure::Input;
use crate::inspect::strips::pair::{Expectation, PairBuffers};
use crate::inspect::strips::readings::{ContourFit, Findings, PartFeatures, Signal, SquareNoise};
use crate::phase::DecodeError;
use crate::pipeline::{PhaseMap, arrive_rest, for_each, for_each_item, for_each_row_of_two};
use crate::units::Modulation;
use alloc::vec;
use alloc::vec::Vec;

/// How a part lies by a pair.
#[derive(Clone, Debug)]
pub struct PairPlaced {
    /// By its picture; none where that does not determine it.
    pub found: Option<Found>,
    /// By its phases; none as in [`Production::place`].
    pub placed: Option<Placed>,
}

impl Production {
    /// Strips of `rows` rows that cover the frame.
    pub fn strips(&self, rows: usize) -> Strips {
        let (height, rows) = (self.golden.window.len(), rows.max(1));
        let tops = (0..height).step_by(rows);
        let tops = tops.map(|top| top..(top + rows).min(height));
        let (width, sections) = (self.golden.size().0, &self.sections);
        Strips {
            strips: tops.clone().map(|rows| Strip::new(self, rows)).collect(),
            sums: tops
                .map(|rows| StripSums::new(&self.gauges, width, &rows))
                .collect(),
            rows,
            pose: PoseField::new(&self.golden, &self.gauges.regions, self.alignment.is_some()),
            samples: Vec::new(),
            fitting: Equations::default(),
            pictures: Vec::new(),
            anchors: vec![ContourFit::default(); self.anchors.len()],
            sights: vec![SectionSight::default(); sections.all.len()],
            features: PartFeatures::new(&self.readings, sections),
        }
    }

    /// Buffers for pairs of frames of this size.
    pub fn pair_buffers(&self) -> PairBuffers {
        PairBuffers::new(self.golden.size(), &self.phase)
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
            ..Maps::default()
        };
        self.inspect_placed((input, Signal::Frames(frames, 0.0)), strips, placed, maps)
    }

    /// The first half: how the part lies, from a few rows of each strip, and by the picture where
    /// heights do not determine it ([`Self::with_picture`]). None if parts are not aligned ([`Parts::aligned`](super::plan::Parts::aligned)), or if too few points are resolved.
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

    /// How a part lies that was placed by its heights, whose points the strips still have; none
    /// where heights leave nothing free, or the picture is not like golden's.
    fn steer(&self, input: Input<'_>, placed: &Placed, strips: &mut Strips) -> Option<Placed> {
        let picture = self.picture.as_ref().filter(|_| !placed.free.is_empty())?;
        let Input::Finest(_, frames) = input else {
            return None;
        };
        let frames = (self.phase.decoder.backend(), frames);
        let triangulator = &self.golden.triangulator;
        let motion = picture.steer(triangulator, frames, placed, &mut strips.pictures)?;
        let fitting = self.alignment.as_ref()?.fitting(self.golden.surface());
        let placed = fitting.fit(Some(motion), &strips.samples, &mut strips.fitting)?;
        let steered = true;
        Some(Placed { steered, ..placed })
    }

    /// As [`Self::place`], from a motion that is nearly right.
    fn place_from(
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
        let fitting = alignment.fitting(self.golden.surface());
        Ok(fitting.fit(from, &strips.samples, &mut strips.fitting))
    }

    /// As [`Self::place`], of phases that were worked out of a part after this motion
    /// ([`Self::rendered`]): where production would look at its picture, that finds the motion.
    ///
    /// # Errors
    /// As [`Self::place`].
    pub fn place_rendered(
        &self,
        phases: &PhaseMap,
        strips: &mut Strips,
        motion: &Motion,
    ) -> Result<Option<Placed>, DecodeError> {
        let open = self.alignment.as_ref().filter(|_| self.picture.is_some());
        let from = open.map(|&Alignment { centre, .. }| {
            let shift = motion.apply(centre) - centre;
            Motion::new(centre, shift, motion.turn)
        });
        let mut placed = self.place_from(Input::Phases(phases), strips, from)?;
        if let (Some(placed), Some(_)) = (&mut placed, from) {
            placed.steered = !placed.free.is_empty();
        }
        Ok(placed)
    }

    /// Finds how the part lies, from its picture on ([`Self::with_picture`]), and measures its phases
    /// into the buffers.
    ///
    /// # Errors
    /// If the frames are not two of this size and bit depth.
    pub fn place_pair(
        &self,
        frames: &[FrameView<'_>],
        strips: &mut Strips,
        buffers: &mut PairBuffers,
    ) -> Result<PairPlaced, DecodeError> {
        self.phase.decoder.check(frames)?;
        let &[plus, minus] = frames else {
            return Err(DecodeError::FrameCount {
                expected: 2,
                given: frames.len(),
            });
        };
        let frames = [plus, minus];
        let triangulator = &self.golden.triangulator;
        let shown = (self.phase.decoder.backend(), &frames[..]);
        let found = self
            .picture
            .as_ref()
            .and_then(|picture| picture.find(triangulator, shown, &mut strips.pictures));
        let motion = found.map(|found| found.motion);
        if let Some(motion) = &motion {
            strips.pose.displace(&self.golden, motion);
        }
        let pose = motion.is_some().then_some(&strips.pose);
        if let Some(alignment) = &self.alignment {
            buffers.fit(self.expectation(pose), frames, Some(alignment));
        }
        let mut placed = self.place_from(Input::Phases(buffers.phases()), strips, motion)?;
        if let Some(placed) = &mut placed {
            placed.steered = found.is_some() && !placed.free.is_empty();
        }
        if let Some(placed) = &placed {
            strips.pose.displace(&self.golden, &placed.motion);
        }
        let pose = (placed.is_some() || motion.is_some()).then_some(&strips.pose);
        buffers.fit(self.expectation(pose), frames, None);
        Ok(PairPlaced { found, placed })
    }

    /// What a pair expects of golden that lies as in a field, as taught if none.
    fn expectation<'a>(&'a self, pose: Option<&'a PoseField>) -> Expectation<'a> {
        Expectation {
            backend: self.phase.decoder.backend(),
            golden: &self.golden,
            pose,
        }
    }

    /// The phases of the part as taught after a motion. `modulation` is golden's by this sequence,
    /// row-major; other seeds give other noise, none gives none.
    pub fn rendered(
        &self,
        motion: &Motion,
        modulation: &[Modulation],
        seed: Option<u64>,
    ) -> PhaseMap {
        let rendering = Rendering {
            golden: &self.golden,
            phase: &self.phase,
            motion,
            modulation,
            seed,
        };
        rendering.phases()
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
        let by_openings = placed.as_ref();
        let by_openings = by_openings.and_then(|of| place_by_openings(self, of, light, strips));
        let placed = by_openings.or(placed);
        let regions = &self.gauges.regions;
        strips.pose.set(&self.golden, regions, placed);
        let Strips {
            strips: all,
            sums,
            rows,
            pose,
            sights,
            features,
            ..
        } = strips;
        let pose = &*pose;
        let work: Vec<_> = sights.iter_mut().zip(&self.sections.all).collect();
        for_each(work, |_, (sight, expected)| {
            let region = pose.region(regions, expected.feature);
            let motion = pose.placed.as_ref().map(|placed| &placed.motion);
            sight.set(expected, &self.golden, region, motion);
        });
        let part = (pose, &sights[..]);
        if maps.is_empty() {
            for_each_row_of_two((&mut *all, 1), (&mut *sums, 1), |_, strips, sums| {
                for (strip, sums) in strips.iter_mut().zip(sums) {
                    strip.inspect(self, part, input, sums, Maps::default());
                }
            });
        } else {
            let maps = maps.split((*rows * self.golden.size().0).max(1));
            let work = all.iter_mut().zip(&mut *sums).zip(maps);
            for_each(work.collect(), |_, ((strip, sums), maps)| {
                strip.inspect(self, part, input, sums, maps);
            });
        }
        // Only a frame without rows has no strip, and no square either.
        let mut noise_of = |square: &Extreme, side: usize| match all.first_mut() {
            Some(strip) => strip.noise_of(self, pose, input, (square, side)),
            None => SquareNoise::new(side),
        };
        Ok(self
            .evaluation()
            .findings(light, pose, sums, &mut noise_of, features))
    }
}
