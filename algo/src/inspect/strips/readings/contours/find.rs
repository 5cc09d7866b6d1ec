//! A contour of a part, found in its plane as the plane lies.

use super::face::Face;
use super::light::Signal;
use super::taught::{Contours, ExpectedContour};
use crate::geometry::Vector;
use crate::inspect::align::{Motion, Placed};
use crate::inspect::contour::shape::Outline;
use crate::inspect::contour::{Contour, EdgePoint, Outcome, PIECE_PX, Setup, State, find, inputs};
use crate::inspect::feature::{Geometry, PlaneFrame, Rim};
use crate::inspect::gauge::Sensitive;
use crate::inspect::section::Unseen;
use crate::inspect::strips::golden::{Golden, Near};
use crate::inspect::strips::readings::planes::PlaneFit;
use alloc::vec::Vec;

/// The face does not reach the rim if the phase next to it is off the plane's by more than this
/// many σ and this many mm.
const FACE_SIGMA: f64 = 5.0;
const FACE_MM: f64 = 0.05;

/// Pixels about a contour that are looked at beside those where it may lie.
const AROUND_PX: f64 = 9.0;

/// Why a contour or section is not found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lost {
    /// Too little of its rim is seen.
    Rim,
    /// Its plane was not found.
    NoPlane,
    /// The face next to its rim lies so far above the plane, mm.
    Face(f64),
    /// The joint of a section was not found.
    Section(Unseen),
}

/// How the camera sees a rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenRim {
    /// σ of its blur, px.
    pub blur_px: f64,
    /// What a pixel sees of the plane, mm.
    pub pixel_mm: f64,
    /// RMS of how far its points are off its shape, mm.
    pub off_mm: f64,
}

/// A feature of a part with a geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundFeature {
    /// Which one.
    pub feature: usize,
    /// What became of it.
    pub state: State,
    /// The share of its rim, or of its surface as taught, that is seen.
    pub found: f64,
    /// How the camera sees the rim of a contour; `None` where it is not found.
    pub rim: Option<SeenRim>,
    /// Why it is not found.
    pub lost: Option<Lost>,
    /// Its geometry in the frame as taught; `None` if it is not found.
    pub geometry: Option<Geometry>,
}

/// What was found of a contour.
#[derive(Clone, Debug, Default)]
pub struct ContourFit {
    /// `None` before the first part.
    pub of: Option<FoundFeature>,
    /// `None` if it is not found.
    pub rim: Option<Rim>,
    /// Its pieces; `None` if it was not looked for, because its plane was not found.
    pub pieces: Option<FoundPieces>,
    /// Which of the planes it lies in.
    plane: usize,
}

/// The pieces that a contour was looked for in.
#[derive(Clone, Debug)]
pub struct FoundPieces {
    /// The frame of its plane, in the frame as taught.
    frame: PlaneFrame,
    outline: Outline,
    outcomes: Vec<Outcome>,
    points: Vec<EdgePoint>,
}

impl FoundPieces {
    /// Places along the contour, in the frame as taught.
    pub fn outline(&self) -> impl Iterator<Item = Vector> {
        let places = self.outline.places();
        places.map(|(x, y)| self.frame.point(x, y))
    }

    /// Where each piece is, in the frame as taught, and what became of it: at its edge if it has
    /// one, else on the contour.
    pub fn all(&self) -> impl Iterator<Item = (Vector, Outcome)> {
        let (count, mut points) = (self.outcomes.len() as f64, self.points.iter());
        let pieces = self.outcomes.iter().enumerate();
        pieces.map(move |(at, &outcome)| {
            let edge = match outcome {
                Outcome::Accepted | Outcome::Outlier => points.next(),
                _ => None,
            };
            let middle = || self.outline.at((at as f64 + 0.5) / count);
            let (x, y) = edge.map_or_else(middle, |point| (point.x, point.y));
            (self.frame.point(x, y), outcome)
        })
    }
}

impl ContourFit {
    /// Whether it is of this feature.
    pub fn is_of(&self, feature: usize) -> bool {
        self.of.as_ref().is_some_and(|of| of.feature == feature)
    }

    /// The opening that was found.
    pub fn opening(&self) -> Option<&Rim> {
        self.rim.as_ref().filter(|rim| rim.kind.is_opening())
    }

    /// Whether it is surely not there.
    pub fn is_absent(&self) -> bool {
        self.of.as_ref().is_some_and(|of| of.state == State::Absent)
    }

