//! The pose field: by how much the motion of a part displaces what each pixel sees.
//!
//! A pixel that sees height z sees the part's point p. With the motion taken back, p is seen at (u, v) + (du, dv) and lies dz higher.
//! These three values are worked out at nodes, for two heights each, and interpolated between: over the distance of two nodes
//! and the heights of a part they are linear in good approximation (0.003 pixels, see [`SPACING`]).

use super::Production;
use crate::geometry::Vector;
use crate::inspect::Region;
use crate::inspect::align::{Motion, Placed};
use crate::pipeline::for_each_row;
use alloc::vec;
use alloc::vec::Vec;

/// Pixels from node to node. A turn by half a degree seen through 22° over 1456 pixels is bent by 0.003 pixels between them.
pub(super) const SPACING: usize = 64;
/// Values that are interpolated: du, dv (pixels), dz (mm).
pub(super) const VALUES: usize = 3;

/// The values at the middle height, then their change per mm of height.
pub(super) type Node = [f32; 2 * VALUES];

/// How the part of a cycle lies, and what that does to every pixel.
#[derive(Debug)]
pub(super) struct PoseField {
    /// None if the part is taken to lie as taught; then regions and nodes are not used.
    pub placed: Option<Placed>,
    /// The regions of the gauges, moved with the part.
    regions: Vec<Region>,
    crossings: Vec<f64>,
    /// Row-major.
    nodes: Vec<Node>,
    columns: usize,
}

impl PoseField {
    /// Of a part that lies as taught.
    pub fn new(plan: &Production) -> Self {
        let (width, height) = plan.size();
        let columns = columns_of(width);
        let rows = (height - 1).div_ceil(SPACING) + 1;
        let (regions, nodes) = match plan.alignment {
            Some(_) => (
                plan.gauges.regions.clone(),
                vec![[0.0; 2 * VALUES]; columns * rows],
            ),
            None => Default::default(),
        };
        Self {
            placed: None,
            regions,
            crossings: Vec::new(),
            nodes,
            columns,
        }
    }

    /// Takes the part to lie so; as taught if none.
    pub fn set(&mut self, plan: &Production, placed: Option<Placed>) {
        let (width, height) = plan.size();
        // Without an alignment parts are taken to lie as taught.
        self.placed = placed.filter(|_| plan.alignment.is_some());
        if let Some(Placed { motion, .. }) = &self.placed {
            for_each_row(&mut self.nodes, self.columns, |row, nodes| {
                let v = (row * SPACING).min(height - 1);
                for (column, node) in nodes.iter_mut().enumerate() {
                    *node = plan.node(motion, ((column * SPACING).min(width - 1), v));
                }
            });
            for (region, taught) in self.regions.iter_mut().zip(&plan.gauges.regions) {
                let to = |at| plan.moved(motion, at);
                region.become_moved(taught, (width, height), to, &mut self.crossings);
            }
        }
    }

    /// A region of the plan, moved with the part.
    pub fn region<'a>(&'a self, plan: &'a Production, at: usize) -> &'a Region {
        match self.placed {
            Some(_) => &self.regions[at],
            None => &plan.gauges.regions[at],
        }
    }

    /// The nodes of row `v` of a frame of `height` rows, interpolated between the rows of nodes above and below.
    pub fn row(&self, v: usize, height: usize, out: &mut [Node]) {
        let (upper, lower) = (
            v / SPACING,
            (v / SPACING + 1).min(self.nodes.len() / self.columns - 1),
        );
        let (top, bottom) = (upper * SPACING, (lower * SPACING).min(height - 1));
        let share = (v - top) as f32 / (bottom - top).max(1) as f32;
        let row = |at: usize| self.nodes[at * self.columns..][..self.columns].as_flattened();
        let (above, below) = (row(upper), row(lower));
        for ((out, a), b) in out.as_flattened_mut().iter_mut().zip(above).zip(below) {
            *out = a + (b - a) * share;
        }
    }
}

/// Nodes along a row of `width` pixels.
fn columns_of(width: usize) -> usize {
    (width - 1).div_ceil(SPACING) + 1
}

/// Nodes for a row of `width` pixels.
pub(super) fn nodes_of_row(width: usize) -> Vec<Node> {
    vec![[0.0; 2 * VALUES]; columns_of(width)]
}

impl Production {
    /// The node at pixel (u, v); NaN where the pixel sees nothing.
    fn node(&self, motion: &Motion, (u, v): (usize, usize)) -> Node {
        let (middle, half) = self.levels;
        let at = |z: f64| {
            let values = self.seen(u, v, z).and_then(|point| {
                let back = motion.undo(point);
                let (column, row) = self.triangulator.camera().project(back)?;
                let (du, dv) = (column - u as f64, row - v as f64);
                Some([du, dv, back.z - point.z])
            });
            values.unwrap_or([f64::NAN; VALUES])
        };
        let (low, high) = (at(middle - half), at(middle + half));
        core::array::from_fn(|i| match i.checked_sub(VALUES) {
            None => ((low[i] + high[i]) / 2.0) as f32,
            Some(i) => ((high[i] - low[i]) / (2.0 * half)) as f32,
        })
    }

    /// The point at height `z` that pixel (u, v) sees.
    fn seen(&self, u: usize, v: usize, z: f64) -> Option<Vector> {
        self.triangulator
            .point(u, v, crate::units::Height::from_mm(z))
    }

    /// Where the point of the part that was seen at (u, v) when it was taught is seen now.
    fn moved(&self, motion: &Motion, (u, v): (f64, f64)) -> (f64, f64) {
        let (width, height) = self.size();
        let column = libm::rint(u.clamp(0.0, (width - 1) as f64));
        let row = libm::rint(v.clamp(0.0, (height - 1) as f64));
        let taught = self.cubics.surface().height[row as usize * width + column as usize];
        let z = if taught.is_known() {
            taught.mm()
        } else {
            self.levels.0
        };
        let to = self
            .seen(column as usize, row as usize, z)
            .and_then(|point| self.triangulator.camera().project(motion.apply(point)));
        to.map_or((u, v), |to| (u + to.0 - column, v + to.1 - row))
    }
}
