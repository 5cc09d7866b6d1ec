//! What there is to draw of a part: contours with their pieces, sections, and what a gauge of
//! deviation makes of the map of deviations.
//!
//! Places are worked out in the frame as taught, and shown where the part lies. Nothing of this is
//! computed unless it is asked for.

use super::plan::Production;
use super::strip::Strips;
use crate::geometry::Vector;
use crate::inspect::contour::Outcome;
use crate::inspect::section::{self, SectionPoint};
use crate::inspect::strips::accumulate::squares::extreme::least_support;
use crate::inspect::table::IntegralTable;
use alloc::vec;
use alloc::vec::Vec;

/// Most points of a section that are shown.
const POINTS: usize = 600;

/// A place of the camera's frame: column and row in pixels, 0 in the middle of the first.
pub type Place = [f64; 2];

/// A part that was inspected, as it is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawing<'a> {
    production: &'a Production,
    strips: &'a Strips,
}

/// A contour or section of a part as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Places along a contour, from its first to its last; empty of a section.
    pub outline: Vec<Place>,
    /// The ends of that in the frame as taught, mm; `None` of a section.
    pub ends: Option<[Vector; 2]>,
    /// The pieces of a contour, with what became of them.
    pub pieces: Vec<(Place, Outcome)>,
    /// Of a section.
    pub profile: Option<Profile>,
}

/// A section in its plane: s and z in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Some of its points.
    pub points: Vec<[f64; 2]>,
    /// Both sides; `None` where the joint was not found.
    pub joint: Option<section::Joint>,
}

impl<'a> Drawing<'a> {
    /// Of the part that was inspected last with these strips.
    pub fn new(production: &'a Production, strips: &'a Strips) -> Self {
        Self { production, strips }
    }

    /// A contour or section by the number of its feature; `None` of others, and of a contour that
    /// was not looked for.
    pub fn of(&self, feature: usize) -> Option<Drawn> {
        let strips = self.strips;
        if let Some(section) = strips.features.joints.iter().find(|of| of.is_of(feature)) {
            let points = section.points();
            let every = points.len().div_ceil(POINTS).max(1);
            let points = points.iter().step_by(every);
            return Some(Drawn {
                outline: Vec::new(),
                ends: None,
                pieces: Vec::new(),
                profile: Some(Profile {
                    points: points.map(|&SectionPoint { s, z, .. }| [s, z]).collect(),
                    joint: section.geometry(),
                }),
            });
        }
        let contour = strips
            .features
            .contours
            .iter()
            .find(|of| of.is_of(feature))?;
        let pieces = contour.pieces.as_ref()?;
        let ends = pieces.outline().next().zip(pieces.outline().last());
        let seen = |(point, outcome)| Some((self.place(point)?, outcome));
        Some(Drawn {
            outline: pieces
                .outline()
                .filter_map(|point| self.place(point))
                .collect(),
            ends: ends.map(|(from, to)| [from, to]),
            pieces: pieces.all().filter_map(seen).collect(),
            profile: None,
        })
    }

    /// Where the camera sees a point of the frame as taught on this part.
    pub fn place(&self, point: Vector) -> Option<Place> {
        let placed = self.strips.pose.placed.as_ref();
        let point = placed.map_or(point, |placed| placed.motion.apply(point));
        let camera = self.production.golden.triangulator.camera();
        let (u, v) = camera.project(point)?;
        Some([u, v])
    }

    /// Where the camera sees on this part what it saw at a place of golden's frame; the same place
    /// where that is not known.
    pub fn moved(&self, at: Place) -> Place {
        let ((u, v), seen) = self.production.golden.nearest(at);
        let moved = seen.and_then(|point| self.place(point));
        // By as much as the pixel that it lies in.
        moved.map_or(at, |[column, row]| {
            [at[0] + column - u as f64, at[1] + row - v as f64]
        })
    }

    /// The mean deviation over the square about each pixel for a gauge of squares of `side` pixels,
    /// mm, from [`Maps::deviation`](super::strip::Maps::deviation) of what was inspected last in these
    /// strips. NaN where a gauge would not look: the middle is not compared, less than half of the
    /// square is, or the middle lies outside of the regions, moved with the part, that gauges
    /// compare with golden. Without such gauges there are means wherever the part is compared.
    ///
    /// The largest in a gauge's region is its reading, up to the rounding of `deviation`:
    /// `the_map_of_square_means_has_the_reading_of_the_gauge_at_its_place`.
    pub fn square_means(&self, deviation: &[f32], side: usize) -> Vec<f32> {
        let width = self.production.golden.size().0;
        let sums = IntegralTable::new(width, deviation.len(), |place| {
            let mm = deviation[place];
            mm.is_finite().then_some([1.0, f64::from(mm)])
        });
        let shown = self.compared_regions(deviation.len());
        let means = deviation.iter().zip(shown).enumerate();
        means
            .map(|(place, (mm, shown))| {
                if !(shown && mm.is_finite()) {
                    return f32::NAN;
                }
                let side = self.production.golden.taught.side(place, side);
                let [count, sum] = sums.square(place / width, place % width, side);
                match count > 0.0 && count >= least_support(side) as f64 {
                    true => (sum / count) as f32,
                    false => f32::NAN,
                }
            })
            .collect()
    }

    /// Which of so many pixels lie in a region that a gauge compares with golden; all if there is
    /// no such gauge.
    fn compared_regions(&self, pixels: usize) -> Vec<bool> {
        let gauges = self.production.gauges.list.iter().enumerate();
        let mut comparing = gauges
            .filter(|(_, gauge)| gauge.measure.facts().compares)
            .peekable();
        let mut inside = vec![comparing.peek().is_none(); pixels];
        let regions =
            comparing.filter_map(|(at, _)| self.production.gauges.region(&self.strips.pose, at));
        for place in regions.flat_map(|region| region.places(self.production.golden.size().0)) {
            inside[place] = true;
        }
        inside
    }
}