    /// The contour as values depend on it; `None` if it is not found.
    pub fn sensitive<'a>(&'a self, planes: &'a [PlaneFit]) -> Option<Sensitive<'a>> {
        Some(Sensitive::Contour {
            id: self.of.as_ref()?.feature,
            rim: self.rim.as_ref()?,
            plane: planes.get(self.plane)?.sensitive()?,
        })
    }

    /// Finds it on a part that lies so, as taught if `None`, within `reach_mm` of its place there.
    pub fn find(
        &mut self,
        (contours, expected): (&Contours, &ExpectedContour),
        golden: &Golden,
        plane: &PlaneFit,
        (placed, reach_mm): (Option<&Placed>, f64),
        light: Signal<'_>,
    ) {
        let mut of = FoundFeature {
            feature: expected.feature,
            state: State::Unseen,
            found: 0.0,
            rim: None,
            lost: Some(Lost::NoPlane),
            geometry: None,
        };
        self.rim = None;
        self.pieces = None;
        self.plane = expected.plane;
        if let Some(taught) = contours.frame(expected, plane) {
            let motion = placed.map(|placed| &placed.motion);
            let mut face = Face {
                triangulator: &golden.triangulator,
                size: golden.size(),
                frame: motion.map_or(taught, |motion| moved(&taught, motion)),
                levels: &contours.levels,
                golden: &contours.signal,
                light,
                near: Near::default(),
            };
            if let Some(pixel) = face.spot_size(0.0, 0.0) {
                face.look_about(expected.outline.places(), AROUND_PX + reach_mm / pixel);
            }
            if let Some(setup) = contours.setup(expected, &face, golden, reach_mm) {
                let outline = &expected.outline;
                let mut contour = find(&*outline.shape, &outline.parameters, &face, &setup);
                of.state = contour.state;
                of.found = contour.found;
                of.lost = (of.state == State::Unseen).then_some(Lost::Rim);
                let (off, sigma) = contour.face;
                let above = -off / setup.turns_per_mm;
                let is_off = libm::fabs(off) > FACE_SIGMA * sigma && libm::fabs(above) > FACE_MM;
                let outline = outline.with(&contour.parameters);
                if of.state == State::Found {
                    let eye = golden.triangulator.camera().centre();
                    let eye = motion.map_or(eye, |motion| motion.undo(eye));
                    let rim = rim((expected, &outline), (taught, eye), &contour, &setup);
                    of.rim = Some(SeenRim {
                        blur_px: contour.blur,
                        pixel_mm: contour.pixel,
                        off_mm: rms(rim.residuals.iter().map(|(off, _)| *off)),
                    });
                    if is_off {
                        of.state = State::Unseen;
                        of.lost = Some(Lost::Face(above));
                    } else {
                        self.rim = Some(rim);
                    }
                }
                self.pieces = Some(FoundPieces {
                    frame: taught,
                    outline,
                    outcomes: core::mem::take(&mut contour.outcomes),
                    points: core::mem::take(&mut contour.points),
                });
            }
        }
        let rim = self.rim.as_ref();
        of.geometry = rim.map(Rim::as_found);
        self.of = Some(of);
    }
}

/// The root of the mean square; 0 of nothing.
fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    libm::sqrt(values.map(|value| value * value).sum::<f64>() / count)
}

fn rim(
    (expected, outline): (&ExpectedContour, &Outline),
    (frame, eye): (PlaneFrame, Vector),
    contour: &Contour,
    setup: &Setup,
) -> Rim {
    let (shape, p) = (&*outline.shape, &outline.parameters);
    let used = contour.points.iter().filter(|point| point.weight > 0.0);
    let piece = PIECE_PX * contour.pixel;
    let residuals = used.map(|point| {
        let off = shape.distance(p, point.x, point.y);
        (off, libm::hypot(libm::sqrt(point.variance), piece))
    });
    Rim {
        kind: expected.kind,
        frame,
        eye,
        outline: outline.clone(),
        covariance: contour.covariance,
        inputs: inputs(shape, contour, setup, expected.rim),
        found: contour.found,
        residuals: residuals.collect(),
    }
}

/// A frame of the part as taught, after its motion.
pub fn moved(frame: &PlaneFrame, motion: &Motion) -> PlaneFrame {
    let along = |way| motion.apply(motion.centre + way) - motion.apply(motion.centre);
    PlaneFrame {
        origin: motion.apply(frame.origin),
        x: along(frame.x),
        y: along(frame.y),
    }
}
