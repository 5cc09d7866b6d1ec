//! The residuals of an adjustment with their places, to be drawn as arrows: a pattern that repeats
//! from pose to pose shows what the models lack.

use super::adjust::{Adjusted, View, places};
use alloc::vec::Vec;

/// One residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Place in the device's picture, px.
    pub at: (f64, f64),
    /// What was seen minus what the models predict, px.
    pub off: (f64, f64),
}

impl Adjusted {
    /// The residuals of one pose: of its corners in the camera, and of its nodes in the projector.
    pub fn arrows(&self, pose: usize, view: &View) -> [Vec<Arrow>; 2] {
        let (rig, lies) = (&self.rig, &self.rig.poses[pose]);
        let arrow = |at: (f64, f64), predicted: (f64, f64)| Arrow {
            at,
            off: (at.0 - predicted.0, at.1 - predicted.1),
        };
        let corners = places(rig, view)
            .filter_map(|(corner, place)| Some(arrow(corner, rig.corner(lies, place)?)));
        let nodes = view
            .nodes
            .iter()
            .filter_map(|node| Some(arrow(node.lit_by, rig.node(lies, node.at)?)));
        [corners.collect(), nodes.collect()]
    }
}
