//! What there is to draw of the features of a part: contours with their pieces, and sections.
//!
//! Places are worked out in the frame as taught, and shown where the part lies. Nothing of this is
//! computed unless it is asked for.

use super::plan::Production;
use super::strip::Strips;
use crate::geometry::Vector;
use crate::inspect::contour::Outcome;
use crate::inspect::section::{self, Point};
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
    pub joint: Option<section::Geometry>,
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
        if let Some(section) = strips.sections.iter().find(|of| of.is_of(&[feature])) {
            let points = section.points();
            let every = points.len().div_ceil(POINTS).max(1);
            let points = points.iter().step_by(every);
            return Some(Drawn {
                outline: Vec::new(),
                ends: None,
                pieces: Vec::new(),
                profile: Some(Profile {
                    points: points.map(|&Point { s, z, .. }| [s, z]).collect(),
                    joint: section.geometry(),
                }),
            });
        }
        let contour = strips.contours.iter().find(|of| of.is_of(&[feature]))?;
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
        let golden = &self.production.golden;
        let (width, rows) = golden.size();
        // Casts keep to the range of their type.
        let near =
            |at: f64, end: usize| (libm::rint(at.max(0.0)) as usize).min(end.saturating_sub(1));
        let (u, v) = (near(at[0], width), near(at[1], rows));
        let seen = golden.seen(u, v, golden.height_mm(v * width + u));
        let moved = seen.and_then(|point| self.place(point));
        // By as much as the pixel that it lies in.
        moved.map_or(at, |[column, row]| {
            [at[0] + column - u as f64, at[1] + row - v as f64]
        })
    }
}
