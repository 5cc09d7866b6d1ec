//! Stage 4, accumulate: the points of sections, collected row by row.
//!
//! Each measured pixel near a section becomes a point of the part as taught ([`SectionSight`]), which
//! is kept if it lies within the section's width ([`SectionPoints`]). Nothing is resampled.

use super::gauges::Gauges;
use crate::geometry::Vector;
use crate::inspect::align::Motion;
use crate::inspect::feature::{Cut, Feature};
use crate::inspect::region::Region;
use crate::inspect::section::{Optics, Request, SectionPoint};
use crate::inspect::strips::align::PoseField;
use crate::inspect::strips::golden::{Golden, Near, NodeRow, base_nm};
use crate::inspect::strips::measure::{HeightRow, PhasePlan};
use crate::pipeline::{NO_OFFSET, PhaseMap};
use crate::units::Height;
use alloc::vec;
use alloc::vec::Vec;

/// σ of the camera's blur, px: between that of a lens that shows sharper edges than pixels do, and of
/// one that is well focused, 0.5.
const BLUR_PX: f64 = 0.35;

/// The sections that gauges are of.
#[derive(Clone, Debug, Default)]
pub struct Sections {
    pub all: Vec<ExpectedSection>,
}

/// A section as it is expected.
#[derive(Clone, Debug)]
pub struct ExpectedSection {
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
            of.map(|of| ExpectedSection { feature, ..of })
                .ok_or(feature)
        };
        let all: Result<Vec<_>, _> = wanted.map(expected).collect();
        Ok(Self { all: all? })
    }
}

fn expected(cut: &Cut, golden: &Golden) -> Option<ExpectedSection> {
    let (from, to) = (golden.nearest(cut.from).1?, golden.nearest(cut.to).1?);
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
    Some(ExpectedSection {
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

/// The lines of sight about a section.
#[derive(Clone, Debug, Default)]
pub struct SectionSight {
    /// s, w and z of what is seen at the height [`Self::at_mm`], and by how much they are larger for
    /// each mm higher.
    near: Near<6>,
    /// mm.
    at_mm: f64,
}

impl SectionSight {
    /// Those of the pixels of a region; the part has moved so.
    pub fn set(
        &mut self,
        expected: &ExpectedSection,
        golden: &Golden,
        region: &Region,
        motion: Option<&Motion>,
    ) {
        self.at_mm = golden.levels.0;
        let (low, high) = (self.at_mm, self.at_mm + 1.0);
        let (columns, rows) = region.bounds();
        let place = |u: usize, v: usize| (u as f64, v as f64);
        let seen = |u: f64, v: f64| {
            let camera = golden.triangulator.camera();
            let (eye, ray) = (camera.centre(), camera.ray(u, v)?);
            let [here, higher] = [low, high].map(|z| {
                let point = eye + ray * ((z - eye.z) / ray.z);
                let point = motion.map_or(point, |motion| motion.undo(point));
                expected.frame.coordinates(point)
            });
            let [s, w, z] = here;
            let [ds, dw, dz] = core::array::from_fn(|i| higher[i] - here[i]);
            (ray.z < 0.0).then_some([s, w, z, ds, dw, dz])
        };
        let (first, last) = (rows.start, rows.end.saturating_sub(1));
        self.near = Near::new(place(columns.start, first), place(columns.end, last), seen);
    }

    /// The lines of sight of row `v` of pixels.
    pub fn take_row(&self, v: usize, out: &mut NodeRow<6>) {
        self.near.take_row(v as f64, out);
    }

    /// s, w and z of what pixel `u` of a row that was taken sees at a height.
    #[inline]
    pub fn point(&self, row: &NodeRow<6>, u: usize, height: Height) -> Option<[f64; 3]> {
        let [s, w, z, ds, dw, dz] = self.near.in_row(row, u as f64)?;
        let above = height.mm() - self.at_mm;
        Some([s + above * ds, w + above * dw, z + above * dz])
    }
}

/// Points of each section, with a buffer.
#[derive(Clone, Debug, Default)]
pub struct SectionPoints {
    pub all: Vec<Vec<SectionPoint>>,
    row: NodeRow<6>,
}

impl SectionPoints {
    /// Of the sections of these gauges.
    pub fn new(gauges: &Gauges) -> Self {
        Self {
            all: vec![Vec::new(); gauges.sections.len()],
            row: Vec::new(),
        }
    }

    pub fn clear(&mut self) {
        self.all.iter_mut().for_each(Vec::clear);
    }

    /// Adds what the pixels of row `v` see, which was measured last.
    pub fn add(
        &mut self,
        with: (&Golden, &PhasePlan, &Gauges),
        sections: &Sections,
        (pose, sights): (&PoseField, &[SectionSight]),
        v: usize,
        (decoded, heights): (&PhaseMap, &HeightRow),
    ) {
        let (golden, phase, gauges) = with;
        let surface = golden.cubics.surface();
        for ((points, sight), expected) in self.all.iter_mut().zip(sights).zip(&sections.all) {
            let region = pose.region(&gauges.regions, expected.feature);
            for (_, columns) in region.row(v) {
                sight.take_row(v, &mut self.row);
                for u in columns.clone() {
                    let Some(&offset) = heights.offset.get(u) else {
                        break;
                    };
                    if offset == NO_OFFSET {
                        continue;
                    }
                    let base = base_nm(surface.height[v * surface.width + u]);
                    let height = Height::from_nm(base.saturating_add(offset));
                    let Some([s, w, z]) = sight.point(&self.row, u, height) else {
                        continue;
                    };
                    if libm::fabs(w) > expected.half_mm {
                        continue;
                    }
                    let slope = golden.slope((u, v), decoded.phase[u]);
                    let sigma = phase.sigma_nm(decoded.modulation[u], slope) * 1e-6;
                    let variance = sigma * sigma;
                    points.push(SectionPoint { s, z, variance });
                }
            }
        }
    }
}
