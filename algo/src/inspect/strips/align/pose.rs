//! The pose field: by how much the motion of a part displaces what each pixel sees.
//!
//! A pixel that sees height z sees the part's point p. With the motion taken back, p is seen at (u,
//! v) + (du, dv) and lies dz higher. These three values are worked out at nodes, for three heights
//! each, and interpolated between: over the distance of two nodes they are linear and over the
//! heights of a part quadratic in good approximation (0.003 pixels, see [`SPACING`]).

use super::displaced::{BLOCK, BlockNumbers, Node, between, interpolate};
use crate::geometry::Vector;
use crate::inspect::align::{Motion, Placed};
use crate::inspect::region::{CrossedEdge, Region};
use crate::inspect::strips::golden::Golden;
use crate::pipeline::for_each_row;
use crate::simd::Backend;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Pixels from node to node. A turn by half a degree seen through 22° over 1456 pixels is bent by
/// 0.003 pixels between them.
pub const SPACING: usize = 64;

/// The points that a node's pixel sees below, at and above the middle height; NaN where it sees
/// nothing.
type NodeSight = [Vector; 3];

/// How the part of a cycle lies, and what that does to every pixel.
#[derive(Debug)]
pub struct PoseField {
    /// None if the part is taken to lie as taught; then regions and blocks are not used.
    pub placed: Option<Placed>,
    /// The regions of the gauges, moved with the part.
    regions: Vec<Region>,
    crossed: Vec<CrossedEdge>,
    /// Of the nodes, row-major.
    sights: Vec<NodeSight>,
    /// The displacements of the blocks along the rows of nodes, row-major.
    blocks: Vec<BlockNumbers>,
    /// Blocks of a row.
    across: usize,
}

impl PoseField {
    /// Of a part that lies as taught; for others, too, if parts are `aligned`.
    pub fn new(golden: &Golden, regions: &[Region], aligned: bool) -> Self {
        let (width, height) = golden.size();
        let across = width.div_ceil(BLOCK);
        let (regions, sights, blocks) = match aligned {
            true => {
                let sights: Vec<_> = nodes(height)
                    .flat_map(|v| nodes(width).map(move |u| sight(golden, (u, v))))
                    .collect();
                let rows = nodes(height).count();
                let blocks = vec![BlockNumbers::default(); across * rows];
                (regions.to_vec(), sights, blocks)
            }
            false => Default::default(),
        };
        Self {
            placed: None,
            regions,
            crossed: Vec::new(),
            sights,
            blocks,
            across,
        }
    }

    /// Bytes of its regions.
    pub fn bytes(&self) -> usize {
        self.regions.iter().map(Region::bytes).sum()
    }

    /// Takes the part with these regions to lie so; as taught if none.
    pub fn set(&mut self, golden: &Golden, regions: &[Region], placed: Option<Placed>) {
        // Parts that are not aligned are taken to lie as taught.
        self.placed = placed.filter(|_| !self.sights.is_empty());
        if let Some(Placed { motion, .. }) = self.placed {
            let motion = &motion;
            self.displace(golden, motion);
            for (region, taught) in self.regions.iter_mut().zip(regions) {
                let to = |at| moved(golden, motion, at);
                region.become_moved(taught, golden.size(), to, &mut self.crossed);
            }
        }
    }

    /// Finds the displacements by a motion, without the regions of gauges.
    pub fn displace(&mut self, golden: &Golden, motion: &Motion) {
        let width = golden.size().0;
        let (sights, columns) = (&self.sights, nodes(width).count());
        for_each_row(&mut self.blocks, self.across, |row, blocks| {
            let sights = &sights[row * columns..][..columns];
            displace(
                golden,
                motion,
                nodes(width).zip(sights),
                row * SPACING,
                blocks,
            );
        });
    }

    /// One of the regions, moved with the part.
    pub fn region<'a>(&'a self, regions: &'a [Region], at: usize) -> &'a Region {
        match self.placed {
            Some(_) => &self.regions[at],
            None => &regions[at],
        }
    }

