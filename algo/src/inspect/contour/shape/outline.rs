//! What a shape is, and a shape with its place.

use crate::geometry::Vector;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Debug;

/// Most parameters of a shape.
pub const MAX_PARAMETERS: usize = 6;
/// The parameters p of a shape in mm and rad, in its own order; those behind its own are 0.
pub type Parameters = [f64; MAX_PARAMETERS];
/// A shape's own parameters, followed by zeros.
pub fn padded(own: &[f64]) -> Parameters {
    core::array::from_fn(|i| own.get(i).copied().unwrap_or(0.0))
}

/// A symmetric matrix over them.
pub type Covariance = [Parameters; MAX_PARAMETERS];
/// A place in the plane of a contour, mm.
pub type PlanePlace = (f64, f64);

/// Most marks of a shape.
const MAX_MARKS: usize = 4;
/// Points of a contour, mm, that its dimensions are worked out from.
pub type Marks<P> = heapless::Vec<P, MAX_MARKS>;

/// Step of the numeric derivatives, mm and rad: distances are smooth near a shape, so that the error
/// of the second order is below 1e-9.
const STEP: f64 = 1e-5;

/// A place of a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// x, mm.
    pub x: f64,
    /// y, mm.
    pub y: f64,
    /// The unit vector across the contour, into the material.
    pub normal: (f64, f64),
    /// Curvature per mm, positive where the centre of curvature lies off the material.
    pub curvature: f64,
}

/// What the marks of a contour in space say of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimensions {
    /// Its centre or middle, mm.
    pub middle: Vector,
    /// Its direction, of length 1, if it has one.
    pub direction: Option<Vector>,
    /// Its sizes, mm: diameter, or length and width.
    pub sizes: [Option<f64>; 2],
}

/// The shape of a contour in a plane.
pub trait Shape: Debug + Send + Sync {
    /// How many parameters it has.
    fn count(&self) -> usize;

    /// The signed distance d(x, y; p) of a point, mm, positive on the material.
    fn distance(&self, p: &Parameters, x: f64, y: f64) -> f64;

    /// How the distance changes with each parameter.
    fn derivative(&self, p: &Parameters, x: f64, y: f64) -> Parameters {
        let rate = |i: usize| {
            let (mut less, mut more) = (*p, *p);
            less[i] -= STEP;
            more[i] += STEP;
            (self.distance(&more, x, y) - self.distance(&less, x, y)) / (2.0 * STEP)
        };
        core::array::from_fn(|i| if i < self.count() { rate(i) } else { 0.0 })
    }

    /// Length of the contour, mm.
    fn length(&self, p: &Parameters) -> f64;

    /// How far along the contour, mm, the nearest of its places is; `None` beyond its ends.
    fn along(&self, p: &Parameters, x: f64, y: f64) -> Option<f64>;

    /// The place so far along, mm.
    fn foot(&self, p: &Parameters, along: f64) -> Foot;

    /// Whether the contour ends where it begins.
    fn is_closed(&self) -> bool {
        true
    }

    /// The largest share of the contour that may be missing in one stretch.
    fn largest_gap(&self) -> f64 {
        1.0
    }

    /// Its centre or middle, mm.
    fn middle(&self, p: &Parameters) -> PlanePlace;

    /// Points of it that tell its dimensions, mm.
    fn marks(&self, p: &Parameters) -> Marks<PlanePlace>;

    /// What its marks, in space, say of it.
    fn dimensions(&self, marks: &[Vector]) -> Dimensions;
}

/// A contour's shape with its place, in the frame of its plane.
#[derive(Clone, Debug)]
pub struct Outline {
    /// The shape.
    pub shape: Arc<dyn Shape>,
    /// Its parameters.
    pub parameters: Parameters,
}

/// What golden's heights show of a contour, in its plane: to about two pixels.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Of an opening the corners of its convex hull, counterclockwise; of an edge the places of the
    /// face that lie beside what is none. mm.
    pub places: Vec<PlanePlace>,
    /// The middle of the face, mm.
    pub face: PlanePlace,
    /// By how much the face is seen to end too early, mm: heights next to an edge are not certain.
    pub eroded: f64,
}

/// What is known of a kind of contour.
#[derive(Debug)]
pub struct ContourKind {
    /// What it is, in a sentence for people.
    pub about: &'static str,
    /// Whether it has a direction in its plane.
    pub has_direction: bool,
    /// How many sizes it has.
    pub sizes: usize,
    /// Where it begins; `None` if the trace does not determine it.
    pub begin: fn(&Trace) -> Option<Outline>,
}

impl Outline {
    /// A shape with the first of its parameters, the others 0.
    pub fn new(shape: impl Shape + 'static, own: &[f64]) -> Self {
        let (shape, parameters) = (Arc::new(shape), padded(own));
        Self { shape, parameters }
    }

    /// The same with other parameters.
    pub fn with(&self, parameters: &Parameters) -> Self {
        let (shape, parameters) = (Arc::clone(&self.shape), *parameters);
        Self { shape, parameters }
    }

    /// Its centre or middle, mm.
    pub fn middle(&self) -> PlanePlace {
        self.shape.middle(&self.parameters)
    }

    /// The place at a share of its length, mm.
    pub fn at(&self, share: f64) -> PlanePlace {
        let length = self.shape.length(&self.parameters);
        let foot = self.shape.foot(&self.parameters, share * length);
        (foot.x, foot.y)
    }

    /// Places along it, from its beginning to its end, mm.
    pub fn places(&self) -> impl Iterator<Item = PlanePlace> {
        const COUNT: u32 = 32;
        (0..=COUNT).map(|at| self.at(f64::from(at) / f64::from(COUNT)))
    }
}

impl Trace {
    /// A radius without the pixels whose heights are not certain, mm.
    pub fn shrunk(&self, radius: f64) -> f64 {
        (radius - self.eroded).max(radius / 4.0)
    }
}

/// The mean of places; `None` where there are none.
pub fn mean(places: impl Iterator<Item = PlanePlace>) -> Option<PlanePlace> {
    let (mut x, mut y, mut count) = (0.0, 0.0, 0.0);
    for at in places {
        (x, y, count) = (x + at.0, y + at.1, count + 1.0);
    }
    (count > 0.0).then(|| (x / count, y / count))
}

/// The four points of a shape on its axes, half as long and half as wide as it, mm.
pub fn axis_marks((x, y): PlanePlace, [long, short]: [f64; 2], angle: f64) -> Marks<PlanePlace> {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    [(-long, 0.0), (long, 0.0), (0.0, -short), (0.0, short)]
        .map(|(along, across)| {
            (
                x + along * cos - across * sin,
                y + along * sin + across * cos,
            )
        })
        .into_iter()
        .collect()
}

/// The centre of four points on two axes, and the ways along them.
pub fn axes_of(marks: &[Vector]) -> (Vector, [Vector; 2]) {
    let (along, across) = (marks[1] - marks[0], marks[3] - marks[2]);
    let centre = (marks[0] + along * 0.5 + marks[2] + across * 0.5) * 0.5;
    (centre, [along, across])
}
