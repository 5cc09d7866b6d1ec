//! The points of sections that a strip's pixels see.

use super::sight::SectionSight;
use crate::inspect::section::Point;
use crate::inspect::strips::gauges::Gauges;
use crate::inspect::strips::golden::base_nm;
use crate::inspect::strips::height::HeightRow;
use crate::inspect::strips::near::NodeRow;
use crate::inspect::strips::plan::Production;
use crate::inspect::strips::pose::PoseField;
use crate::pipeline::{NO_OFFSET, PhaseMap};
use crate::units::Height;
use alloc::vec;
use alloc::vec::Vec;

/// Points of each section, with a buffer.
#[derive(Clone, Debug, Default)]
pub struct SectionPoints {
    pub all: Vec<Vec<Point>>,
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
        plan: &Production,
        (pose, sights): (&PoseField, &[SectionSight]),
        v: usize,
        (decoded, heights): (&PhaseMap, &HeightRow),
    ) {
        let (golden, gauges) = (&plan.golden, &plan.gauges);
        let surface = golden.cubics.surface();
        for ((points, sight), expected) in self.all.iter_mut().zip(sights).zip(&plan.sections.all) {
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
                    let sigma = plan.phase.sigma_nm(decoded.modulation[u], slope) * 1e-6;
                    let variance = sigma * sigma;
                    points.push(Point { s, z, variance });
                }
            }
        }
    }
}
