//! Parts whose shape leaves their motion open, such as plates: the picture without fringes steers
//! them along the directions that heights do not determine, and from there contours place them
//! (`by_openings`).
//!
//! # Idea
//! Heights come first and keep what they determine: the picture moves a part along the other
//! directions only ([`Picture::steer`](crate::inspect::Picture::steer)), and from there the heights
//! are fitted again, which hardly changes anything on a plate. Regions follow; the picture measures nothing:
//! what depends on these directions has no value unless contours determine them ([`Placed::component`]).

use super::plan::Production;
use super::strip::Strips;
use crate::inspect::align::Placed;
use crate::inspect::strips::measure::decode::Input;

/// How a part lies that was placed by its heights, whose points the strips still have; none
/// where heights leave nothing free, or the picture is not like golden's.
pub fn steer(
    production: &Production,
    input: Input<'_>,
    placed: &Placed,
    strips: &mut Strips,
) -> Option<Placed> {
    let picture = production
        .picture
        .as_ref()
        .filter(|_| !placed.free.is_empty())?;
    let Input::Finest(_, frames) = input else {
        return None;
    };
    let frames = (production.phase.decoder.backend(), frames);
    let triangulator = &production.golden.triangulator;
    let motion = picture.steer(triangulator, frames, placed, &mut strips.pictures)?;
    let mut fitting = production
        .alignment
        .as_ref()?
        .fitting(production.golden.surface());
    fitting.from = Some(motion);
    let placed = fitting.fit(&strips.samples, &mut strips.fitting)?;
    let steered = true;
    Some(Placed { steered, ..placed })
}