    /// The displacements of the blocks of some columns of row `v` of a frame of `height` rows,
    /// interpolated between the rows of nodes above and below. The others are left as they are.
    pub fn row(
        &self,
        backend: Backend,
        (v, height): (usize, usize),
        columns: &Range<usize>,
        out: &mut [BlockNumbers],
    ) {
        let (upper, lower) = (
            v / SPACING,
            (v / SPACING + 1).min(self.blocks.len() / self.across - 1),
        );
        let (top, bottom) = (upper * SPACING, (lower * SPACING).min(height - 1));
        let share = (v - top) as f32 / (bottom - top).max(1) as f32;
        let here = columns.start / BLOCK..columns.end.div_ceil(BLOCK);
        let row = |at: usize| &self.blocks[at * self.across..][here.clone()];
        let (above, below) = (row(upper), row(lower));
        interpolate(backend, above, below, share, &mut out[here.clone()]);
    }
}

/// The places of the nodes along `pixels` pixels: every [`SPACING`]th, and the last.
fn nodes(pixels: usize) -> impl Iterator<Item = usize> {
    (0..(pixels - 1).div_ceil(SPACING) + 1).map(move |at| (at * SPACING).min(pixels - 1))
}

/// Displacements for the blocks of a row of `width` pixels.
pub fn blocks_of_row(width: usize) -> Vec<BlockNumbers> {
    vec![BlockNumbers::default(); width.div_ceil(BLOCK)]
}

/// What the node at pixel (u, v) sees.
fn sight(golden: &Golden, (u, v): (usize, usize)) -> NodeSight {
    let (middle, half) = golden.levels;
    let nothing = Vector::new(f64::NAN, f64::NAN, f64::NAN);
    [middle - half, middle, middle + half].map(|z| golden.seen(u, v, z).unwrap_or(nothing))
}

/// The displacements by a motion of the blocks between nodes along row `v`, given with their
/// columns; NaN where one sees nothing.
fn displace<'a>(
    golden: &Golden,
    motion: &Motion,
    nodes: impl Iterator<Item = (usize, &'a NodeSight)>,
    v: usize,
    blocks: &mut [BlockNumbers],
) {
    let v = v.min(golden.size().1 - 1);
    let mut left: Option<(usize, Node)> = None;
    for (u, sight) in nodes {
        let node = node(golden, motion, (u, v), sight);
        let (start, from) = left.unwrap_or((u, node));
        let here = &mut blocks[start / BLOCK..u / BLOCK + 1];
        for (at, block) in here.iter_mut().enumerate() {
            *block = between([&from, &node], u - start, at * BLOCK, golden.levels.0);
        }
        left = Some((u, node));
    }
}

/// The displacement by a motion of what the node at pixel (u, v) sees.
fn node(golden: &Golden, motion: &Motion, (u, v): (usize, usize), sight: &NodeSight) -> Node {
    let at = |point: Vector| displacement(golden, motion, (u, v), point);
    let ([low, middle, high], half) = (sight.map(at), golden.levels.1);
    [
        middle,
        core::array::from_fn(|i| (high[i] - low[i]) / (2.0 * half)),
        core::array::from_fn(|i| (high[i] - 2.0 * middle[i] + low[i]) / (2.0 * half * half)),
    ]
}

/// The displacement by a motion of a point that pixel (u, v) sees: columns, rows, and mm in height.
pub fn displacement(
    golden: &Golden,
    motion: &Motion,
    (u, v): (usize, usize),
    point: Vector,
) -> [f64; 3] {
    let back = motion.undo(point);
    let to = golden.triangulator.camera().project(back);
    let (column, row) = to.unwrap_or((f64::NAN, f64::NAN));
    [column - u as f64, row - v as f64, back.z - point.z]
}

/// Where the point of the part that was seen at (u, v) when it was taught is seen now.
fn moved(golden: &Golden, motion: &Motion, (u, v): (f64, f64)) -> (f64, f64) {
    let ((column, row), seen) = golden.nearest([u, v]);
    let camera = golden.triangulator.camera();
    let to = seen.and_then(|point| camera.project(motion.apply(point)));
    to.map_or((u, v), |to| {
        (u + to.0 - column as f64, v + to.1 - row as f64)
    })
}
