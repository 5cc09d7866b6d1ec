//! The shapes of contours as features have them.

use crate::inspect::contour::shape::{Circle, Line, Shape, Slot};
use crate::inspect::contour::{Contour, Input, PIECE_PX, Setup, Source, View, find, inputs};
use crate::inspect::feature::{FeatureKind, Geometry, MAX_PARAMETERS, Parameters, PlaneFrame};
use alloc::vec::Vec;

/// A contour's shape with its place, in the frame of its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// Centre and radius.
    Circle([f64; 3]),
    /// Centre, half the distance of the centres of its ends, radius of the ends, angle.
    Slot([f64; 5]),
    /// A line, and how far it lies from there.
    Line(Line, [f64; 2]),
}

/// What [`find`] makes of any shape.
#[derive(Clone, Debug)]
pub struct Associated {
    pub contour: Contour<MAX_PARAMETERS>,
    pub count: usize,
    pub inputs: Vec<(Source, Parameters)>,
    /// Distance from the shape and error of each point of the rim.
    pub residuals: Vec<(f64, f64)>,
}

impl Outline {
    /// What it is.
    pub fn kind(&self) -> FeatureKind {
        match self {
            Self::Circle(_) => FeatureKind::Circle,
            Self::Slot(_) => FeatureKind::Slot,
            Self::Line(..) => FeatureKind::Line,
        }
    }

    /// The same with other parameters.
    pub fn with(&self, &[a, b, c, d, e]: &Parameters) -> Self {
        match *self {
            Self::Circle(_) => Self::Circle([a, b, c]),
            Self::Slot(_) => Self::Slot([a, b, c, d, e]),
            Self::Line(line, _) => Self::Line(line, [a, b]),
        }
    }

    /// Its geometry in the frame of its plane.
    pub fn geometry(&self, frame: &PlaneFrame) -> Geometry {
        let [from, to] = self.ends().map(|(x, y)| frame.point(x, y));
        let (x, y) = self.middle();
        let (centre, normal) = (frame.point(x, y), frame.normal());
        match *self {
            Self::Circle([.., radius]) => Geometry::Circle {
                centre,
                normal,
                radius,
            },
            Self::Slot([.., half, radius, angle]) => Geometry::Slot {
                centre,
                direction: frame.point(x + libm::cos(angle), y + libm::sin(angle)) - centre,
                normal,
                length: 2.0 * (half + radius),
                width: 2.0 * radius,
            },
            Self::Line(..) => Geometry::Line {
                middle: centre,
                direction: (to - from) * (1.0 / (to - from).length()),
                normal,
            },
        }
    }

    /// Its middle.
    pub fn middle(&self) -> (f64, f64) {
        match *self {
            Self::Circle([x, y, _]) | Self::Slot([x, y, ..]) => (x, y),
            Self::Line(..) => self.at(0.5),
        }
    }

    /// The same, displaced and turned about its middle by the angle with this cosine and sine.
    pub fn moved(&self, (x, y): (f64, f64), (cos, sin): (f64, f64)) -> Self {
        match *self {
            Self::Circle([a, b, radius]) => Self::Circle([a + x, b + y, radius]),
            Self::Slot([a, b, half, radius, angle]) => {
                let angle = angle + libm::atan2(sin, cos);
                Self::Slot([a + x, b + y, half, radius, angle])
            }
            Self::Line(line, p) => {
                let (u, v) = line.direction;
                let line = Line {
                    middle: (line.middle.0 + x, line.middle.1 + y),
                    direction: (cos * u - sin * v, sin * u + cos * v),
                    ..line
                };
                Self::Line(line, p)
            }
        }
    }

    /// Where the ends of a line are expected; of others its centre twice.
    pub fn ends(&self) -> [(f64, f64); 2] {
        match self {
            Self::Circle([x, y, _]) | Self::Slot([x, y, ..]) => [(*x, *y); 2],
            Self::Line(line, _) => [-0.5, 0.5].map(|part| {
                let ((x, y), (along, up)) = (line.middle, line.direction);
                let way = part * line.length;
                (x + way * along, y + way * up)
            }),
        }
    }

    /// Places along it.
    pub fn places(&self) -> impl Iterator<Item = (f64, f64)> {
        const COUNT: u32 = 32;
        (0..=COUNT).map(|at| self.at(f64::from(at) / f64::from(COUNT)))
    }

    /// The place at a share of its length.
    pub fn at(&self, share: f64) -> (f64, f64) {
        match self {
            Self::Circle(p) => place(&Circle, p, share),
            Self::Slot(p) => place(&Slot, p, share),
            Self::Line(line, p) => place(line, p, share),
        }
    }

    /// Finds it near where it is.
    pub fn find(&self, view: &impl View, setup: &Setup, rim: f64) -> Associated {
        match self {
            Self::Circle(p) => associated(&Circle, p, view, setup, rim),
            Self::Slot(p) => associated(&Slot, p, view, setup, rim),
            Self::Line(line, p) => associated(line, p, view, setup, rim),
        }
    }
}

fn associated<const N: usize>(
    shape: &impl Shape<N>,
    expected: &[f64; N],
    view: &impl View,
    setup: &Setup,
    rim: f64,
) -> Associated {
    let contour = find(shape, expected, view, setup);
    let inputs = inputs(shape, &contour, setup, rim);
    let used = contour.points.iter().filter(|point| point.weight > 0.0);
    let residuals = used.map(|point| {
        let off = shape.distance(&contour.parameters, point.x, point.y);
        (
            off,
            libm::hypot(libm::sqrt(point.variance), PIECE_PX * contour.pixel),
        )
    });
    Associated {
        count: N,
        inputs: inputs
            .into_iter()
            .map(|Input { source, off }| (source, padded(&off)))
            .collect(),
        residuals: residuals.collect(),
        contour: Contour {
            state: contour.state,
            found: contour.found,
            parameters: padded(&contour.parameters),
            covariance: core::array::from_fn(|i| {
                contour
                    .covariance
                    .get(i)
                    .map_or([0.0; MAX_PARAMETERS], padded)
            }),
            blur: contour.blur,
            unexplained: contour.unexplained,
            pixel: contour.pixel,
            points: contour.points,
            outcomes: contour.outcomes,
            face: contour.face,
            wall: contour.wall.map(|wall| padded(&wall)),
        },
    }
}

/// The place of a contour at a share of its length.
fn place<const N: usize>(shape: &impl Shape<N>, p: &[f64; N], share: f64) -> (f64, f64) {
    let foot = shape.foot(p, share * shape.length(p));
    (foot.x, foot.y)
}

/// A shorter list, followed by zeros.
fn padded<const N: usize>(list: &[f64; N]) -> Parameters {
    core::array::from_fn(|i| list.get(i).copied().unwrap_or(0.0))
}
