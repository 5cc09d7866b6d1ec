//! Which points of a section pixels see where the part lies now.

use super::expected::Expected;
use crate::inspect::align::Motion;
use crate::inspect::region::Region;
use crate::inspect::strips::golden::Golden;
use crate::inspect::strips::near::{Near, NodeRow};
use crate::units::Height;

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
        expected: &Expected,
        golden: &Golden,
        region: &Region,
        motion: Option<&Motion>,
    ) {
        self.at_mm = golden.levels.0;
        let (low, high) = (self.at_mm, self.at_mm + 1.0);
        let spans = region.spans();
        let left = spans.iter().map(|(_, span)| span.start).min().unwrap_or(0);
        let right = spans.iter().map(|(_, span)| span.end).max().unwrap_or(0);
        let top = spans.first().map_or(0, |(row, _)| *row);
        let bottom = spans.last().map_or(0, |(row, _)| *row);
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
        self.near = Near::new(place(left, top), place(right, bottom), seen);
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
