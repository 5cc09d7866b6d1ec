//! The sections of a part as taught.

use crate::geometry::Vector;
use crate::inspect::feature::{Cut, Feature};
use crate::inspect::section::{Optics, Request};
use crate::inspect::strips::golden::Golden;
use alloc::vec::Vec;

/// σ of the camera's blur, px: between that of a lens that shows sharper edges than pixels do, and of
/// one that is well focused, 0.5.
const BLUR_PX: f64 = 0.35;

/// The sections that gauges are of.
#[derive(Clone, Debug, Default)]
pub struct Sections {
    pub all: Vec<Expected>,
}

/// A section as it is expected.
#[derive(Clone, Debug)]
pub struct Expected {
    /// Which feature.
    pub feature: usize,
    pub frame: SectionFrame,
    pub request: Request,
    pub optics: Optics,
    /// Half its width, mm.
    pub half_mm: f64,
    /// σ of the stated radius of its edges, mm; `None` where it is not known.
    pub radius: Option<f64>,
}

/// The frame of a section, in the frame as taught: s along it and w across, both level, and z.
#[derive(Clone, Copy, Debug)]
pub struct SectionFrame {
    origin: Vector,
    along: Vector,
    across: Vector,
}

impl SectionFrame {
    /// s, w and z of a point.
    pub fn coordinates(&self, point: Vector) -> [f64; 3] {
        let from = point - self.origin;
        [from.dot(self.along), from.dot(self.across), point.z]
    }
}

impl Sections {
    /// Those of some features; the number of one that golden does not have.
    pub fn new(
        wanted: impl Iterator<Item = usize>,
        features: &[Feature],
        golden: &Golden,
    ) -> Result<Self, usize> {
        let expected = |feature: usize| {
            let cut = features.get(feature).and_then(|of| of.cut.as_ref());
            let of = cut.and_then(|cut| expected(cut, golden));
            of.map(|of| Expected { feature, ..of }).ok_or(feature)
        };
        let all: Result<Vec<_>, _> = wanted.map(expected).collect();
        Ok(Self { all: all? })
    }
}

fn expected(cut: &Cut, golden: &Golden) -> Option<Expected> {
    let (from, to) = (seen(golden, cut.from)?, seen(golden, cut.to)?);
    let way = Vector::new(to.x - from.x, to.y - from.y, 0.0);
    let along = way * (1.0 / way.length());
    let across = Vector::new(-along.y, along.x, 0.0);
    if !along.length().is_finite() {
        return None;
    }
    let middle = (from + to) * 0.5;
    let devices = &golden.triangulator;
    let (camera, projector) = (devices.camera().centre(), devices.projector().centre());
    let slope = |device: Vector| {
        let way = device - middle;
        way.dot(along) / way.z
    };
    let pixel = golden.pixel_mm();
    Some(Expected {
        feature: 0,
        frame: SectionFrame {
            origin: from,
            along,
            across,
        },
        request: Request {
            left: cut.left,
            right: cut.right,
            edge_mm: [cut.edge_mm; 2],
        },
        optics: Optics {
            blur: libm::sqrt(BLUR_PX * BLUR_PX + 1.0 / 12.0) * pixel,
            sight: slope(camera),
            light: slope(projector),
        },
        half_mm: cut.width_mm / 2.0,
        radius: cut.edge_tolerance_mm.map(|mm| mm / libm::sqrt(3.0)),
    })
}

/// What golden's pixel nearest to (u, v) sees.
fn seen(golden: &Golden, [u, v]: [f64; 2]) -> Option<Vector> {
    let (width, rows) = golden.size();
    // Casts keep to the range of their type.
    let near = |at: f64, end: usize| (libm::rint(at.max(0.0)) as usize).min(end.saturating_sub(1));
    let (u, v) = (near(u, width), near(v, rows));
    golden.seen(u, v, golden.height_mm(v * width + u))
}
