//! Parts whose shape leaves their motion open, such as plates: the picture without fringes steers
//! them along the directions that heights do not determine, and from there contours place them
//! (`contours`).
//!
//! # Idea
//! Heights come first and keep what they determine: the picture moves a part along the other
//! directions only ([`Picture::steer`](crate::inspect::Picture::steer)), and from there the heights
//! are fitted again, which hardly changes anything on a plate. Regions follow; the picture measures nothing:
//! what depends on these directions has no value unless contours determine them ([`Placed::component`]).

use super::decode::Input;
use super::plan::Production;
use super::strip::Strips;
use crate::inspect::align::{Alignment, Motion, Picture, Placed};
use crate::phase::DecodeError;
use crate::pipeline::PhaseMap;

impl Production {
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

    /// How a part lies that was placed by its heights, whose points the strips still have; none
    /// where heights leave nothing free, or the picture is not like golden's.
    pub(super) fn steer(
        &self,
        input: Input<'_>,
        placed: &Placed,
        strips: &mut Strips,
    ) -> Option<Placed> {
        let picture = self.picture.as_ref().filter(|_| !placed.free.is_empty())?;
        let Input::Finest(_, frames) = input else {
            return None;
        };
        let frames = (self.phase.decoder.backend(), frames);
        let triangulator = &self.golden.triangulator;
        let motion = picture.steer(triangulator, frames, placed, &mut strips.pictures)?;
        let mut fitting = self.alignment.as_ref()?.fitting(self.golden.surface());
        fitting.from = Some(motion);
        let placed = fitting.fit(&strips.samples, &mut strips.fitting)?;
        let steered = true;
        Some(Placed { steered, ..placed })
    }
}

mod contours;
#[cfg(test)]
mod tests;
